"""A side that is heavier is the body's or something on it; centres of mass at odds are the instruments'."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.prior import literature_prior, updated
from kinertia.estimation.simultaneous.uncertainty.prior_plausibility import mahalanobis_distance
from kinertia.model.bsp import BodySegmentParameters
from kinertia.synthetic.walk import walking_subject

BODIES = {"thigh": "femur", "shank": "tibia", "foot": "calcn"}
PRIOR = literature_prior(walking_subject().literature)


def as_in_opensim(bsp):
    """The same segments by the names that OpenSim's gait models have."""
    names = [f"{BODIES.get(name[:-2], name[:-2])}{name[-2:]}" if name[-2:-1] == "_" else name for name in bsp.segments]
    return BodySegmentParameters.from_table(tuple(names), bsp.table())


def changed(deviations):
    """Prior with OpenSim's names and an estimate so many prior SDs from it: {(segment, column): deviations}."""
    prior = replace(PRIOR, mean=as_in_opensim(PRIOR.mean))
    table = prior.mean.table().copy()
    for (name, column), by in deviations.items():
        row = prior.mean.segments.index(name)
        table[row, column] += by * prior.sd[row, column]
    return prior, BodySegmentParameters.from_table(prior.mean.segments, table)


def found(deviations):
    """Distance from the prior by data that show masses and centres of mass of the legs."""
    prior, estimate = changed(deviations)
    legs = [k for k, name in enumerate(prior.mean.segments) if name[:-2] in BODIES.values()]
    at = [10 * k + column for k in legs for column in range(4)]
    errors = 0.01 * np.diag(np.diag(prior.covariance)[at])
    _, covariance = updated(prior.mean.table().ravel(), prior.covariance, np.eye(120)[at], np.zeros(len(at)), errors)
    return mahalanobis_distance(prior, estimate, covariance)


@pytest.mark.parametrize("foot", [-2.5, -4.5])
def test_a_prosthesis_is_the_lighter_side_with_the_models_own_names(foot):
    """Also where it pushes a foot beyond what single parameters may, which was called a wrong joint or plate."""
    whole = found({("tibia_l", 0): -3.0, ("calcn_l", 0): foot, ("calcn_r", 0): 0.5})
    assert whole.implausible
    assert set(whole.one_sided.lighter) == {"tibia_l", "calcn_l"}
    assert not whole.one_sided.added


def test_what_is_worn_is_the_heavier_side():
    """The prior pulls the normal side along: its centre of mass moves by half as much, and more."""
    moves = {("tibia_r", 0): 2.2, ("calcn_r", 0): 2.4, ("calcn_r", 2): -2.5, ("calcn_l", 2): -1.9}
    whole = found(moves)
    assert whole.implausible
    assert set(whole.one_sided.heavier) == {"tibia_r", "calcn_r"}
    assert whole.one_sided.added
    assert not whole.both_sides


@pytest.mark.parametrize(
    "moves",
    [
        {("tibia_l", 1): 4.0, ("femur_l", 3): -3.5},
        {("tibia_l", 1): 4.0, ("tibia_l", 0): -2.0},
        {("femur_r", 0): 4.0, ("femur_l", 0): 1.0, ("femur_r", 1): -3.5},
    ],
)
def test_centres_of_mass_at_odds_are_no_heavier_side(moves):
    assert found(moves).one_sided is None


def test_where_no_side_is_heavier_segments_of_the_model_are_named():
    whole = found({(f"{name}_{side}", column): 2.9 for name in BODIES.values() for side in "rl" for column in (0, 1)})
    assert whole.implausible
    assert whole.one_sided is None
    assert whole.both_sides
    assert {name[:-2] for name in whole.segments} <= set(BODIES.values())


def test_sides_that_differ_as_peoples_do_are_nothing():
    rng = np.random.default_rng(0)
    found = [mahalanobis_distance(PRIOR, PRIOR.draw(rng), 1e-6 * PRIOR.covariance).one_sided for _ in range(200)]
    assert sum(finding is not None for finding in found) <= 4
