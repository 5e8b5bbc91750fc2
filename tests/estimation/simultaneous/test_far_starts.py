"""Bodies that the literature, half off, has little to say of: the study's noise and starts."""

import warnings

import pytest

from kinertia.estimation.simultaneous.solver import estimate_simultaneous
from validation.bsp_errors import errors
from validation.study_noise import drawn_start, held, observation_of, start_prior, study_noise, study_walk


@pytest.mark.parametrize("number", [1, 6])
def test_second_moments_that_the_data_would_have_below_zero_stay_small(number):
    trial = study_walk()
    start, rng = drawn_start(trial, number)
    seen = observation_of(trial, study_noise(trial.markers, rng))
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        found = estimate_simultaneous(
            trial.skeleton, start_prior(start, trial.bsp.total_mass_kg), held(trial.skeleton), [seen]
        )
    mass_kg, com_m, inertia_kgm2 = errors(found.bsp, trial.bsp)
    assert found.converged
    assert mass_kg < 2.0
    assert com_m < 0.03
    assert inertia_kgm2 < 0.12
