from dataclasses import replace

import numpy as np
import pytest

from kinertia.trial.data import FootLoads, Markers, Trial
from kinertia.trial.stances import LegCoverage, joined_coverage, leg_coverage, stances_of

TIME = np.arange(301) / 100.0


def trial(right=(), left=()):
    """A trial in which the feet are on the ground between these times (s)."""
    ground = np.zeros((len(TIME), 2), dtype=bool)
    for foot, spans in enumerate((right, left)):
        for start, end in spans:
            ground[(start - 1e-9 <= TIME) & (end + 1e-9 >= TIME), foot] = True
    none = np.zeros((len(TIME), 2, 3))
    loads = FootLoads(TIME, none, none)
    markers = Markers(TIME, ("A",), np.zeros((len(TIME), 1, 3)))
    return Trial("walk", markers, loads, np.zeros(len(TIME), dtype=bool), on_ground=ground)


def known(right=(), left=()):
    """Frames in which the load on each leg is known."""
    return trial(right, left).on_ground


WALK = trial([(0.5, 1.1), (1.5, 2.1)], [(0.0, 0.6), (1.0, 1.6), (2.0, 2.6)])


def test_stances_have_their_times_and_those_cut_by_the_record_take_as_long_as_others():
    found = [(stance.side, stance.number, stance.start_s, stance.end_s, stance.whole) for stance in stances_of(WALK)]
    assert found[:2] == [("r", 1, 0.5, 1.1, True), ("r", 2, 1.5, 2.1, True)]
    cut = trial([(0.5, 1.1), (2.7, 3.0)], [(0.0, 0.2)])
    assert [(stance.side, stance.whole) for stance in stances_of(cut)] == [("r", True), ("r", False), ("l", False)]
    assert stances_of(cut)[1].end_s == pytest.approx(3.3)
    assert stances_of(cut)[2].start_s == pytest.approx(-0.4)


def test_a_stance_cut_by_the_record_takes_as_long_as_the_median_of_whole_ones():
    cut = trial([(0.3, 0.9), (1.2, 1.9), (2.8, 3.0)], [(0.6, 1.7)])
    assert stances_of(cut)[2].end_s == pytest.approx(2.8 + 0.7)


def test_contacts_of_plates_are_not_rounded_to_frames():
    fine = np.arange(0.0, 3.0, 0.001)
    force = np.zeros((len(fine), 2, 3))
    force[(fine >= 0.4965) & (fine < 1.1035), 0, 1] = 500.0
    walk = replace(WALK, loads=FootLoads(fine, force, np.zeros_like(force)))
    first, second, *_ = stances_of(walk)
    assert (first.start_s, first.end_s) == pytest.approx((0.497, 1.103))
    assert (second.start_s, second.end_s) == (1.5, 2.1), "without a plate"


def test_standing_and_touching_are_no_stances():
    assert stances_of(trial([(0.0, 3.0)], [(0.0, 3.0)])) == ()
    assert stances_of(trial([(1.0, 1.05)])) == ()
    assert stances_of(replace(WALK, on_ground=None)) == ()
    assert leg_coverage(trial(), known()) == ()


@pytest.mark.parametrize(
    ("shown", "sentence", "missing"),
    [
        ([(0.4, 2.2)], "right: whole stride", ()),
        ([(0.5, 1.1)], "right: whole stance", ()),
        ([(0.5, 1.48), (1.6, 1.7)], "right: whole stride", ()),
        ([(0.5, 0.98)], "right: 0 to 48 % of the stride, no push-off", ("push-off",)),
        ([(0.8, 1.5)], "right: 30 to 100 % of the stride, no loading response or mid-stance", None),
        ([(0.5, 0.54)], "right: none in stance", None),
        ([], "right: none in stance", ("loading response", "mid-stance", "push-off")),
    ],
)
def test_what_is_known_of_a_leg(shown, sentence, missing):
    (right, left) = leg_coverage(WALK, known(shown))
    assert right.sentence == sentence
    assert left.sentence == "left: none in stance"
    assert missing is None or right.missing == missing


def of_stance(percent):
    """A leg of which the first percent of stance are known, and no stride."""
    return LegCoverage("r", np.arange(101) < percent, None)


def test_less_than_a_tenth_of_stance_is_none_of_it():
    assert [of_stance(percent).none for percent in (0, 10, 11, 20)] == [True, True, False, False]


def test_a_phase_of_which_a_tenth_is_unknown_is_not_missing():
    """Push-off is 65 to 100 % of stance: 36 of 101."""
    assert [of_stance(percent).missing for percent in (97, 98)] == [("push-off",), ()]


def test_parts_of_several_stances_and_trials_add_up():
    both = [leg_coverage(WALK, known([(0.5, 0.9)])), leg_coverage(WALK, known([(1.85, 2.1)]))]
    assert [coverage[0].missing for coverage in both] == [("push-off",), ("loading response", "mid-stance")]
    right, left = joined_coverage(both)
    assert (right.missing, left.none) == ((), True)
    assert right.to_dict() == {"stride_percent": [[0, 40]], "stance_percent": [[0, 100]], "missing": []}


def test_a_record_that_ends_within_stance_lacks_push_off():
    cut = trial([(0.5, 1.1), (2.7, 3.0)], [(0.2, 0.8)])
    right, _ = leg_coverage(cut, known([(2.7, 3.0)]))
    assert right.to_dict()["stance_percent"] == [[0, 50]]


def test_a_frame_too_many_at_foot_contact_is_no_missing_phase():
    """A repeated frame makes a swinging foot seem to stand just before its load begins."""
    force = np.zeros((len(TIME), 2, 3))
    force[50:111, 0, 1] = 700.0
    early = trial([(0.46, 1.1), (1.5, 2.1)], [(1.0, 1.6)])
    early = replace(early, loads=FootLoads(TIME, force, np.zeros_like(force)))
    assert stances_of(early)[0].start_s == pytest.approx(0.5)
    assert leg_coverage(early, known([(0.5, 1.1)]))[0].missing == ()
