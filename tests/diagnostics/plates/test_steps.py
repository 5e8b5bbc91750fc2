"""Wrong axes and signs are found where one foot alone meets a plate; fault-free forces point to the body. Steps tell
where plates are, by where they act on the feet.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinertia.diagnostics.evidence.plate_contacts import displaced
from kinertia.diagnostics.plates.force_directions import force_directions
from kinertia.diagnostics.plates.steps import (
    OF_HEIGHT,
    ahead_of_usual_m,
    forces_of_steps,
    heel_steps,
    positions_by_feet,
    steps_alone,
)
from plate_findings import context_of, with_force
from recordings import QUICK_WALKS, RUNS, SQUATS, WALKS, slow_beside

X, Z = range(2)
BY_M = np.array([0.03, 0.0])
FAULT_FREE = {**WALKS, **RUNS, **SQUATS}


@pytest.fixture(params=slow_beside(QUICK_WALKS, WALKS))
def walk(request, recording_of):
    """Two steps on two plates."""
    return recording_of(*WALKS[request.param])


@pytest.fixture(params=slow_beside(("synthetic c3d", "rajagopal"), [name for name in WALKS if "plug-in" not in name]))
def walk_of_both(request, recording_of):
    """A step of each foot and more."""
    return recording_of(*WALKS[request.param])


def of_one_foot(recording, turn):
    """One plate measures, with turned or mirrored forces."""
    kept = (np.arange(recording.plates.force.shape[1]) == 0)[:, None]
    return context_of(with_force(recording, lambda force: (force * kept) @ turn.T))


@pytest.mark.parametrize("name", slow_beside(QUICK_WALKS, FAULT_FREE))
def test_fault_free_forces_point_to_the_body(recording_of, name):
    assert [*forces_of_steps(context_of(recording_of(*FAULT_FREE[name])))] == []


def test_one_step_without_faults(walk):
    assert [*force_directions(of_one_foot(walk, np.eye(3)))] == []


def test_the_sign_of_one_axis_of_one_step(walk):
    """That along the walk; across it feet may be nearly below the body."""
    found = {}
    for axis in (0, 2):
        signs = np.ones(3)
        signs[axis] = -1.0
        context = of_one_foot(walk, np.diag(signs))
        found[axis] = [*force_directions(context)]
        assert all(
            (finding.code, finding.where) == ("P232", context.at(**context.along(axis))) for finding in found[axis]
        )
        assert all(finding.evidence["correlation"].value < -0.3 for finding in found[axis])
    assert any(found.values())


@pytest.mark.parametrize("angle_deg", [90, -90, 180])
def test_rotated_forces_of_one_step(walk, angle_deg):
    turn = Rotation.from_euler("y", angle_deg, degrees=True).as_matrix()
    (found,) = [*force_directions(of_one_foot(walk, turn))]
    assert found.code == "P231"
    assert np.degrees(found.evidence["angle_rad"].value) == pytest.approx(angle_deg)
    assert found.evidence["correlation_undone"].value > 0.5


def on_usual_feet(recording, forward_m=0.0):
    """Contexts of a walk, and of the same walk back, whose steps act where they do on other people, or farther forward.

    The synthetic person lands behind the heel.
    """
    context = context_of(recording, height_m=1.7)
    beyond_m = np.mean([ahead_of_usual_m(step, 1.7) for step in steps_alone(context, heel_steps(context))])
    plates = displaced(recording.plates, np.array([forward_m + 0.004 - beyond_m, 0.0]))
    back = Rotation.from_euler("y", np.pi).as_matrix()
    markers = replace(recording.markers, positions=recording.markers.positions @ back.T)
    force, moment = plates.force @ back.T, plates.moment @ back.T
    corners = None if plates.corners is None else plates.corners @ back.T
    there = replace(recording, plates=plates)
    other = replace(recording, markers=markers, plates=replace(plates, force=force, moment=moment, corners=corners))
    return [context_of(walk, height_m=1.7) for walk in (there, other)]


def common_position(told, axis):
    """Common displacement of all plates along an axis, m, and its deviation, if plates have none of their own; None
    where nothing is told."""
    for shown in told:
        rhs, information = shown.rhs[axis - 4], shown.information[axis - 4, axis - 4]
        if information > 0.9 * shown.information[X - 4 : Z - 3, X - 4 : Z - 3].trace():
            return -rhs / information, information**-0.5
    return None


@pytest.mark.parametrize("forward_m", [-0.02, 0.0, 0.02])
def test_steps_tell_where_plates_are(walk_of_both, forward_m):
    there, back = on_usual_feet(walk_of_both, forward_m)
    names = walk_of_both.plates.names
    value_m, sd_m = common_position(positions_by_feet([there], names), X)
    assert value_m == pytest.approx(forward_m, abs=0.004)
    assert 0.009 < sd_m < 0.014
    # where this person's loads act on the feet does not matter there and back
    value_m, sd_m = common_position(positions_by_feet([there, back], names), X)
    assert value_m == pytest.approx(0.0, abs=0.004)
    assert sd_m < 0.006


def test_steps_of_both_feet_tell_where_plates_are_across(walk_of_both):
    (there, _) = on_usual_feet(walk_of_both)
    before_m, sd_m = common_position(positions_by_feet([there], walk_of_both.plates.names), Z)
    aside_m = -0.005 * np.sign(before_m)
    plates = displaced(there.recording.plates, np.array([0.0, aside_m]))
    moved = context_of(replace(there.recording, plates=plates), height_m=1.7)
    after_m, _ = common_position(positions_by_feet([moved], walk_of_both.plates.names), Z)
    assert after_m - before_m == pytest.approx(aside_m, abs=1e-3)
    assert 0.004 < sd_m < 0.006


def test_there_and_back_show_what_is_displaced_in_the_laboratory(walk_of_both):
    """By more than one direction could tell from this person's feet."""
    contexts = [
        context_of(
            replace(walk.recording, plates=displaced(walk.recording.plates, np.array([0.03, 0.0]))), height_m=1.7
        )
        for walk in on_usual_feet(walk_of_both)
    ]
    value_m, sd_m = common_position(positions_by_feet(contexts, walk_of_both.plates.names), X)
    assert value_m == pytest.approx(0.03, abs=0.004)
    assert sd_m < 0.006


def test_steps_outside_the_stated_window_tell_nothing(walk_of_both):
    (there, _) = on_usual_feet(walk_of_both)
    first = min(steps_alone(there, heel_steps(there)), key=lambda step: step.start_s)
    names = walk_of_both.plates.names
    within = context_of(there.recording, height_m=1.7, window_s=(first.start_s, first.start_s + 0.1))
    outside = context_of(there.recording, height_m=1.7, window_s=(-9.0, first.start_s - 0.1))
    assert common_position(positions_by_feet([within], names), X)[1] > 0.012
    assert positions_by_feet([outside], names) == ()


def test_what_is_reported_tells_nothing(walk_of_both):
    names = walk_of_both.plates.names

    def along(context):
        return common_position(positions_by_feet([context], names), X)

    assert along(on_usual_feet(walk_of_both, 0.036)[0])
    assert not along(on_usual_feet(walk_of_both, 0.04)[0])
    assert along(on_usual_feet(walk_of_both, -0.029)[0])
    assert not along(on_usual_feet(walk_of_both, -0.031)[0])
    assert not along(context_of(walk_of_both))


def test_both_feet_far_to_one_side_tell_nothing(walk_of_both):
    (there, _) = on_usual_feet(walk_of_both)
    for aside_m in (-0.02, 0.02):
        plates = displaced(there.recording.plates, np.array([0.0, aside_m]))
        moved = context_of(replace(there.recording, plates=plates), height_m=1.7)
        assert common_position(positions_by_feet([moved], walk_of_both.plates.names), Z) is None


def test_feet_that_differ_tell_nothing(walk_of_both):
    (there, _) = on_usual_feet(walk_of_both)
    steps = steps_alone(there, heel_steps(there))
    right, left = ([step for step in steps if step.foot == foot] for foot in range(2))
    differ_m = np.subtract(*[np.mean([ahead_of_usual_m(step, 1.7) for step in of_foot]) for of_foot in (right, left)])
    of_right = np.isin(np.arange(len(walk_of_both.plates.names)), [step.plate for step in right])
    for apart_m, told in ((0.038, True), (0.042, False)):
        by_m = np.where(of_right, 0.5, -0.5) * (apart_m - differ_m)
        plates = displaced(there.recording.plates, np.stack([by_m, np.zeros(len(by_m))], axis=1))
        moved = context_of(replace(there.recording, plates=plates), height_m=1.7)
        assert (common_position(positions_by_feet([moved], walk_of_both.plates.names), X) is not None) is told


@pytest.mark.parametrize("name", slow_beside(("synthetic",), RUNS))
def test_steps_of_runs_tell_nothing(recording_of, name):
    recording = recording_of(*RUNS[name])
    context = context_of(recording, height_m=1.75)
    assert heel_steps(context)
    assert positions_by_feet([context], recording.plates.names) == ()


def test_usual_places_are_shares_of_stature(walk):
    context = context_of(walk)
    (step, *_) = heel_steps(context)
    taller, smaller = ahead_of_usual_m(step, 1.8), ahead_of_usual_m(step, 1.5)
    np.testing.assert_allclose(smaller - taller, 0.3 * OF_HEIGHT)
