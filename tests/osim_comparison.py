"""What our own and OpenSim's reading of a model file must agree on."""

from pathlib import Path

import numpy as np
import pytest

from kinertia.model.imported_model import OsimModel
from kinertia.motion.dynamics import Motion, inverse_dynamics
from recordings import here

SYNTHETIC, GAIT2354, RAJAGOPAL = "synthetic/scaled.osim", "gait2354/subject01_scaled.osim", "rajagopal_walk/scaled.osim"
SMALL = here([SYNTHETIC, GAIT2354])
LARGE = here(["rajagopal_walk/Rajagopal2016.osim", RAJAGOPAL, "subject4/addbiomechanics_scaled.osim"])
MODELS = [*SMALL, *LARGE]
SLOW_IF_LARGE = [*SMALL, *(pytest.param(name, marks=pytest.mark.slow) for name in LARGE)]
"""Files of models; comparisons of large ones take seconds."""
N_STATES = 20


def random_states(ours: OsimModel, n: int, speed: float, seed: int = 0) -> Motion:
    """Coordinates within their ranges (at most 1.5 rad or m from zero)."""
    rng = np.random.default_rng(seed)
    ranges = {c.name: c.range for c in ours.coordinates}
    low, high = np.clip([ranges[name] for name in ours.skeleton.coordinates], -1.5, 1.5).T
    q = rng.uniform(low, high, (n, len(low)))
    return Motion(q, rng.normal(0, speed, q.shape), rng.normal(0, 20.0, q.shape))


def free_dynamics(ours: OsimModel, motion: Motion) -> np.ndarray:
    """Inverse dynamics without external loads."""
    return inverse_dynamics(ours.skeleton, ours.bsp, motion, np.zeros((len(motion.q), 0, 6)), ())


def mass_matrices(ours: OsimModel, q: np.ndarray) -> np.ndarray:
    """(n, c, c): column by column, the forces of a unit acceleration at rest less those of gravity."""
    still = np.zeros_like(q)
    weight = free_dynamics(ours, Motion(q, still, still))
    columns = [free_dynamics(ours, Motion(q, still, still + unit)) - weight for unit in np.eye(q.shape[1])]
    return np.stack(columns, axis=-1)


def assert_opensim_agrees(path: Path, ours: OsimModel, speed: float = 1.0) -> None:
    """Markers, mass matrix, and inverse dynamics at this speed; velocity terms at 3 rad/s by Lagrange's equations."""
    from osim_oracle import OsimOracle

    oracle = OsimOracle(path, ours)
    motion = random_states(ours, N_STATES, speed)
    markers = ours.skeleton.marker_positions(ours.skeleton.pose(motion.q))
    tau, mass = free_dynamics(ours, motion), mass_matrices(ours, motion.q)
    for k, state in enumerate(zip(motion.q, motion.qd, motion.qdd, strict=True)):
        oracle.pose(*state[:2])
        np.testing.assert_allclose(markers[k], oracle.markers(), atol=1e-9)
        expected = oracle.inverse_dynamics(*state)
        np.testing.assert_allclose(tau[k], expected, atol=1e-4 * np.abs(expected).max())
        expected = oracle.mass_matrix(state[0])
        np.testing.assert_allclose(mass[k], expected, atol=1e-9 * np.abs(expected).max())
    fast = random_states(ours, 4, 3.0, seed=1)
    still = np.zeros_like(fast.q)
    velocity = free_dynamics(ours, Motion(fast.q, fast.qd, still)) - free_dynamics(ours, Motion(fast.q, still, still))
    for k in range(4):
        expected = oracle.coriolis(fast.q[k], fast.qd[k])
        np.testing.assert_allclose(velocity[k], expected, atol=1e-4 * np.abs(expected).max() + 1e-6)
