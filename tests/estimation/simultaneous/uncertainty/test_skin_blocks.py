"""Bars of hip flexion moments are longer just after a foot has landed."""

from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.estimation.simultaneous.uncertainty.skin_blocks import GROWTH, LASTS_S, block_growth

TIME = np.arange(200) / 100.0
NAMES = ("pelvis_tilt", "hip_flexion_r", "knee_angle_r", "hip_flexion_l")


def problem(loaded: np.ndarray, ground: np.ndarray | None = None) -> SimpleNamespace:
    """As far as `block_growth` looks at it, with feet (n, 2) that are loaded, and on the ground beside plates."""
    reactions = SimpleNamespace(loaded_at=lambda time: loaded[np.searchsorted(TIME, time - 1e-9)])
    return SimpleNamespace(
        trials=[SimpleNamespace(time=TIME, on_ground=ground)],
        skeleton=SimpleNamespace(coordinates=NAMES),
        loads=SimpleNamespace(reactions=lambda k, static: reactions),
    )


def test_of_the_leg_that_has_landed_and_for_a_while():
    loaded = np.ones((200, 2))
    loaded[50:100, 0] = 0.0
    between = TIME + 0.005
    growth = block_growth(problem(loaded), 0, np.zeros(0), between)
    landed = (between > 1.0) & (between < 1.0 + LASTS_S)
    np.testing.assert_array_equal(growth[:, 1], np.where(landed, GROWTH, 1.0))
    assert (growth[:, [0, 2, 3]] == 1.0).all()


def test_also_beside_the_plates_and_in_the_joint_of_the_hip():
    ground = np.ones((200, 2), dtype=bool)
    ground[50:100, 1] = False
    hips = [SimpleNamespace(label=f"hip_{side}") for side in "rl"]
    growth = block_growth(problem(np.zeros((200, 2)), ground), 0, np.zeros(0), TIME, hips)
    landed = (TIME > 0.995) & (TIME < 1.0 + LASTS_S)
    for column in (3, 10):  # the coordinate, and the first of six components of the left hip
        np.testing.assert_array_equal(growth[:, column], np.where(landed, GROWTH, 1.0))
    assert growth.shape == (200, 16)
    assert (np.delete(growth, [3, 10], axis=1) == 1.0).all()


@pytest.mark.parametrize("weight", [0.0, 1.0])
def test_nobody_lands_who_stands_or_flies(weight):
    assert (block_growth(problem(np.full((200, 2), weight)), 0, np.zeros(0), TIME) == 1.0).all()
