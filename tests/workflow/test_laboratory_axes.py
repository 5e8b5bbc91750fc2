"""Where a laboratory has its origin, and which way people walk in it, does not change their joint moments."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinertia.settings import Subject
from kinertia.trial.data import Recording
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.estimate import estimate_bsp
from kinertia.workflow.person import Person


def displaced(recording: Recording, turned_deg: float, by_m: tuple[float, float, float]) -> Recording:
    """Return a recording in a laboratory with another origin and other horizontal axes."""
    turn = Rotation.from_euler("y", turned_deg, degrees=True).as_matrix()
    markers = replace(recording.markers, positions=recording.markers.positions @ turn.T + by_m)
    plates = recording.plates
    if plates is None:
        return replace(recording, markers=markers)
    force = plates.force @ turn.T
    moment = plates.moment @ turn.T + np.cross(by_m, force)
    corners = None if plates.corners is None else plates.corners @ turn.T + by_m
    return replace(recording, markers=markers, plates=replace(plates, force=force, moment=moment, corners=corners))


@pytest.mark.slow
@pytest.mark.parametrize("whole", [True, False], ids=["all walk", "cut off in mid-stance"])
def test_joint_moments_are_the_same_in_other_axes(recording_of, whole):
    def curves(turned_deg: float, by_m: tuple[float, float, float]):
        walk, static = (
            displaced(recording_of(f"synthetic/{kind}.c3d"), turned_deg, by_m) for kind in ("walk", "static")
        )
        given = TrialInput(walk, None if whole else (1.2, 2.1), 0.25)
        fit = estimate_bsp(Person(Subject(name="A", sex="male"), [given], static))
        return fit.trials[0].joint_curves

    here, there = curves(0.0, (0.0, 0.0, 0.0)), curves(180.0, (7.0, 0.0, -4.0))
    for quantity in ("moments", "forces"):
        np.testing.assert_allclose(
            getattr(there.joints["estimate"], quantity), getattr(here.joints["estimate"], quantity), atol=0.02
        )
    np.testing.assert_allclose(there.moment_sd, here.moment_sd, rtol=0.01, atol=0.01)
