import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from generic_static import generic_model
from kinertia.errors import PriorError
from kinertia.estimation.prior import (
    MASS_SD,
    SCALE_SD,
    SECOND_MOMENT_SD,
    SIDES_CORRELATION,
    BspPrior,
    inertia_covariance,
    literature_prior,
    with_symmetry,
)
from kinertia.model.anthropometry import literature_bsp
from kinertia.model.bsp import MIRROR_SIGNS, PARAMETERS, BodySegmentParameters


@pytest.fixture(scope="module")
def prior():
    return literature_prior(literature_bsp(70.0, 1.75, "male", generic_model().geometry))


@settings(max_examples=30, deadline=None)
@given(
    mass_kg=st.floats(15.0, 180.0),
    height_m=st.floats(1.0, 2.1),
    sex=st.sampled_from(["male", "female"]),
    source=st.sampled_from(["dumas", "deleva"]),
)
def test_literature_prior_is_positive_definite(mass_kg, height_m, sex, source):
    geometry = generic_model(height_m).geometry
    prior = literature_prior(literature_bsp(mass_kg, height_m, sex, geometry, source))
    correlation = prior.covariance / np.outer(prior.sd.ravel(), prior.sd.ravel())
    assert np.linalg.eigvalsh(correlation)[0] > 1e-6
    assert prior.mass_kg == pytest.approx(mass_kg)
    assert prior.mass_sd_kg == pytest.approx(SCALE_SD * mass_kg)


def test_deviations_are_the_documented_ones(prior):
    table, segments = prior.mean.table(), prior.mean.segments
    thigh, foot = segments.index("thigh_r"), segments.index("foot_r")
    assert prior.sd[thigh, 0] == pytest.approx(MASS_SD["thigh"] * table[thigh, 0])
    assert (prior.sd[:, 4:7] / table[:, 4:7]).min() > 0.7 * SECOND_MOMENT_SD
    assert (prior.sd[:, 4:7] / table[:, 4:7]).max() < SECOND_MOMENT_SD
    assert prior.sd[:, 1:4].min() == pytest.approx(0.008)
    length = 2 * abs(table[thigh, 2])
    assert prior.sd[thigh, 1:4] == pytest.approx([0.05 * length, 0.035 * length, 0.05 * length])
    assert prior.sd[foot, 0] == pytest.approx(MASS_SD["foot"] * table[foot, 0])


def test_left_and_right_are_tied_as_mirror_images(prior):
    segments, sd = prior.mean.segments, prior.sd
    right, left = (10 * segments.index(f"shank_{side}") for side in "rl")
    for k, name in enumerate(PARAMETERS):
        together = prior.covariance[right + k, left + k] / np.sqrt(
            prior.covariance[right + k, right + k] * prior.covariance[left + k, left + k]
        )
        assert together == pytest.approx(SIDES_CORRELATION * MIRROR_SIGNS[k]), name
    assert sd[segments.index("shank_r")] == pytest.approx(sd[segments.index("shank_l")])


def test_mass_of_the_thigh_is_mass_the_trunk_lacks(prior):
    at = {name: 10 * i for i, name in enumerate(prior.mean.segments)}
    for side in "rl":
        for trunk in ("pelvis", "torso"):
            assert prior.covariance[at[f"thigh_{side}"], at[trunk]] < 0
    assert prior.covariance[at["shank_r"], at["torso"]] == 0


def test_symmetry_leaves_segments_without_partner_alone(prior):
    plain = np.diag(np.square(prior.sd.ravel()))
    tied = with_symmetry(plain, prior.mean.segments, 0.5)
    assert tied[:10] == pytest.approx(plain[:10])
    assert not np.allclose(tied, plain)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c[:-1, :-1], "119 x 119; expected 120 x 120"),
        (lambda c: c - 2.0 * np.diag(np.diag(c)) * (np.arange(120) == 7), "pelvis.ixy is -.*must be positive"),
        (lambda c: c * np.outer(np.arange(120) != 3, np.arange(120) != 3), "pelvis.com_z is 0; .*must be positive"),
        (lambda c: c * np.where(np.eye(120) == 1, 1.0, 1.5), "positive definite"),
        (lambda c: c + np.triu(np.full_like(c, 1e-2), 1), "symmetric"),
    ],
)
def test_bad_covariances_are_refused(prior, change, message):
    with pytest.raises(PriorError, match=message):
        BspPrior(prior.mean, change(prior.covariance), prior.mass_kg, prior.mass_sd_kg)


@pytest.mark.parametrize("sd", [0.0, -1.0])
def test_bad_deviation_of_the_scale_is_refused(prior, sd):
    with pytest.raises(PriorError, match=r"deviation of the body mass is -?[01] kg; it must be positive"):
        BspPrior(prior.mean, prior.covariance, prior.mass_kg, sd)


def test_tiny_deviations_beside_large_ones_are_positive_definite(prior):
    """Variances of a torso's mass and of a forearm's products differ by 1e12: definiteness does not depend on units."""
    sd = prior.sd.copy()
    sd[:, 7:] = 1e-6
    covariance = with_symmetry(np.diag(np.square(sd.ravel())), prior.mean.segments, 0.9999)
    assert BspPrior(prior.mean, covariance, prior.mass_kg, prior.mass_sd_kg).sd == pytest.approx(sd)


def test_people_of_the_prior_are_physically_possible(prior):
    """And their deviations are the prior's: nothing is cut off."""
    rng = np.random.default_rng(0)
    drawn = rng.multivariate_normal(prior.mean.table().ravel(), prior.covariance, 2000).reshape(2000, -1, 10)
    possible = [BodySegmentParameters.from_table(prior.mean.segments, t).physically_consistent().all() for t in drawn]
    assert np.mean(possible) > 0.999


def test_inertia_varies_alike_in_all_axes(prior):
    """The covariance of a segment in turned axes is the turned covariance."""
    turn = Rotation.from_euler("zxy", [0.3, -0.7, 1.1]).as_matrix()
    bsp = prior.mean
    turned = BodySegmentParameters(bsp.segments, bsp.mass_kg, bsp.com_m, turn @ bsp.inertia_kgm2 @ turn.T)
    places = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
    units = [
        np.where(np.eye(3)[i][:, None] * np.eye(3)[j] + np.eye(3)[j][:, None] * np.eye(3)[i], 1.0, 0.0)
        for i, j in places
    ]
    moved = np.array([[(turn @ unit @ turn.T)[place] for unit in units] for place in places])
    expected = moved @ inertia_covariance(bsp) @ moved.T
    scale = np.sqrt(np.einsum("sii->si", expected))
    gap = (inertia_covariance(turned) - expected) / (scale[:, :, None] * scale[:, None])
    assert np.abs(gap).max() < 1e-9


def test_people_drawn_have_the_prior_s_mean_and_covariance_and_the_scale_s_total(prior):
    rng = np.random.default_rng(1)
    people = [prior.draw(rng) for _ in range(800)]
    tables = np.array([person.table() for person in people])
    assert np.std([person.total_mass_kg for person in people]) == pytest.approx(prior.mass_sd_kg, rel=0.1)
    away = (tables - prior.mean.table()) / prior.sd
    assert np.abs(away.mean(axis=0)).max() < 0.2
    assert (away.std(axis=0)[:, 1:]).min() > 0.85
    assert (away.std(axis=0)).max() < 1.15
    feet = [prior.mean.segments.index(f"foot_{side}") for side in "rl"]
    assert np.corrcoef(away[:, feet[0], 2], away[:, feet[1], 2])[0, 1] == pytest.approx(SIDES_CORRELATION, abs=0.05)
