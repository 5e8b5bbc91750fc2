import shutil

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
    UNKNOWN_SPREAD,
    BspPrior,
    inertia_covariance,
    literature_prior,
    population_prior,
    with_symmetry,
)
from kinertia.estimation.simultaneous.uncertainty.prior_plausibility import mahalanobis_distance
from kinertia.model.anthropometry import BodyGeometry, literature_bsp, reference_lengths
from kinertia.model.bsp import MIRROR_SIGNS, PARAMETERS, BodySegmentParameters
from kinertia.settings import Instruments, Subject
from kinertia.synthetic.motions import Faults, measured
from kinertia.synthetic.walk import HEIGHT_M, MASS_KG, walk, walking_subject
from kinertia.workflow.from_files import prepare_subject
from kinertia.workflow.known_body import with_prosthesis
from validation.population_bodies import POPULATIONS
from validation.population_study import RucksackAccuracy, own_prior, run_person
from validation.populations import rucksack_sentence


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


PRIOR = literature_prior(walking_subject().literature)


SEGMENTS = PRIOR.mean.segments


def subject(**values):
    return Subject(**{"name": "A", "sex": "male", "mass_kg": 70.0, "height_m": 1.8, **values})


def test_a_person_of_unknown_height_is_an_adult():
    """A scaled model wants no height."""
    result = population_prior(PRIOR, subject(height_m=None))
    assert not result.findings
    assert result.prior is PRIOR


@pytest.mark.parametrize(
    ("values", "word", "severity"),
    [
        ({"age_years": 7.0}, "child", "INFO"),
        ({"height_m": 1.2, "mass_kg": 25.0}, "child", "WARNING"),
        ({"age_years": 72.0}, "elderly", "INFO"),
        ({"mass_kg": 100.0}, "obese", "WARNING"),
        ({"age_years": 72.0, "mass_kg": 100.0}, "obese", "WARNING"),
    ],
)
def test_age_and_build_choose_and_warn_of_what_is_not_stated(values, word, severity):
    result = population_prior(PRIOR, subject(**values))
    (found,) = result.findings
    assert (found.code, found.severity.name, found.evidence["population"].value) == ("S401", severity, word)
    assert result.prior.sd[0, 1] == pytest.approx(UNKNOWN_SPREAD * PRIOR.sd[0, 1])


@pytest.mark.parametrize("values", [{}, {"age_years": 30.0}, {"age_years": 7.0, "population": "adult"}])
def test_adults_keep_the_tables(values):
    result = population_prior(PRIOR, subject(**values))
    assert result.prior is PRIOR
    assert not result.findings


def test_a_rucksack_on_the_scale_makes_nobody_obese():
    heavy = subject(mass_kg=100.0)
    assert population_prior(PRIOR, heavy).findings
    assert not population_prior(PRIOR, heavy, body_kg=90.0).findings


def test_what_is_stated_is_no_warning():
    result = population_prior(PRIOR, subject(population="obese"))
    (found,) = result.findings
    assert (found.severity.name, found.evidence["population"].value) == ("INFO", "obese")
    np.testing.assert_allclose(result.prior.covariance, UNKNOWN_SPREAD**2 * PRIOR.covariance)


def test_of_anybody_else_nothing_is_invented():
    """Pregnant or very muscular people."""
    result = population_prior(PRIOR, subject(population="other"))
    np.testing.assert_array_equal(result.prior.mean.table(), PRIOR.mean.table())
    np.testing.assert_allclose(result.prior.sd, UNKNOWN_SPREAD * PRIOR.sd)
    assert result.findings[0].evidence["population"].value == "other"


def test_somebody_short_is_likely_a_child():
    result = population_prior(PRIOR, subject(height_m=1.2, mass_kg=25.0))
    (found,) = result.findings
    assert found.evidence["population"].value == "child"
    assert result.prior.sd[0, 1] == pytest.approx(UNKNOWN_SPREAD * PRIOR.sd[0, 1])
    assert not population_prior(PRIOR, subject(height_m=1.3, mass_kg=45.0, age_years=40.0)).findings


@pytest.mark.slow
@pytest.mark.parametrize(
    ("entries", "populations"),
    [
        ("height_m = 1.803\nage_years = 7", ["child"]),
        ("height_m = 1.45", ["obese"]),
        ("height_m = 1.45\nage_years = 7", ["child"]),
        ("height_m = 1.803\nage_years = 30", []),
    ],
)
def test_files_of_somebody_whom_the_tables_do_not_describe_say_so(demo_run, tmp_path, entries, populations):
    lab = shutil.copytree(demo_run[1] / "lab", tmp_path / "lab")
    text = (lab / "subject.toml").read_text(encoding="utf-8")
    (lab / "subject.toml").write_text(text.replace("height_m = 1.803", entries), encoding="utf-8")
    found = [finding for finding in prepare_subject(lab / "subject.toml").findings if finding.code == "S401"]
    assert [finding.evidence["population"].value for finding in found] == populations


def test_masses_of_the_elderly_are_those_of_their_table():
    prior = population_prior(PRIOR, subject(population="elderly")).prior
    share = dict(zip(SEGMENTS, prior.mean.mass_kg / prior.mean.total_mass_kg, strict=True))
    assert share["thigh_r"] == pytest.approx(0.1127)
    assert share["forearm_l"] == pytest.approx(0.0240)
    assert prior.mean.total_mass_kg == pytest.approx(PRIOR.mean.total_mass_kg)
    before = dict(zip(SEGMENTS, PRIOR.mean.mass_kg, strict=True))
    assert share["torso"] / share["pelvis"] == pytest.approx(before["torso"] / before["pelvis"])
    assert prior.mean.physically_consistent().all()


def test_a_prosthesis_leans_on_nobody():
    prior = with_prosthesis(PRIOR, "shank_l")
    row = SEGMENTS.index("shank_l")
    rows = np.arange(10 * row, 10 * row + 10)
    others = np.setdiff1d(np.arange(len(prior.covariance)), rows)
    assert not prior.covariance[np.ix_(rows, others)].any()
    np.testing.assert_array_equal(prior.covariance[np.ix_(others, others)], PRIOR.covariance[np.ix_(others, others)])
    assert prior.sd[row, 0] == pytest.approx(0.4 * prior.mean.mass_kg[row])


def test_unknown_deviations_are_those_of_the_one_group_whose_masses_are_known():
    """Pavol's older people in the tables' deviations, with those of one person, after two tables."""
    lengths = reference_lengths(HEIGHT_M, "male")
    both = {f"{name}_{side}": length for name, length in lengths.items() for side in "rl"}
    geometry = BodyGeometry((-0.1, 0.0, 0.0), (-0.05, -0.08, 0.0), both | {"torso": lengths["torso"]})
    factors = []
    for source in ("dumas", "deleva"):
        away = []
        for sex in ("male", "female"):
            prior = literature_prior(literature_bsp(MASS_KG, HEIGHT_M, sex, geometry, source))
            old = population_prior(prior, subject(population="elderly", sex=sex)).prior
            limbs = [k for k, name in enumerate(prior.mean.segments) if name.endswith("_r")]
            away.append(((old.mean.mass_kg - prior.mean.mass_kg) / prior.sd[:, 0])[limbs])
        factors.append(np.sqrt(1.0 + np.mean(np.square(away))))
    assert factors == pytest.approx([1.58, 1.33], abs=0.01)
    assert pytest.approx(np.mean(factors), abs=0.05) == UNKNOWN_SPREAD


def test_a_laboratorys_plates_are_as_good_as_it_states():
    trial = walk(walking_subject(), 0.6, trapezoid=False)
    carried = []
    for percent in (None, 1e-6, 20.0):
        faults = Faults("artefact", calibration=True, instruments=Instruments(gain_sd_percent=percent))
        _, (recorded,) = measured([trial], faults, np.random.default_rng(5))
        carried.append(recorded.trial.loads.force[:, :, 1].mean())
    assert carried[1] == pytest.approx(trial.foot_loads[:, :, 1].mean(), rel=2e-3)
    assert abs(carried[2] / carried[1] - 1.0) > 0.01


def test_what_is_found_of_a_rucksack_is_told_of_either_laboratory():
    found = [RucksackAccuracy(24, None, 0.8, 0.7, 0.96), RucksackAccuracy(24, 0.2, 0.5, 0.4, 0.95)]
    text = rucksack_sentence(found)
    assert "24 people. Nothing stated of the plates, one in twenty with a faulty gain: RMS error 0.80 kg" in text
    assert "with gain_sd_percent = 0.2: RMS error 0.50 kg, stated deviation 0.40 kg, within the 95 % interval" in text


@pytest.mark.parametrize("name", POPULATIONS)
def test_bodies_of_a_population_are_possible_and_weigh_the_same(name):
    population = POPULATIONS[name].of(PRIOR)
    assert population.mean.total_mass_kg == pytest.approx(PRIOR.mean.total_mass_kg)
    assert population.draw(np.random.default_rng(0)).physically_consistent().all()
    assert np.all(own_prior(name, PRIOR).sd >= PRIOR.sd * 0.7)


def test_people_of_the_prior_are_rarely_unlike_it_and_others_are():
    """An estimate that knows everything is the person: squares of the distance are chi-square."""
    rng, exact = np.random.default_rng(0), 1e-6 * PRIOR.covariance
    people = [mahalanobis_distance(PRIOR, PRIOR.draw(rng), exact) for _ in range(200)]
    assert {person.combinations for person in people} == {120}
    assert np.mean([person.chance < 0.05 for person in people]) < 0.15
    assert np.mean([person.implausible for person in people]) < 0.03
    light = PRIOR.mean.table()
    light[SEGMENTS.index("shank_l"), 0] *= 0.5
    far = mahalanobis_distance(PRIOR, BodySegmentParameters.from_table(SEGMENTS, light), exact)
    assert far.implausible
    assert far.segments[0] == "shank_l"
    assert not far.both_sides
    assert far.one_sided.lighter[0] == "shank_l"
    assert not far.one_sided.added
    off = PRIOR.mean.table()
    for side in "rl":
        off[SEGMENTS.index(f"shank_{side}"), 1] -= 16.0 * PRIOR.sd[SEGMENTS.index(f"shank_{side}"), 1]
    joints = mahalanobis_distance(PRIOR, BodySegmentParameters.from_table(SEGMENTS, off), exact)
    assert joints.implausible
    assert joints.both_sides
    assert joints.one_sided is None
    assert not mahalanobis_distance(PRIOR, PRIOR.mean, PRIOR.covariance).implausible, (
        "data that say nothing contradict nothing"
    )


@pytest.mark.slow
def test_an_undeclared_prosthesis_is_named_and_a_declared_one_is_estimated_better():
    adults, declared = run_person(1, ("prosthesis", 0))
    assert adults.unlike
    assert not declared.unlike
    rows = [SEGMENTS.index(name) for name in ("shank_l", "foot_l")]
    error, before = (np.abs(result.errors[rows, 0]).sum() for result in (declared, adults))
    assert error < before
    assert declared.moments_nm < adults.moments_before_nm
