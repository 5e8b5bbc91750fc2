"""A plate that is turned or mirrored in the file is named, and what the centre of pressure gains by turning it back."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.plates.plate_positions import repeated_plates
from kinertia.trial.data import Markers, PlateLoads, Recording
from kinertia.trial.ground_contact import centre_of_pressure
from kinertia.trial.trial_input import selected
from loads_and_feet import error_of, feet_of
from recordings import SYNTHETIC, here, slow_beside
from walk_on_plates import FEET
from walk_on_plates import walk as simple_walk

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
    assert all(channel in channels.remedy for channel in ("Fz1 with Fz3", "Fx12 with Fx34", "Fy14 with Fy23"))
    assert channels.causes != turned.causes


TIME = np.arange(2000) / 1000


SQUARE = np.array([[0.2, 0.0, 0.2], [-0.2, 0.0, 0.2], [-0.2, 0.0, -0.2], [0.2, 0.0, -0.2]])


def step(start_s, side):
    """Force (k, 3) N of a step of 0.6 s, pushing outwards."""
    phase = np.clip((TIME - start_s) / 0.6, 0.0, 1.0)
    vertical = 750.0 * np.sin(np.pi * phase) ** 0.5
    return np.column_stack([120.0 * np.sin(2 * np.pi * phase), vertical, side * 0.06 * vertical])


RIGHT, LEFT = step(0.1, 1.0) + step(1.2, 1.0), step(0.65, -1.0)


PLACES = np.array([[0.0, 0.0, 0.3], [0.0, 0.0, -0.3]])


def found(forces, places=None):
    force = np.stack(forces, axis=1)
    names = tuple(f"plate {k + 1}" for k in range(len(forces)))
    corners = None if places is None else np.array([SQUARE + place for place in places])
    plates = PlateLoads(TIME, names, force, np.zeros_like(force), (None,) * len(names), corners)
    markers = Markers(TIME[::10], ("A",), np.zeros((200, 1, 3)))
    return list(repeated_plates(RecordingContext(Recording("walk", markers, plates))))


def test_two_belts_are_two_plates():
    assert found([RIGHT, LEFT], PLACES) == []


@pytest.mark.parametrize("noise_n", [0.0, 10.0])
def test_a_copy_is_found_whichever_its_place(noise_n):
    rng = np.random.default_rng(1)
    copy = RIGHT + rng.normal(scale=noise_n, size=RIGHT.shape)
    (finding,) = found([RIGHT, LEFT, copy], [*PLACES, [3.0, 0.0, 0.0]])
    assert (finding.code, finding.where.plate) == ("P287", "plate 3")
    assert finding.evidence["others"].value == "plate 1"
    assert finding.evidence["names"].value == '"plate 1", "plate 2"'


def test_the_sum_of_two_is_found_before_and_after_them():
    for order, whole in (([RIGHT + LEFT, RIGHT, LEFT], "plate 1"), ([RIGHT, LEFT, RIGHT + LEFT], "plate 3")):
        (finding,) = found(order)
        assert finding.where.plate == whole


def test_a_copy_with_another_gain_is_found_at_the_same_place_only():
    assert [finding.where.plate for finding in found([RIGHT, LEFT, 0.8 * RIGHT], [*PLACES, PLACES[0]])] == ["plate 3"]
    assert found([RIGHT, LEFT, 0.8 * RIGHT], [*PLACES, [3.0, 0.0, 0.0]]) == []


def test_two_belts_in_a_file_as_eight_plates_leave_two():
    forces = [RIGHT, LEFT, RIGHT, LEFT, RIGHT + LEFT, RIGHT, LEFT, RIGHT + LEFT]
    assert sorted(finding.where.plate for finding in found(forces)) == [f"plate {k}" for k in range(3, 9)]


def test_both_feet_in_a_squat_are_two_plates():
    squat = np.column_stack([0 * TIME, 380.0 + 60.0 * np.sin(6.0 * TIME), 0 * TIME])
    outwards = np.array([0.0, 0.0, 22.0])
    assert found([squat + outwards, squat - outwards], PLACES) == []


def test_the_feet_of_a_person_who_stands_evenly_are_two_plates():
    sway = np.column_stack([0 * TIME, 5.0 * np.sin(6.0 * TIME), 0 * TIME])
    standing = np.array([0.0, 350.0, 0.0])
    assert found([standing + sway, standing - sway], PLACES) == []


def test_selected_plates_keep_what_is_theirs():
    force = np.stack([RIGHT, LEFT, RIGHT + LEFT], axis=1)
    plates = PlateLoads(
        TIME, ("a", "b", "c"), force, 2 * force, ("r", None, "l"), np.array([SQUARE, SQUARE + 1.0, SQUARE + 2.0]),
        noise_n=(0.1, 0.2, 0.3),
    )  # fmt: skip
    chosen = selected(plates, ["c", "a"])
    assert (chosen.names, chosen.declared_feet, chosen.noise_n) == (("a", "c"), ("r", "l"), (0.1, 0.3))
    assert np.array_equal(chosen.force, force[:, [0, 2]])
    assert np.array_equal(chosen.moment, 2 * force[:, [0, 2]])
    assert np.array_equal(chosen.corners, replace(plates).corners[[0, 2]])


def test_a_plate_that_is_interchanged_with_an_unloaded_one():
    recording = simple_walk([("r", 0), ("l", 0), ("r", 1)])
    plates = recording.plates
    point = centre_of_pressure(np.concatenate((plates.force, plates.moment), axis=2))
    loaded = plates.force[..., 1] > 0.0
    middle = np.array([point[shown, p].mean(axis=0) for p, shown in enumerate(loaded.T)])
    corners = middle[:, None] + np.array([[1, 0, 1], [-1, 0, 1], [-1, 0, -1], [1, 0, -1]]) * [0.3, 0.0, 0.09]
    idle = np.array([True, True, False])[:, None]
    force, moment = plates.force * idle, plates.moment * idle
    order = np.array([0, 2, 1])
    moment = moment + np.cross(middle[order] - middle, force)
    wrong = replace(plates, force=force[:, order], moment=moment[:, order], corners=corners)
    found = error_of(replace(recording, plates=wrong), FEET)
    assert [found.code, found.evidence["plate"].value, found.evidence["other"].value] == ["P241", "plate 2", "plate 3"]
