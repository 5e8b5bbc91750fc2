"""Bodies that the literature, half off, has little to say of: the study's noise and starts."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.simultaneous.solver import estimate_simultaneous
from kinertia.synthetic.laboratory import camera_noise
from recordings import slow_beside
from validation.bsp_errors import errors
from validation.study_noise import CAMERA_SD_M, drawn_start, held, observation_of, start_prior, study_noise, study_walk


@pytest.mark.parametrize("number", slow_beside([1], [1, 6]))
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


@pytest.mark.slow
def test_markers_precise_to_a_tenth_of_a_millimetre_are_not_rounded_away():
    """In single precision the information on one second moment is below zero here; its inertia was infinite."""
    trial = study_walk()
    start, rng = drawn_start(trial, 19)
    study_noise(trial.markers, rng)
    sharp = observation_of(trial, camera_noise(trial.markers, CAMERA_SD_M, rng))
    sharp = replace(sharp, marker_sd=np.full_like(sharp.marker_sd, CAMERA_SD_M), marker_frames=1.0)
    prior = start_prior(start, trial.bsp.total_mass_kg)
    found = estimate_simultaneous(trial.skeleton, prior, held(trial.skeleton), [sharp])
    assert found.converged
    assert errors(found.bsp, trial.bsp)[2] < 0.12
