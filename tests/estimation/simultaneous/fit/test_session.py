"""What `fit_simultaneous` finds of the clock, and what others of the session tell."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.simultaneous.instruments.priors import GAIT27_UNCERTAINTY
from results import entry_of, of_estimate
from short_walk_fit import estimated, seen


@pytest.mark.slow
def test_forces_of_one_of_two_trials_are_late(trial):
    """The delay is that trial's: neither the other one nor the plates are accused.

    That both are late and the first one was early is less likely by far: three percent, as the priors say.
    """

    def fit_of(*late_frames):
        late = [np.roll(trial.foot_loads, frames, axis=0) for frames in late_frames]
        return estimated(trial, [seen(trial, seed, loads=loads) for seed, loads in enumerate(late)])

    sound, late = fit_of(0, 0), fit_of(0, 1)
    frame_s = trial.time[1] - trial.time[0]
    for fit, expected in ((sound, 0.0), (late, frame_s)):
        delays = [error for error in fit.posterior.calibration if error.quantity == "delay"]
        clock, first, second = sorted(delays, key=lambda error: error.trial is not None)
        assert abs(first.value) < min(0.3 * first.sd, 0.05 * frame_s)
        assert second.value == pytest.approx(expected, abs=3.0 * second.sd)
        assert max(first.sd, second.sd) < 0.25 * frame_s
        assert clock.value == pytest.approx(0.0, abs=0.0005)
    assert of_estimate(sound, "one", "two") == []
    (found,) = of_estimate(late, "one", "two")
    assert found.code == "T215"
    assert found.evidence["delay_s"].value == pytest.approx(frame_s, abs=0.003)
    # and others of the session are told of the clock, which is on time
    ours, theirs = (fit.result.instruments for fit in (sound, late))
    assert ours.information.shape == theirs.information.shape == (14, 14)
    for shown in (ours, theirs):
        assert abs(shown.rhs[-1] / shown.information[-1, -1]) < 0.001


def with_others(trial, kinematics, session=()):
    """Outcome where so much is known of the instruments from other people of the session."""
    instruments = replace(GAIT27_UNCERTAINTY.instruments, session=session)
    return estimated(trial, [kinematics], uncertainty=replace(GAIT27_UNCERTAINTY, instruments=instruments))


@pytest.mark.slow
def test_the_only_trial_of_a_person_is_one_of_several_of_the_session(trial):
    """Late by two frames, where others of the session were on time: the delay is its own, not the clock's."""

    def fit_of(seed, late=0, session=()):
        loads = np.roll(trial.foot_loads, late, axis=0)
        return with_others(trial, seen(trial, seed, 0.004, loads), session)

    others = tuple(fit_of(seed).result.instruments for seed in (1, 2))
    late = fit_of(0, 2, others)
    total = entry_of(late, "delay", trial="walk")
    two_frames_s = 2 * (trial.time[1] - trial.time[0])
    assert total.value == pytest.approx(two_frames_s, abs=3.0 * total.sd)


@pytest.mark.slow
def test_others_of_the_session_tell_what_a_plate_reads_and_the_clock(trial):
    """Three people on a plate that reads 5 % too little, forces a frame late: two of them help the third."""
    loads = np.roll(trial.foot_loads, 1, axis=0)
    loads[:, 1] /= 1.05
    alone, *others = (with_others(trial, seen(trial, seed, 0.004, loads)) for seed in range(3))
    helped = with_others(trial, seen(trial, 0, 0.004, loads), tuple(other.result.instruments for other in others))
    gain, clock = entry_of(helped, "gain", plate="left foot"), entry_of(helped, "delay")
    for found, truth in ((gain, 1 / 1.05 - 1), (clock, 0.01)):
        assert found.value == pytest.approx(truth, abs=2.5 * found.sd)
    # of a gain not: that in a trial may be another
    assert clock.sd < 0.7 * entry_of(alone, "delay").sd
    # what a person says of the clock does not grow by what it was told
    information = [np.diag(fit.result.instruments.information)[10] for fit in (alone, helped)]
    assert information[1] == pytest.approx(information[0], rel=0.1)
