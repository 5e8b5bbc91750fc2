"""A plate that is turned or mirrored in the file is named, and what the centre of pressure gains by turning it back."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.trial.centre_of_pressure import centre_of_pressure
from loads_and_feet import error_of, feet_of
from recordings import SYNTHETIC, here, slow_beside

WALKS = here(["synthetic/walk.c3d", "pig_c3d/subject_a_walk.c3d", "pig_c3d/subject_b_walk.c3d"])
QUARTER = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
ASIDE_M = [0.12, 0.0, 0.1]
"""Synthetic plates have their middle where the foot stands, about which two turns may look alike."""
MISTAKES = (
    ("rotated by 180 degrees", QUARTER @ QUARTER),
    ("rotated by 90 degrees", QUARTER),
    ("rotated by -90 degrees", QUARTER.T),
    ("mirrored along X", np.diag([-1.0, 1.0, 1.0])),
    ("mirrored along Z", np.diag([1.0, 1.0, -1.0])),
    ("mirrored along a diagonal", QUARTER @ np.diag([-1.0, 1.0, 1.0])),
    ("mirrored along a diagonal", QUARTER @ np.diag([1.0, 1.0, -1.0])),
)


@pytest.fixture(params=slow_beside(["synthetic/walk.c3d", "pig_c3d/subject_b_walk.c3d"], WALKS))
def walk(request, recording_of):
    recording = recording_of(request.param)
    if not request.param.startswith(SYNTHETIC):
        return recording
    return replace(recording, plates=replace(recording.plates, corners=recording.plates.corners + ASIDE_M))


def found_in(recording, which=(), matrix=None, offset_m=(0.0, 0.0, 0.0)):
    """With loads of some plates turned or mirrored about their middles, or of all elsewhere."""
    plates = recording.plates
    force, moment = plates.force.copy(), plates.moment.copy()
    point = centre_of_pressure(np.concatenate((force, moment), axis=2))
    free = moment - np.cross(point, force)
    for p in which:
        middle = plates.corners[p].mean(axis=0)
        point[:, p] = middle + (point[:, p] - middle) @ matrix.T
        if np.linalg.det(matrix) > 0:  # a turned plate turns the forces, too
            force[:, p] = force[:, p] @ matrix.T
    moment = np.cross(point + np.array(offset_m), force) + free
    wrong = replace(plates, force=force, moment=moment)
    return error_of(replace(recording, plates=wrong), feet_of(recording))


@pytest.mark.parametrize("which", [(0,), (0, 1)])
def test_what_is_found_is_true(walk, which):
    """Loads in the middle of a plate may leave two corrections; then none is named."""
    named = 0
    for operation, matrix in MISTAKES:
        found = found_in(walk, which, matrix)
        if found is None or found.code != "P242":
            continue
        assert found.evidence["plates"].value == " and ".join(walk.plates.names[p] for p in which)
        assert found.evidence["operation"].value == operation
        assert found.evidence["after_m"].value < 0.08 < 0.1 < found.evidence["before_m"].value
        named += 1
    assert named >= 6


@pytest.mark.parametrize("offset_m", [(0.0, 0.0, 0.0), (0.12, 0.0, 0.0), (0.0, 0.0, 0.2), (-0.3, 0.0, 0.1)])
def test_fault_free_and_displaced_plates_are_not_rotated(walk, offset_m):
    found = found_in(walk, offset_m=offset_m)
    assert found is None or found.code != "P242"


@pytest.mark.parametrize("name", here(["pig_c3d/subject_a_walk.c3d", "pig_c3d/subject_b_walk.c3d"]))
def test_the_remedy_is_that_of_the_forces(recording_of, name):
    """Of plates whose horizontal forces were right, the order of the corners was to be corrected."""
    recording, half_turn = recording_of(name), QUARTER @ QUARTER
    turned = found_in(recording, (0, 1), half_turn)
    assert "corners" in turned.evidence["mend"].value
    plates = recording.plates
    about = np.cross(plates.corners.mean(axis=1)[None], plates.force)
    moment = about + (plates.moment - about) * [-1.0, 1.0, -1.0]
    channels = error_of(replace(recording, plates=replace(plates, moment=moment)), feet_of(recording))
    assert (channels.code, channels.evidence["operation"].value) == ("P242", "rotated by 180 degrees")
    assert all(one in channels.remedy for one in ("Fz1 with Fz3", "Fx12 with Fx34", "Fy14 with Fy23"))
    assert channels.causes != turned.causes
