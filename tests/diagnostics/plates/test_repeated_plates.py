"""Plates that stand in a file more than once."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.plates.repeated_plates import repeated_plates
from kinertia.trial.data import Markers, PlateLoads, Recording
from kinertia.trial.plate_names import selected

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
    (one,) = found([RIGHT, LEFT, copy], [*PLACES, [3.0, 0.0, 0.0]])
    assert (one.code, one.where.plate) == ("P287", "plate 3")
    assert one.evidence["others"].value == "plate 1"
    assert one.evidence["names"].value == '"plate 1", "plate 2"'


def test_the_sum_of_two_is_found_before_and_after_them():
    for order, whole in (([RIGHT + LEFT, RIGHT, LEFT], "plate 1"), ([RIGHT, LEFT, RIGHT + LEFT], "plate 3")):
        (one,) = found(order)
        assert one.where.plate == whole


def test_a_copy_with_another_gain_is_found_at_the_same_place_only():
    assert [one.where.plate for one in found([RIGHT, LEFT, 0.8 * RIGHT], [*PLACES, PLACES[0]])] == ["plate 3"]
    assert found([RIGHT, LEFT, 0.8 * RIGHT], [*PLACES, [3.0, 0.0, 0.0]]) == []


def test_two_belts_in_a_file_as_eight_plates_leave_two():
    forces = [RIGHT, LEFT, RIGHT, LEFT, RIGHT + LEFT, RIGHT, LEFT, RIGHT + LEFT]
    assert sorted(one.where.plate for one in found(forces)) == [f"plate {k}" for k in range(3, 9)]


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
    own = selected(plates, ["c", "a"])
    assert (own.names, own.declared_feet, own.noise_n) == (("a", "c"), ("r", "l"), (0.1, 0.3))
    assert np.array_equal(own.force, force[:, [0, 2]])
    assert np.array_equal(own.moment, 2 * force[:, [0, 2]])
    assert np.array_equal(own.corners, replace(plates).corners[[0, 2]])
