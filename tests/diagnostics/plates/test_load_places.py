"""Loads that are not under the feet, or not when they stand, are named by their cause; sound ones never are."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kinertia.io.marker_set_file import choose_marker_set, read_marker_set
from kinertia.trial.centre_of_pressure import centre_of_pressure
from kinertia.trial.data import Markers, PlateLoads
from kinertia.trial.sampled_time import runs
from loads_and_feet import load_places_doubts, load_places_trouble
from recordings import RUNS, SQUATS, WALKS
from walk_on_plates import ALL_STEPS
from walk_on_plates import FEET as SIMPLE_FEET
from walk_on_plates import walk as simple_walk

ON_BELTS = {
    **{f"run, {name}": RUNS[name] for name in RUNS if name != "hamner"},
    **{f"walk, {name}": WALKS[name] for name in ("synthetic", "gait2354") if name in WALKS},
}


BESIDE_MM = {"synthetic": -8.0, "synthetic c3d": -10.0}
"""Along Z, from the line between heel and toe to the centres of pressure of the package's walk."""


@pytest.fixture(params=WALKS)
def name(request):
    return request.param


@pytest.fixture
def walk(name, recording_of):
    """A walk and the labels of its feet."""
    recording = recording_of(*WALKS[name])
    feet = choose_marker_set(recording.markers.labels).foot_labels()
    return recording, {
        side: [one for one in labels if one in recording.markers.labels] for side, labels in feet.items()
    }


def moved(recording, offset_m, factor=1.0):
    """Centres of pressure times a factor, and somewhere else."""
    plates = recording.plates
    point = centre_of_pressure(np.concatenate((plates.force, plates.moment), axis=2))
    to = factor * point + np.array(offset_m)
    return replace(recording, plates=replace(plates, moment=plates.moment + np.cross(to - point, plates.force)))


def shifted(recording, by_s):
    """Forces later by so much."""
    plates = recording.plates
    rows = round(by_s / float(plates.time[1] - plates.time[0]))
    earlier = np.clip(np.arange(len(plates.time)) - rows, 0, len(plates.time) - 1)
    late = replace(plates, force=plates.force[earlier], moment=plates.moment[earlier])
    return replace(recording, plates=late)


def test_sound_walks(walk):
    assert load_places_trouble(*walk) == ""
    assert load_places_doubts(*walk) == []


@pytest.mark.parametrize("offset_m", [0.05, -0.05])
def test_offsets_across_the_walk(name, walk, offset_m):
    recording, feet = walk
    (doubt,) = load_places_doubts(moved(recording, (0.0, 0.0, offset_m)), feet)
    assert "centres of pressure of both feet are off" in doubt
    offset_mm = float(doubt.partition("along X and ")[2].partition(" mm")[0])
    assert offset_mm == pytest.approx(1e3 * offset_m + BESIDE_MM.get(name, 0.0), abs=10)


@pytest.mark.parametrize("offset_m", [0.3, -0.3])
def test_other_origins(walk, offset_m):
    recording, feet = walk
    trouble = load_places_trouble(moved(recording, (offset_m, 0.0, 0.0)), feet) or "".join(
        load_places_doubts(moved(recording, (offset_m, 0.0, 0.0)), feet)
    )
    assert "entres of pressure" in trouble


@pytest.mark.parametrize("offset_m", [0.1, -0.1])
def test_offsets_along_the_walk(name, walk, offset_m):
    """As long as loads lie along the foot: where they begin and end tells. Synthetic ones begin at the heel itself."""
    recording, feet = walk
    ahead_m = 0.02 if name.startswith("synthetic") and offset_m > 0 else 0.0
    other = moved(recording, (offset_m + ahead_m, 0.0, 0.0))
    trouble = load_places_trouble(other, feet) or "".join(load_places_doubts(other, feet))
    assert "centres of pressure" in trouble


def test_points_in_mm(walk):
    recording, feet = walk
    assert "they are in mm" in load_places_trouble(moved(recording, (0.0, 0.0, 0.0), factor=1000.0), feet)


@pytest.mark.parametrize("by_s", [-0.12, 0.09, 0.2])
def test_clocks(walk, by_s):
    recording, feet = walk
    trouble = load_places_trouble(shifted(recording, by_s), feet)
    assert trouble.startswith("the forces are ")
    assert ("late" if by_s > 0 else "early") in trouble
    late_ms = float(trouble.partition("are ")[2].partition(" ms")[0])
    assert late_ms == pytest.approx(1e3 * abs(by_s), abs=35)


@pytest.mark.parametrize("late_s", [-0.015, 0.015])
def test_what_the_estimate_puts_right_is_not_refused(walk, late_s):
    recording, feet = walk
    assert load_places_trouble(shifted(moved(recording, (0.02, 0.0, 0.0)), late_s), feet) == ""


def slowed(recording, factor):
    """With times between frames that are so many times as long."""
    markers = recording.markers
    time = markers.time[0] + factor * (markers.time - markers.time[0])
    return replace(recording, markers=Markers(time, markers.labels, markers.positions))


@pytest.mark.parametrize("factor", [0.5, 1.5])
def test_rates(walk, factor):
    recording, feet = walk
    assert_rate(load_places_trouble(slowed(recording, factor), feet), factor)


def assert_rate(trouble, factor):
    assert "frame rate" in trouble
    times = float(trouble.partition("by a factor of about ")[2].partition(":")[0])
    assert times == pytest.approx(1 / factor, rel=0.05)


def test_half_the_rate(name, walk):
    """Where that is not told by when feet land and leave, it is by how long they stand."""
    recording, feet = walk
    trouble = load_places_trouble(slowed(recording, 2.0), feet)
    if name.startswith("synthetic"):
        assert "frame rate" in trouble
        assert float(trouble.partition("is wrong (by ")[2].partition(")")[0]) == pytest.approx(2.0, abs=0.15)
    else:
        assert_rate(trouble, 2.0)


def test_a_walk_on_one_long_plate(walk):
    """A load that goes from foot to foot is no long stance."""
    recording, feet = walk
    plates = recording.plates
    force, moment = (part.sum(axis=1, keepdims=True) for part in (plates.force, plates.moment))
    one = replace(recording, plates=PlateLoads(plates.time, ("plate",), force, moment, (None,)))
    assert load_places_trouble(one, feet) == ""


@pytest.mark.parametrize("name", SQUATS)
def test_squats_on_one_plate(recording_of, name):
    """The load is between the feet all the time: not of another trial, but both feet on one plate."""
    squats = recording_of(*SQUATS[name])
    own = read_marker_set(Path(__file__).parents[1] / "subject4.toml") if name == "subject4" else None
    feet = (own or choose_marker_set(squats.markers.labels)).foot_labels()
    plates = squats.plates
    force, moment = (part.sum(axis=1, keepdims=True) for part in (plates.force, plates.moment))
    one = replace(squats, plates=PlateLoads(plates.time, ("plate",), force, moment, (None,)))
    assert load_places_trouble(one, feet) == ""
    assert any("both feet are on it" in doubt for doubt in load_places_doubts(one, feet))


@pytest.mark.parametrize("stride_m", [1.2, 0.9])
def test_a_made_up_walk(stride_m):
    recording = simple_walk(ALL_STEPS, stride_m=stride_m)
    assert load_places_trouble(recording, SIMPLE_FEET) == ""
    assert load_places_doubts(recording, SIMPLE_FEET) == []


def test_plates_that_are_exchanged():
    recording = simple_walk([("r", 0), ("l", 0)])
    plates = recording.plates
    point = centre_of_pressure(np.concatenate((plates.force, plates.moment), axis=2))
    loaded = plates.force[..., 1] > 0
    middle = [point[loaded[:, p], p].mean(axis=0) for p in range(2)]
    size = 0.3 * np.array([[1, 0, 1], [-1, 0, 1], [-1, 0, -1], [1, 0, -1]])
    corners = np.array([place + size for place in middle])
    sound = replace(recording, plates=replace(plates, corners=corners))
    assert load_places_trouble(sound, SIMPLE_FEET) == ""
    there = np.array([middle[1] - middle[0], middle[0] - middle[1]])  # to the other plate's place
    moment = plates.moment + np.cross(there, plates.force)
    wrong = replace(plates, force=plates.force[:, ::-1], moment=moment[:, ::-1], corners=corners)
    trouble = load_places_trouble(replace(recording, plates=wrong), SIMPLE_FEET)
    assert "the loads of plate 1 and plate 2" in trouble
    assert "exchanged" in trouble


@pytest.mark.parametrize("apart_m", [0.5, -0.4])
@pytest.mark.parametrize("name", ON_BELTS)
def test_belts_that_are_exchanged(recording_of, name, apart_m):
    """Each load lies on the other belt, and goes there as it would on its own."""
    run = recording_of(*ON_BELTS[name])
    feet = choose_marker_set(run.markers.labels).foot_labels()
    offset_m = np.array([[0.0, 0.0, apart_m], [0.0, 0.0, -apart_m]])
    trouble = load_places_trouble(moved(run, offset_m), feet)
    assert "the plates or belts are exchanged" in trouble
    first_mm = float(trouble.partition("along X and ")[2].partition(" mm")[0])
    assert first_mm == pytest.approx(1e3 * apart_m, abs=40)
    one_off = load_places_trouble(moved(run, np.array([[0.0, 0.0, apart_m], [0.0, 0.0, 0.0]])), feet)
    assert "exchanged" not in one_off


def test_both_feet_on_a_plate():
    """The left foot lands on the right foot's plate, and comes to its own later."""
    recording = simple_walk([("r", 0), ("l", 0)])
    plates = recording.plates
    time = plates.time
    force, moment = plates.force.copy(), plates.moment.copy()
    rows = (time >= 0.7) & (time < 0.78)  # both are down from 0.7 to 0.8 s
    for part in (force, moment):
        part[rows, 0] += part[rows, 1]
        part[rows, 1] = 0.0
    (doubt,) = load_places_doubts(replace(recording, plates=replace(plates, force=force, moment=moment)), SIMPLE_FEET)
    assert "both feet are on it (plate 1 from 0.7" in doubt


@pytest.mark.parametrize("name", [name for name in RUNS if name != "hamner"])
def test_a_foot_that_swings_is_on_no_plate(recording_of, name):
    """A runner's centre of pressure that is off the foot is not the other foot's, which is in the air."""
    run = recording_of(*RUNS[name])
    feet = choose_marker_set(run.markers.labels).foot_labels()
    doubts = load_places_doubts(moved(run, (0.0, 0.0, 0.13)), feet)
    assert doubts
    assert not any("both feet are on it" in doubt for doubt in doubts)


def along(recording, plate, share):
    """The centre of pressure of one plate this many times as far from where it is on average under each step."""
    plates = recording.plates
    point = centre_of_pressure(np.concatenate((plates.force, plates.moment), axis=2))
    for first, last in runs(plates.force[:, plate, 1] > 0):
        step = point[first : last + 1, plate]
        point[first : last + 1, plate] = step.mean(axis=0) + share * (step - step.mean(axis=0))
    return replace(recording, plates=replace(plates, moment=np.cross(point, plates.force)))


@pytest.mark.parametrize(("share", "said"), [(-1.5, "goes from toe to heel, by "), (0.0, "never moves while somebody")])
def test_a_load_that_does_not_travel(share, said):
    recording = simple_walk([("r", 0), ("l", 0)])
    (doubt,) = load_places_doubts(along(recording, 1, share), SIMPLE_FEET)
    assert doubt.startswith("the centre of pressure of plate 2 ")
    assert said in doubt
    assert not any("toe to heel" in one for one in load_places_doubts(along(recording, 1, 0.3), SIMPLE_FEET))
