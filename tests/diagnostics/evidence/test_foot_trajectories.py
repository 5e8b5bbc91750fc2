from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.foot_trajectories import FootTrajectory, periods, swing_in_turn
from kinertia.trial.data import FootLoads
from loads_and_feet import context_of
from recordings import is_here
from walk_on_plates import FEET, walk

TIME = np.arange(3000) / 1000.0


def loads(right, left) -> FootLoads:
    """Feet that carry 400 N from the first to the second of these times (s)."""
    force = np.zeros((len(TIME), 2, 3))
    for foot, spans in enumerate((right, left)):
        for start, end in spans:
            force[(start <= TIME) & (end > TIME), foot, 1] = 400.0
    return FootLoads(TIME, force, np.zeros_like(force))


def test_a_walk_has_strides_and_steps():
    strides, steps = periods(loads([(0.1, 0.7), (1.1, 1.7)], [(0.6, 1.2), (1.6, 2.2)]))
    np.testing.assert_allclose(strides, 1.0)
    assert len(strides) == 4
    np.testing.assert_allclose(steps, 0.5)


def test_a_limp_has_them_too():
    strides, _ = periods(loads([(0.1, 0.7), (1.1, 1.7)], [(0.4, 1.2), (1.4, 2.2)]))
    np.testing.assert_allclose(strides, 1.0)


def test_jumps_on_both_feet_have_none():
    assert periods(loads([(0.1, 0.5), (1.1, 1.5)], [(0.12, 0.49), (1.05, 1.52)])) == ([], [])


@pytest.mark.parametrize("delay_s", [0.0, 0.02, 0.08, 0.15])
def test_one_landing_and_one_leaving_of_both_feet_are_no_steps(delay_s):
    """A drop jump whose second landing is not in the file, and standing up from a chair with the feet off the floor."""
    assert periods(loads([(1.0, 1.8)], [(1.0 + delay_s, 1.8 - delay_s)])) == ([], [])
    assert periods(loads([(1.0, 3.0)], [(1.0 + delay_s, 3.0)])) == ([], [])


def test_two_steps_of_a_run():
    assert periods(loads([(1.0, 1.2)], [(1.3, 1.5)])) == ([], pytest.approx([0.3, 0.3]))


def test_one_foot_on_plates_is_enough_for_strides():
    strides, steps = periods(loads([(0.1, 0.7), (1.1, 1.7)], []))
    np.testing.assert_allclose(strides, 1.0)
    assert steps == []


def foot(*spans, lasts_s=3.0):
    """A foot that stands in these spans (s) of a trial."""
    time = np.arange(0.0, lasts_s, 0.01)
    place = np.zeros((len(time), 2))
    whole = tuple((start, end, True) for start, end in spans)
    return FootTrajectory(
        time, place, place + np.array([0.2, 0.0]), np.ones(len(time), dtype=bool), whole, np.zeros(len(time))
    )


TURNS = {
    "walk": (foot((0.0, 0.6), (1.0, 1.6)), foot((0.5, 1.1), (1.5, 2.1))),
    "one step": (foot((0.0, 0.6), (1.0, 2.99)), foot((0.5, 2.99))),
    "run": (foot((0.5, 0.7), (1.2, 1.4)), foot((0.15, 0.35), (0.85, 1.05))),
}
TOGETHER = {
    "jump": (foot((0.0, 1.0), (1.45, 2.1)), foot((0.0, 1.03), (1.45, 2.14))),
    "squats": (foot(), foot()),
    "standing": (foot((0.0, 2.99)), foot((0.0, 2.99))),
    "landing on one foot": (foot((0.0, 0.9), (1.3, 2.0), (2.5, 2.99)), foot((0.0, 1.0))),
    "landing, the other foot later": (foot((0.0, 0.9), (1.3, 2.99)), foot((0.0, 1.0), (2.4, 2.99))),
}


@pytest.mark.parametrize("name", TURNS)
def test_feet_swing_in_turn(name):
    assert swing_in_turn(TURNS[name], (0.0, 3.0))
    assert swing_in_turn(TURNS[name][::-1], (0.0, 3.0))


@pytest.mark.parametrize("name", TOGETHER)
def test_feet_that_do_not_swing_in_turn(name):
    assert not swing_in_turn(TOGETHER[name], (0.0, 3.0))
    assert not swing_in_turn(TOGETHER[name][::-1], (0.0, 3.0))


def test_swings_long_before_the_plates_do_not_count():
    """Somebody walks to a box, climbs it, and lands on the plate."""
    right, left = foot((0.0, 0.6), (1.0, 3.9), (4.4, 5.99), lasts_s=6.0), foot((0.5, 3.9), (4.4, 5.99), lasts_s=6.0)
    assert swing_in_turn((right, left), (0.0, 6.0))
    assert not swing_in_turn((right, left), (4.2, 5.5))


def test_recordings_that_have_strides():
    steps = walk([("r", 0), ("l", 0)])
    assert context_of(steps, FEET).has_strides
    assert context_of(walk([("r", 0)]), FEET).has_strides, "one step on one plate"
    assert not context_of(jumping(), FEET).has_strides
    still = replace(steps.markers, positions=0.0 * steps.markers.positions)
    assert not context_of(replace(steps, markers=still, plates=jumping().plates), FEET).has_strides
    assert RecordingContext(steps).has_strides, "nobody knows"


def jumping():
    """Both feet do what the right one does."""
    steps = walk([("r", 0)])
    places = steps.markers.positions.copy()
    places[:, 2:] = places[:, :2] * [1.0, 1.0, -1.0]
    return replace(steps, markers=replace(steps.markers, positions=places))


MEASURED = [
    ("field/biomechzoo/HC036A/straight.c3d", None, True, False),
    ("field/biomechzoo/HC036A/turn.c3d", None, True, True),
    ("pig_c3d/subject_a_walk.c3d", None, True, False),
    ("subject4/DJ1.trc", "subject4/DJ1_grf.mot", False, False),
    ("subject4/squats1.trc", "subject4/squats1_grf.mot", False, False),
    ("subject4/walking1.trc", "subject4/walking1_grf.mot", True, False),
]


@pytest.mark.parametrize(
    ("markers", "forces", "strides", "turns"), [files for files in MEASURED if is_here([files[0], files[1]])]
)
def test_measured_recordings(recording_of, markers, forces, strides, turns):
    context = context_of(recording_of(markers, forces))
    assert (context.has_strides, context.turns) == (strides, turns)
