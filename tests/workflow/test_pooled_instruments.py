"""What single trials say of the laboratory's instruments, pooled, against one estimate from all of them."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.prior import literature_prior
from kinertia.estimation.simultaneous.fit import calibration_prior
from kinertia.estimation.simultaneous.instruments.plates import PLATE_UNKNOWNS, plates_with_floor
from kinertia.estimation.simultaneous.instruments.priors import InstrumentInformation, InstrumentPrior
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import Bandwidth
from kinertia.estimation.simultaneous.mixture_prior import GaussianPrior
from kinertia.estimation.simultaneous.observation import observe
from kinertia.estimation.simultaneous.solver import estimate_simultaneous
from kinertia.studies.sensitivity import MOTIONS
from kinertia.synthetic.motions import Faults, measured
from kinertia.synthetic.walk import walk, walking_subject

GAIN = list(PLATE_UNKNOWNS).index("gain")


def shown(skeleton, prior, recorded) -> InstrumentInformation:
    """What an estimate from these trials says."""
    seen = observe(skeleton, recorded, prior.mass_kg, Bandwidth.of(recorded))
    return estimate_simultaneous(skeleton, prior, calibration_prior(skeleton), seen.pooled).instruments


def together(said) -> tuple[np.ndarray, np.ndarray]:
    """Values and deviations of all plates' errors, each with what all plates have in common, and of the delay."""
    (plates,) = {information_of_trial.plates for information_of_trial in said}
    information, rhs = (
        sum(information_of_trial.information for information_of_trial in said),
        sum(information_of_trial.rhs for information_of_trial in said),
    )
    prior = GaussianPrior.given(InstrumentPrior().of_unknowns(plates), information, rhs)
    covariance = np.linalg.inv(information + prior.precision)
    to_plates = np.zeros((len(PLATE_UNKNOWNS) * len(plates) + 1, len(rhs)))
    to_plates[:-1, :-1], to_plates[-1, -1] = plates_with_floor(len(plates)), 1.0
    mean = covariance @ (rhs + prior.pull)
    return to_plates @ mean, np.sqrt(np.diag(to_plates @ covariance @ to_plates.T))


@pytest.mark.slow
@pytest.mark.parametrize("gain", [0.0, 0.06])
def test_single_trials_pooled_agree_with_one_estimate_from_all(gain):
    """Four measured walks said -2.5 and -9 % of the gains of their plates, where one estimate from all said 0."""
    subject = walking_subject()
    prior = literature_prior(subject.literature)
    person = replace(subject, bsp=prior.draw(np.random.default_rng(1)))
    trials = [walk(person, 1.5, trapezoid=False), *(MOTIONS[name](person) for name in ("walk", "fast walk"))]
    skeleton, recorded = measured(trials, Faults("artefact", gain=gain), np.random.default_rng(2))
    single = [shown(skeleton, prior, [recorded_walk]) for recorded_walk in recorded]
    value, _ = together(single)
    expected, _ = together([shown(skeleton, prior, recorded)])
    alone = np.mean([together([of_walk])[1] for of_walk in single], axis=0)
    away = np.abs(value - expected) / alone
    assert away.max() < 0.5, away.round(2)
    right = GAIN  # the right foot's plate comes first
    assert value[right] == pytest.approx(-gain / (1.0 + gain), abs=0.015)
