"""Forces in wrong axes, with wrong signs, units and zeros are named; sound ones never are."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinertia.diagnostics.evidence.caused_velocity import caused_velocities
from kinertia.diagnostics.plates.force_faults import direction_trouble, offset_trouble
from kinertia.diagnostics.plates.one_plate import plate_sign_trouble
from kinertia.diagnostics.plates.plate_faults import loads_trouble
from kinertia.io.marker_set_file import choose_marker_set, read_marker_set
from kinertia.trial.centre_of_pressure import centre_of_pressure
from kinertia.trial.data import Markers, PlateLoads
from kinertia.trial.plate_assignment import build_trial
from recordings import RUNS, SQUATS, WALKS


@pytest.fixture(params=WALKS)
def walk(request, recording_of):
    return recording_of(*WALKS[request.param])


def with_force(walk, change, torque=1.0):
    """The walk with other forces at the same centres of pressure, and torques times a factor."""
    plates = walk.plates
    wrench = np.concatenate((plates.force, plates.moment), axis=2)
    point = centre_of_pressure(wrench)
    free = torque * (plates.moment - np.cross(point, plates.force)) * [0, 1, 0]
    force = change(plates.force)
    return replace(walk, plates=replace(plates, force=force, moment=np.cross(point, force) + free))


def trouble_of(walk, marker_set=None):
    """What is said of the forces of a walk."""
    if trouble := loads_trouble(walk.plates):
        return trouble
    marker_set = marker_set or choose_marker_set(walk.markers.labels)
    trial = sorted_by_foot(walk, marker_set)
    parts = caused_velocities(trial, owners_of(marker_set))
    return direction_trouble(trial, parts) or offset_trouble(parts)


def sorted_by_foot(walk, marker_set=None):
    present = set(walk.markers.labels)
    feet = (marker_set or choose_marker_set(walk.markers.labels)).foot_labels()
    return build_trial(walk, {side: [one for one in labels if one in present] for side, labels in feet.items()})


def test_sound_walks_are_not_doubted(walk):
    assert trouble_of(walk) == ""


@pytest.mark.parametrize("axis", ["X", "Z"])
@pytest.mark.parametrize("plate", [0, 1])
def test_the_sign_of_one_plate(walk, axis, plate):
    signs = np.ones((2, 3))
    signs[plate, "XYZ".index(axis)] = -1.0
    wrong = with_force(walk, lambda force: force * signs)
    trouble = one_plate_trouble(wrong)
    assert trouble.startswith(f"the horizontal force of {walk.plates.names[plate]} along {axis} has the wrong sign")
    assert one_plate_trouble(walk) == ""
    assert one_plate_trouble(with_force(walk, lambda force: force * np.prod(signs, axis=0))) == ""


@pytest.fixture(params=[name for name in RUNS if name != "hamner"])
def run(request, recording_of):
    """Limbs swing so much that the pelvis does not move as the centre of mass."""
    return recording_of(*RUNS[request.param])


@pytest.mark.parametrize("axis", ["X", "Z"])
@pytest.mark.parametrize("plate", [0, 1])
def test_the_sign_of_one_plate_in_a_run(run, plate, axis):
    assert one_plate_trouble(run) == ""
    signs = np.ones((2, 3))
    signs[plate, "XYZ".index(axis)] = -1.0
    trouble = one_plate_trouble(with_force(run, lambda force: force * signs))
    assert trouble.startswith(f"the horizontal force of {run.plates.names[plate]} along {axis} has the wrong sign")


@pytest.mark.parametrize(
    ("plates", "axis", "newton"),
    [([0], 2, 50.0), ([0], 2, -50.0), ([1], 2, 50.0), ([1], 2, -50.0), ([0, 1], 2, 50.0), ([0, 1], 0, -50.0)],
)
def test_a_wrong_zero_is_not_called_a_wrong_sign(walk, newton, plates, axis):
    """Across the walk a foot pushes to one side all the time: turned, it is nearly another zero, and both are named."""
    zero = np.zeros((2, 3))
    zero[plates, axis] = newton
    wrong = with_force(walk, lambda force: force + zero * (force[..., 1:2] > 0.0))
    trouble = one_plate_trouble(wrong) or trouble_of(wrong)
    assert "zero" in trouble
    if "wrong sign" in trouble:
        assert len(plates) == 1
        assert trouble.startswith(f"the horizontal force of {walk.plates.names[plates[0]]} along {'XYZ'[axis]}")
        assert_offset(trouble, newton)


def assert_offset(trouble, newton):
    assert float(trouble.partition("off by ")[2].partition(" N")[0]) == pytest.approx(newton, abs=10)


def test_signs_over_two_windows(walk):
    """Each window has its own trend, and the number of samples that it has."""
    trial = sorted_by_foot(walk)
    (start, end), *_ = trial.windows()
    last = trial.windows()[0][1]
    cut = np.abs(trial.markers.time - (start + 0.45 * (end - start))) < 1.5 / trial.markers.rate_hz
    parted = replace(trial, measured=trial.measured & ~cut)
    owners = owners_of(choose_marker_set(walk.markers.labels))
    assert len([one for one in parted.windows() if one[1] <= last]) == 2
    assert plate_sign_trouble(walk.plates, caused_velocities(parted, owners)) == ""


def one_plate_trouble(walk):
    marker_set = choose_marker_set(walk.markers.labels)
    parts = caused_velocities(sorted_by_foot(walk, marker_set), owners_of(marker_set))
    return plate_sign_trouble(walk.plates, parts)


def owners_of(marker_set):
    return {label: name for name, labels in marker_set.segments.items() for label in labels}


def on_one_belt(walk):
    """The walk as a treadmill with one belt would have measured it."""
    plates = walk.plates
    force, moment = (part.sum(axis=1, keepdims=True) for part in (plates.force, plates.moment))
    return replace(walk, plates=PlateLoads(plates.time, ("belt",), force, moment, (None,)))


def test_sound_walks_on_one_belt_are_not_doubted(walk):
    """Of both feet only the sum is known, which is all that moves the body."""
    belt = sorted_by_foot(on_one_belt(walk))
    assert max(b - a for a, b in belt.windows()) < 0.7
    assert belt.carried_windows()[0] == pytest.approx(sorted_by_foot(walk).windows()[0], abs=0.25)
    assert trouble_of(on_one_belt(walk)) == ""


@pytest.mark.parametrize("axis", ["X", "Z"])
def test_signs_on_one_belt(walk, axis):
    signs = 1.0 - 2.0 * np.eye(3)["XYZ".index(axis)]
    trouble = trouble_of(with_force(on_one_belt(walk), lambda force: force * signs))
    assert trouble.startswith(f"the horizontal force along {axis} has the wrong sign")


@pytest.mark.parametrize(
    ("signs", "words"),
    [
        ([-1, 1, 1], "the horizontal force along X has the wrong sign"),
        ([1, 1, -1], "the horizontal force along Z has the wrong sign"),
        ([-1, 1, -1], "the forces are turned by 180 degrees about the vertical"),
    ],
)
def test_signs(walk, signs, words):
    assert trouble_of(with_force(walk, lambda force: force * signs)).startswith(words)


@pytest.mark.parametrize(("axis", "name"), [(0, "X"), (2, "Z")])
@pytest.mark.parametrize("offset", [-50.0, 50.0])
def test_horizontal_offsets(walk, axis, name, offset):
    push = offset * np.eye(3)[axis]
    trouble = trouble_of(with_force(walk, lambda force: force + (force[..., 1:2] > 0) * push))
    assert f"N along {name} on average that do not accelerate the body" in trouble
    assert f"show {'+' if offset > 0 else '-'}" in trouble


@pytest.mark.parametrize("offset", [30.0, 50.0, 100.0])
def test_vertical_offsets(walk, offset):
    trouble = trouble_of(with_force(walk, lambda force: force + offset * np.eye(3)[1]))
    assert f"a steady {offset:.0f} N while nobody stands on it" in trouble
    assert "zero" in trouble


def test_torques_in_newton_millimetres(walk):
    assert "they are in N mm" in trouble_of(with_force(walk, lambda force: force, torque=1000.0))


def test_forces_with_another_axis_up(walk):
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    plates = walk.plates
    up = replace(walk, plates=replace(plates, force=plates.force @ turn.T, moment=plates.moment @ turn.T))
    assert "the largest forces point along Z" in trouble_of(up)


@pytest.mark.parametrize("angle", [90, -90])
def test_forces_turned(walk, angle):
    cosine, sine = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    assert trouble_of(with_force(walk, lambda force: force @ turn.T)).startswith(
        f"the forces are turned by {angle} degrees"
    )


HALF, TWICE = (2.0, "less than their true rate"), (0.5, "more than their true rate")
TOO_SHORT_AT_TWICE = ("plug-in gait a", "plug-in gait b")


@pytest.mark.parametrize(
    ("name", "factor", "words"),
    [(name, *rate) for name in WALKS for rate in (HALF, TWICE) if rate == HALF or name not in TOO_SHORT_AT_TWICE],
)
def test_a_file_at_another_rate(recording_of, name, factor, words):
    """Markers and forces of one file, which has one clock."""
    walk = recording_of(*WALKS[name])

    def stretched(time):
        return time[0] + factor * (time - time[0])

    markers, plates = walk.markers, replace(walk.plates, time=stretched(walk.plates.time))
    slow = replace(walk, markers=Markers(stretched(markers.time), markers.labels, markers.positions), plates=plates)
    trouble = trouble_of(slow)
    assert words in trouble
    assert float(trouble.partition("a factor of about ")[2].split(";")[0]) == pytest.approx(2.0, rel=0.2)


@pytest.mark.parametrize(
    ("signs", "words"),
    [
        ([1, 1, 1], ""),
        ([-1, 1, 1], "the horizontal force along X has the wrong sign"),
        ([1, 1, -1], "the horizontal force along Z has the wrong sign"),
        ([-1, 1, -1], "the forces are turned by 180 degrees about the vertical"),
    ],
)
def test_signs_in_a_run(run, signs, words):
    assert one_plate_trouble(run) == ""
    trouble = trouble_of(with_force(run, lambda force: force * signs))
    assert trouble.startswith(words)
    assert bool(trouble) == bool(words)


@pytest.mark.parametrize("name", SQUATS)
def test_squats_are_not_doubted(recording_of, name):
    """The markers' centre goes back where the centre of mass does not: the trunk bends."""
    own = read_marker_set(Path(__file__).parents[1] / "subject4.toml") if name == "subject4" else None
    assert trouble_of(recording_of(*SQUATS[name]), own) == ""


@pytest.mark.parametrize("degrees", [5.0, -4.0])
def test_plates_that_are_not_level(walk, degrees):
    """Weight along a horizontal axis looks like its zero: the message says how far from level it would be."""
    turn = Rotation.from_euler("z", degrees, degrees=True).as_matrix()
    trouble = trouble_of(with_force(walk, lambda force: force @ turn.T))
    assert "the zero of that axis is wrong" in trouble
    assert float(trouble.partition("differ by ")[2].partition(" degrees")[0]) == pytest.approx(abs(degrees), abs=1.0)
