"""Two trials with a stride of both legs, or one with a squat, show the axes of the knees."""

from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.estimation.knee_excursion import show_knee_axes
from kinertia.model.gait27 import KNEES


def poses(right_deg, left_deg):
    swing = 0.5 - 0.5 * np.cos(np.linspace(0.0, 2.0 * np.pi, 101))
    return SimpleNamespace(coordinates=KNEES, q=np.radians(np.outer(swing, [right_deg, left_deg])))


WALK, SQUAT, STANDING = poses(60.0, 58.0), poses(100.0, 95.0), poses(3.0, 2.0)


@pytest.mark.parametrize(
    ("trials", "shown"),
    [
        ([WALK], False),
        ([WALK, STANDING], False),
        ([WALK, WALK], True),
        ([SQUAT], True),
        ([WALK, poses(60.0, 5.0)], False),
        ([SimpleNamespace(coordinates=(), q=np.empty((9, 0)))], False),
    ],
)
def test_what_shows_the_axes(trials, shown):
    assert show_knee_axes(trials) is shown


def test_frames_without_a_pose_and_single_frames_do_not_count():
    trial = poses(20.0, 20.0)
    trial.q[5] = np.nan
    trial.q[50] = np.pi
    assert not show_knee_axes([trial, trial])
