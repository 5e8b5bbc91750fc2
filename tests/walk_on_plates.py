"""Recordings of a simple walk whose steps are on known plates."""

import numpy as np

from kinertia.trial.data import Markers, PlateLoads, Recording

FEET = {"r": ["R.Heel", "R.Toe"], "l": ["L.Heel", "L.Toe"]}
STRIDE_S, STRIDE_M, RATE_HZ, LOAD_RATE_HZ = 1.0, 1.2, 100, 1000
ROLL_M = 0.1
"""By which the centre of pressure goes forwards under a foot."""


def foot_path(time, first_contact_s, stance_s, stride_m=STRIDE_M, rise_m=0.0):
    """Forward place and height (n,) m of a foot that stands, then swings; a stride, and so much up, each second."""
    stride, phase = np.divmod(time - first_contact_s, STRIDE_S)
    swing = np.clip((phase - stance_s) / (STRIDE_S - stance_s), 0, 1)
    forward = stride_m * (stride + swing - np.sin(2 * np.pi * swing) / (2 * np.pi))
    up = rise_m * (stride + np.clip(2 * swing, 0, 1) ** 2 * (3 - 2 * np.clip(2 * swing, 0, 1)))
    return forward, up + 0.1 * np.sin(np.pi * swing) ** 2


def walk(measured_steps, stance_s=0.6, stride_m=STRIDE_M, duration_s=3.0, belt_m_s=0.0, step_m=0.0):
    """A recording of a walk: right steps at 0.2, 1.2, ... s, left ones half a stride later.

    `measured_steps` holds (side, number) of the steps that hit a plate of their own, in the order of the
    plates. Every step is `step_m` higher than the one before.
    """
    time, load_time = np.arange(0, duration_s, 1 / RATE_HZ), np.arange(0, duration_s, 1 / LOAD_RATE_HZ)
    starts = {"r": 0.2, "l": 0.2 + STRIDE_S / 2}
    positions = []
    for side, z in (("r", 0.1), ("l", -0.1)):
        forward, height = foot_path(time, starts[side], stance_s, stride_m, 2 * step_m)
        height = height + (step_m if side == "l" else 0.0)
        for ahead in (-0.1, 0.1):
            positions.append(np.column_stack((forward + ahead - belt_m_s * time, height + 0.03, np.full_like(time, z))))
    labels = ("R.Heel", "R.Toe", "L.Heel", "L.Toe")
    markers = Markers(time, labels, np.stack(positions, axis=1))
    force = np.zeros((len(load_time), len(measured_steps), 3))
    moment = np.zeros_like(force)
    for p, (side, number) in enumerate(measured_steps):
        begin = starts[side] + STRIDE_S * number
        loaded = (load_time >= begin - 1e-9) & (load_time < begin + stance_s - 1e-9)
        force[loaded, p] = (10.0, 700.0, -5.0)
        place = np.zeros((len(load_time), 3))
        place[:, 0] = foot_path(load_time, starts[side], stance_s, stride_m)[0] - belt_m_s * load_time
        place[:, 0] += ROLL_M * (np.clip((load_time - begin) / stance_s, 0, 1) - 0.5)
        place[:, 2] = 0.1 if side == "r" else -0.1
        place[:, 1] = step_m * (2 * number + (side == "l"))
        moment[:, p] = np.cross(place, force[:, p])
    names = tuple(f"plate {p + 1}" for p in range(len(measured_steps)))
    plates = PlateLoads(load_time, names, force, moment, (None,) * len(names))
    return Recording("walk", markers, plates)


ALL_STEPS = [("r", -1), ("l", -1), ("r", 0), ("l", 0), ("r", 1), ("l", 1), ("r", 2), ("l", 2)]
