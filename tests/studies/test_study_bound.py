"""The bound on the study's noise, against the estimator's own information where the two mean the same."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.prior import literature_prior
from kinertia.estimation.simultaneous.instruments.priors import InstrumentPrior
from kinertia.estimation.simultaneous.mixture_prior import FaultMixture
from kinertia.estimation.simultaneous.search.problem import MapProblem
from kinertia.studies.plan import Information
from kinertia.studies.sensitivity import held
from kinertia.synthetic.walk import walking_subject
from validation import study_bound
from validation.accuracy_study import at_truth
from validation.synthetic_walks import observation_of, study_walk


def test_with_white_noise_alone_it_is_the_estimator_s_own(monkeypatch):
    trial = study_walk(0.6)
    prior = literature_prior(walking_subject().literature)
    seen = observation_of(trial, trial.markers)
    monkeypatch.setattr(study_bound, "STUDY_AMPLITUDE_M", 0.0)
    information = study_bound.information_on_body(trial, seen, prior, 1e-3)
    white = replace(
        at_truth(seen, trial),
        marker_sd=np.full_like(seen.marker_sd, 1e-3),
        marker_frames=1.0,
        skin=None,
        force_sd=study_bound.EXACT_N,
        moment_sd=0.3 * study_bound.EXACT_N,
    )
    calibration = replace(held(trial.skeleton), marker_sd_m=np.full(len(trial.skeleton.markers), 1e-8))
    exact = FaultMixture.certain(1e-9)
    known = calibration.instruments
    plate, floor = (dict.fromkeys(names, exact) for names in (known.plate, known.floor))
    calibration = replace(calibration, instruments=InstrumentPrior(plate, floor, exact, exact, exact))
    without_prior = Information(
        MapProblem(trial.skeleton, replace(prior, mean=trial.bsp), calibration, [white]),
        np.ones((1, 1)),
    )
    ours = study_bound.bound(information, replace(prior, mean=trial.bsp))
    sd = without_prior.sd([0])[[k for k, segment in enumerate(prior.mean.segments) if not segment.endswith("_l")]]
    theirs = [np.sqrt(np.mean(np.square(sd[:, part]))) for part in (slice(0, 1), slice(1, 4), slice(4, 7))]
    assert ours == pytest.approx(theirs, rel=0.02)


def test_better_cameras_tell_more():
    trial = study_walk(0.6)
    prior = literature_prior(walking_subject().literature)
    seen = observation_of(trial, trial.markers)
    fine, coarse = (
        study_bound.bound(study_bound.information_on_body(trial, seen, prior, floor_m), prior)
        for floor_m in (1e-4, 1e-3)
    )
    assert all(np.less(fine, coarse))
