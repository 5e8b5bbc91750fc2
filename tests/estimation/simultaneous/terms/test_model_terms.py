import numpy as np
import pytest

from kinertia.estimation.simultaneous.terms import model_terms
from kinertia.estimation.simultaneous.terms.model_terms import Displaced, as_displaced, hips_bent_rad, task_direction
from kinertia.synthetic.walk import walk, walking_subject
from short_walk_fit import fitted

PLACES = slice(4, 10)


SIZE = 10


@pytest.fixture
def terms():
    """Information and right-hand side of a trial, that of everything else, and deviations, two of them zero."""
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(30, SIZE))
    elsewhere = np.diag(rng.uniform(1.0, 3.0, SIZE))
    return rows.T @ rows, rng.normal(size=SIZE), elsewhere, np.array([0.5, 1.0, 0.0, 0.0, 2.0, 0.3]), rng.normal(size=6)


def together(information, rhs, elsewhere, sd, offsets):
    """Normal equations on static unknowns and displacements (in prior deviations), from x in the trial = s + sd u."""
    chain = np.hstack([np.eye(SIZE), np.zeros((SIZE, 6))])
    chain[PLACES, SIZE:] = np.diag(sd)
    whole = chain.T @ information @ chain
    whole[:SIZE, :SIZE] += elsewhere
    whole[SIZE:, SIZE:] += np.eye(6)
    return whole, chain.T @ rhs - np.concatenate([np.zeros(SIZE), offsets]), chain


def test_eliminated_is_what_the_whole_system_gives(terms):
    information, rhs, elsewhere, sd, offsets = terms
    whole, both, _ = together(information, rhs, elsewhere, sd, offsets)
    expected = np.linalg.solve(whole, both)
    displaced = Displaced.of(information, PLACES, sd)
    on_displacements = sd * rhs[PLACES] - offsets
    step = np.linalg.solve(displaced.information + elsewhere, rhs - on_displacements @ displaced.gain)
    np.testing.assert_allclose(step, expected[:SIZE], rtol=1e-10)
    found = displaced.rest(on_displacements) - displaced.gain @ step
    np.testing.assert_allclose(found, expected[SIZE:], rtol=1e-10)
    np.testing.assert_allclose(np.linalg.inv(displaced.information + elsewhere), np.linalg.inv(whole)[:SIZE, :SIZE])


def test_in_the_trial_unknowns_are_known_as_the_whole_system_says(terms):
    information, rhs, elsewhere, sd, offsets = terms
    whole, _, chain = together(information, rhs, elsewhere, sd, offsets)
    expected = chain @ np.linalg.inv(whole) @ chain.T
    in_trial = information + as_displaced(elsewhere, PLACES, sd)
    np.testing.assert_allclose(np.linalg.inv(in_trial), expected, rtol=1e-9, atol=1e-12)


def test_without_deviation_there_are_no_displacements(terms):
    information, *_ = terms
    displaced = Displaced.of(information, PLACES, np.zeros(6))
    np.testing.assert_array_equal(displaced.information, information)
    assert not displaced.gain.any()
    assert not displaced.rest(np.ones(6)).any()


SEGMENTS = ("pelvis", "femur_r", "femur_l", "torso")


MASS_KG = np.array([10.0, 8.0, 8.0, 20.0])


def test_what_thighs_lose_the_pelvis_gains():
    direction = task_direction(SEGMENTS, MASS_KG, 0.1)
    masses = direction[::10] * MASS_KG
    np.testing.assert_allclose(masses, [-1.6, 0.8, 0.8, 0.0])
    assert not direction[np.arange(40) % 10 != 0].any()


def test_without_a_pelvis_thighs_alone():
    assert task_direction(("femur_r",), np.array([8.0]), 0.2)[0] == 0.2


@pytest.mark.parametrize("turned", [0.0, 0.4, -1.9])
def test_hips_are_bent_as_far_as_a_thigh_turns(turned):
    skeleton = walking_subject().skeleton
    q = np.zeros((40, len(skeleton.coordinates)))
    q[:, 3] = 0.7  # the whole person
    q[10:, list(skeleton.coordinates).index("hip_flexion_l")] = turned
    assert hips_bent_rad(skeleton, q) == pytest.approx(abs(turned), abs=1e-6)


def test_moments_of_hips_are_less_certain_by_it(monkeypatch):
    trial = walk(walking_subject(), 0.9, trapezoid=False)
    monkeypatch.setattr(model_terms, "TASK_SD_PER_RAD", 0.0)
    names, sd = list(trial.skeleton.coordinates), []
    for share in (0.0, 0.3):
        monkeypatch.setattr(model_terms, "LEAST_TASK_SD", share)
        inner = fitted(trial).result.curve_deviations[0].moments[10:-10]  # at the ends the motion is least certain
        sd.append(np.sqrt(np.square(inner).mean(axis=0)))
    longer = dict(zip(names, sd[1] / sd[0], strict=True))
    assert longer["hip_flexion_r"] > 1.01
    assert longer["pelvis_tx"] > 1.05
    assert longer["ankle_angle_r"] == pytest.approx(1.0, abs=0.002)
