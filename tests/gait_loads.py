"""Vertical forces of a simple gait under two feet."""

import numpy as np

from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.trial.data import FootLoads

RATE_HZ, MASS_KG = 1000, 70.0


def gait_loads(duration_s, stance_s=0.62, stride_s=1.0):
    """Feet that carry the body in turn; the whole force swings twice a stride about body weight."""
    time = np.arange(0, duration_s, 1 / RATE_HZ)
    whole = MASS_KG * GRAVITY_M_S2 * (1 + 0.3 * np.sin(4 * np.pi * time / stride_s + 0.7))
    down = np.stack([(time - start) % stride_s < stance_s for start in (0.2, 0.2 + stride_s / 2)], axis=1)
    force = np.zeros((len(time), 2, 3))
    force[:, :, 1] = whole[:, None] * down / down.sum(axis=1, keepdims=True)
    return FootLoads(time, force, np.zeros_like(force))
