"""What is not body is a segment of its own: what is known of it goes in, what is not comes out."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from kinertia.errors import BlockedError, PriorError, SettingsError
from kinertia.estimation.prepared import Prepared, TotalMass
from kinertia.estimation.prior import literature_prior
from kinertia.estimation.simultaneous.fit import calibration_prior
from kinertia.estimation.simultaneous.instruments.instrument_errors import GAIN, CalibrationEntry
from kinertia.estimation.simultaneous.instruments.priors import GAIT27_UNCERTAINTY
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import Bandwidth
from kinertia.estimation.simultaneous.observation import observe
from kinertia.estimation.simultaneous.solver import estimate_simultaneous
from kinertia.findings.finding import Severity, finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.io.opensim.reader import read_osim
from kinertia.model.bsp import BodySegmentParameters
from kinertia.motion.dynamics import inverse_dynamics, residual
from kinertia.settings import Attached, KnownSegment, PriorSettings, Settings, Subject
from kinertia.synthetic.laboratory import LabNoise, record, write_lab
from kinertia.synthetic.motions import Faults, measured
from kinertia.synthetic.walk import MASS_KG, walk, walking_subject
from kinertia.workflow.from_files import fit_subject
from kinertia.workflow.known_body import KnownBody
from kinertia.workflow.masses import at_common_gain, common_gain, with_attached, with_doubted_mass
from kinertia.workflow.person import Person
from kinertia.workflow.prepare import prepare

PACK = {"name": "rucksack", "segment": "torso", "com_mm": [-200, 300, 0], "on_scale": False}


def ready(*attached):
    """As much of a prepared person as is looked at."""
    subject = walking_subject()
    prior = literature_prior(subject.literature)
    person = Subject(name="A", mass_kg=MASS_KG)
    of_body = (prior.mean, prior, GAIT27_UNCERTAINTY, None)
    return Prepared(person, Settings(), subject.skeleton, *of_body, (), (), (), (), attached=attached)


def known(person, segments, **settings):
    """The person, with what is attached, and what is known of segments."""
    body = KnownBody(PriorSettings(**settings), segments=segments)
    return body.measured_on(with_attached(*body.leaned_on(person)))


@pytest.mark.parametrize(
    ("mass", "expected"),
    [(10, (10.0, 0.1)), ("10 +- 0.5", (10.0, 0.5)), ("unknown", (0.10 * MASS_KG, 0.15 * MASS_KG))],
)
def test_rows_of_their_own_after_the_body(mass, expected):
    before, after = ready(), with_attached(ready(Attached(mass_kg=mass, **PACK)))
    size = len(before.prior.covariance)
    np.testing.assert_array_equal(after.prior.covariance[:size, :size], before.prior.covariance)
    assert not after.prior.covariance[size:, :size].any()
    assert (after.prior.mean.mass_kg[-1], after.prior.sd[-1, 0]) == pytest.approx(expected)
    np.testing.assert_allclose(after.prior.mean.com_m[-1], [-0.2, 0.3, 0.0])
    np.testing.assert_allclose(after.prior.sd[-1, 1:4], 0.03)
    assert after.skeleton.segments[-1] == after.literature.segments[-1] == "rucksack"
    assert after.skeleton.coordinates == before.skeleton.coordinates
    assert (after.findings[-1].code, after.findings[-1].where.part) == ("S408", "rucksack")


def test_the_literature_stays_where_more_is_known_of_the_body():
    """What was measured of a segment is in the prior's mean, not in what the literature says."""
    before = ready(Attached(mass_kg=10.0, **PACK))
    after = known(before, {"thigh_r": KnownSegment(mass_kg="9.9 +- 0.1")})
    np.testing.assert_array_equal(after.literature.table()[:12], before.literature.table())
    assert after.literature.segments == after.prior.mean.segments
    assert after.prior.mean.mass_kg[2] == pytest.approx(9.9, abs=0.1) != after.literature.mass_kg[2]


def test_the_inertia_is_that_of_a_block():
    after = with_attached(ready(Attached(mass_kg=12.0, size_mm=[200, 500, 300], **PACK)))
    expected = [0.5**2 + 0.3**2, 0.2**2 + 0.3**2, 0.2**2 + 0.5**2]
    np.testing.assert_allclose(np.diag(after.prior.mean.inertia_kgm2[-1]), expected)


def test_without_a_size_the_inertia_is_that_of_a_ball_of_water():
    after = with_attached(ready(Attached(mass_kg=4.0, **PACK)))
    radius_m = (3 * 4e-3 / (4 * np.pi)) ** (1 / 3)  # of 4 litres
    np.testing.assert_allclose(np.diag(after.prior.mean.inertia_kgm2[-1]), 0.4 * 4.0 * radius_m**2)


def test_the_scale_weighs_what_stood_on_it():
    on, beside = (Attached(mass_kg=4.0, **{**PACK, "name": name, "on_scale": name == "on"}) for name in ("on", "off"))
    assert TotalMass.of(70.0, [on, beside]) == TotalMass(66.0, 74.0, pytest.approx(0.04))
    prior = with_attached(ready(on, beside)).prior
    assert prior.weighed == (*(True,) * 12, True, False)
    mean, covariance = prior.given_scale()
    assert prior.on_scale @ mean[::10] == pytest.approx(MASS_KG + 4.0), "the body's prior here weighs all of MASS_KG"
    row = 10 * 13
    assert covariance[row, row] == prior.covariance[row, row], "the scale says nothing of what it did not weigh"


def test_the_body_is_the_lighter_the_heavier_what_was_weighed_with_it():
    """Of 72.6 kg on the scale nobody knows how many are the body's: its shares of them are no second weighing."""
    before, pack = ready(), Attached(mass_kg="unknown", **{**PACK, "on_scale": True})
    prior = with_attached(ready(pack)).prior
    body = np.zeros(len(prior.covariance))
    body[:120:10] = 1.0
    body_variance = body[:120] @ before.prior.covariance @ body[:120]
    assert body @ prior.covariance @ body == pytest.approx(body_variance + (0.15 * MASS_KG) ** 2)
    both = body.copy()
    both[120] = 1.0
    assert both @ prior.covariance @ both == pytest.approx(body_variance), "the total is as well known as before"
    _, weighed = prior.given_scale()
    assert weighed[120, 120] > (0.14 * MASS_KG) ** 2, "the scale does not tell them apart"
    assert np.linalg.eigvalsh(prior.covariance / np.outer(*[prior.sd.ravel()] * 2))[0] > 0


def test_segments_that_are_known_by_themselves_are_no_shares_of_it():
    pack = Attached(mass_kg="unknown", **{**PACK, "on_scale": True})
    segments = {"shank_l": KnownSegment(prosthesis=True), "torso": KnownSegment(mass_kg="29 +- 0.3")}
    prior = known(ready(pack), segments).prior
    shank = 10 * prior.mean.segments.index("shank_l")
    assert prior.covariance[shank, 120] == 0.0
    _, weighed = prior.given_scale()
    assert weighed[120, 120] < (0.08 * 0.9 * MASS_KG) ** 2, "the body is known by its torso's share, within 8 %"
    with pytest.raises(
        PriorError, match=r"masses_kept = true under .prior., but rucksack, of unknown mass, was weighed"
    ):
        known(ready(pack), {}, masses_kept=True)


def test_a_welded_segment_moves_as_the_torso_does():
    """The dynamics are those of a torso that is as much heavier."""
    after = with_attached(ready(Attached(mass_kg=10.0, **PACK)))
    trial = walk(walking_subject(), 0.3)
    bsp = after.prior.mean
    torso, pack = (bsp.segments.index(name) for name in ("torso", "rucksack"))
    rows = bsp.dynamic_parameters().reshape(-1, 10)
    rows[torso] += rows[pack]
    welded = BodySegmentParameters.from_dynamic_parameters(bsp.segments[:-1], rows[:-1])
    wrench = trial.foot_loads.sum(axis=1)
    np.testing.assert_allclose(
        residual(after.skeleton, bsp, trial.motion, wrench),
        residual(trial.skeleton, welded, trial.motion, wrench),
        atol=1e-8,
    )


def carrying(rng):
    """A person with a rucksack, measured, and the prior of one who has said that its mass is unknown."""
    declared = with_attached(ready(Attached(mass_kg="unknown", **PACK)))
    wider = declared.prior
    true = wider.draw(rng).table()
    true[-1] = with_attached(ready(Attached(mass_kg="10 +- 0.5", **PACK))).prior.draw(rng).table()[-1]
    person = BodySegmentParameters.from_table(wider.mean.segments, true)
    trial = walk(replace(walking_subject(), skeleton=declared.skeleton, bsp=person), 2.5, trapezoid=False)
    return trial, wider, *measured([trial], Faults("artefact", calibration=True), rng)


@pytest.mark.slow
def test_an_unknown_mass_is_found_within_its_error_bar_and_moments_are_better_for_it():
    away, errors, moments = [], [], []
    for seed in range(4):
        trial, prior, skeleton, recorded = carrying(np.random.default_rng(seed))
        seen = observe(skeleton, recorded, prior.mass_kg, Bandwidth.of(recorded))
        result = estimate_simultaneous(skeleton, prior, calibration_prior(skeleton), seen.pooled)
        assert result.converged
        error = result.bsp.mass_kg[-1] - trial.bsp.mass_kg[-1]
        sd = np.sqrt(result.bsp_covariance[-10, -10])
        away.append(error / sd)
        errors.append(error)
        at = np.searchsorted(trial.time, recorded[0].time - 1e-9)
        torque = [
            inverse_dynamics(skeleton, bsp, trial.motion.cut(at), trial.foot_loads[at])
            for bsp in (trial.bsp, result.bsp, prior.mean)
        ]
        moments.append([np.sqrt(np.mean(np.square(moment - torque[0]))) for moment in torque[1:]])
    assert np.abs(away).max() < 3.0
    assert np.sqrt(np.mean(np.square(errors))) < 1.5, "beside 11 kg of prior deviation"
    after, before = np.mean(moments, axis=0)
    assert after < before


@pytest.mark.slow
def test_a_rucksack_that_nobody_declared_is_named(tmp_path):
    """Files of a person who walks with 10 kg on the back, which the scale did not weigh."""
    pack = with_attached(ready(Attached(mass_kg=10.0, **PACK)))
    person = replace(walking_subject(), skeleton=pack.skeleton, bsp=pack.prior.mean)
    write_lab(
        tmp_path / "lab",
        record(person, walk(person, 2.5, trapezoid=False), LabNoise(), np.random.default_rng(0)),
    )
    with pytest.raises(BlockedError) as stopped:
        fit_subject(tmp_path / "lab" / "subject.toml")
    (found,) = stopped.value.blocking
    assert (found.code, found.severity) == ("S111", Severity.ERROR)
    assert found.evidence["stated_kg"].value == MASS_KG
    assert found.evidence["mass_by_force_kg"].value == pytest.approx(MASS_KG + 10.0, rel=0.02)
    assert any("worn or carried" in cause for cause in found.causes)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"segment": "trunk"}, r"\[\[attached\]\] rucksack: the model has no segment 'trunk'; it has pelvis, "),
        ({"name": "torso"}, r"\[\[attached\]\] torso: there is a segment of this name already"),
        (
            {"name": "ground"},
            r"\[\[attached\]\] ground: this is OpenSim's name for the laboratory; give it another name",
        ),
    ],
)
def test_what_cannot_be_is_an_error(change, words):
    with pytest.raises(PriorError, match=words):
        with_attached(ready(Attached(mass_kg=10.0, **{**PACK, **change})))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mass_kg": "about ten"}, "must be a mass in kg"),
        ({"mass_kg": "-3 +- 1"}, "must be a mass in kg"),
        ({"mass_kg": 0}, "must be a mass in kg"),
        ({"com_mm": [1, 2]}, "must be three numbers"),
        ({"com_mm": [0, 3000, 0]}, "none beyond 2000"),
        ({"com_mm": [-0.2, 0.3, 0.0]}, "are they in m"),
        ({"size_mm": [0.28, 0.09, 0.1]}, "are they in m"),
        ({"size_mm": [100, 0, 100]}, "lengths above zero"),
        ({"name": "a b"}, "should match pattern"),
    ],
)
def test_entries_that_cannot_be_say_what_is_expected(change, words):
    with pytest.raises(ValidationError, match=words):
        Attached(**{"mass_kg": 10.0, **PACK, **change})


def test_things_that_weigh_more_than_the_scale_said_are_an_error():
    heavy = [Attached(mass_kg=35, **{**PACK, "name": name, "on_scale": True}) for name in ("bag", "vest")]
    with pytest.raises(PriorError, match=r"leaves 2\.6 kg of 72\.6 kg") as caught:
        TotalMass.of(72.6, heavy)
    assert caught.value.finding.code == "S406"
    assert "F191" not in str(caught.value)


def test_two_level_refuses_what_it_would_ignore(synthetic_lab):
    subject = walking_subject()
    person = Person(Subject(name="A", mass_kg=MASS_KG, height_m=1.8, sex="male"), [], subject.static)
    model = read_osim(synthetic_lab / "scaled.osim")
    for unused, given, prior in (
        ("[[attached]]", replace(person, attached=[Attached(mass_kg=1.0, **PACK)]), None),
        ("priors", person, literature_prior(subject.bsp)),
        ("OpenSim models", replace(person, static=None, model=model), None),
    ):
        with pytest.raises(SettingsError) as caught:
            prepare(given, Settings(method="two-level"), prior=prior)
        evidence = caught.value.finding.evidence
        assert evidence["entry"].value == "method"
        assert unused in evidence["expected"].value


@pytest.fixture(scope="module")
def prior():
    return literature_prior(walking_subject().bsp)


def contradiction(agreeing=2, severity=Severity.WARNING, trial=None):
    masses = {"mass_by_force_kg": Quantity(70.0, "kg", sd=0.4), "stated_kg": Quantity(72.6, "kg")}
    more = {"agreeing": Quantity(agreeing, "1"), "action": Quantity("Correct the mass")}
    return finding("S111", Where(trial=trial), severity, **masses, **more)


@pytest.mark.parametrize("trial", [None, "walk"])
def test_plates_that_agree_are_not_scaled_to_it(prior, trial):
    """A body of the same build, of their mass."""
    doubted = with_doubted_mass(prior, [contradiction(trial=trial)])
    assert (doubted.mass_kg, doubted.mass_sd_kg) == (pytest.approx(70.0), pytest.approx(0.4, abs=0.05))
    factor = 70.0 / 72.6
    assert doubted.mean.mass_kg == pytest.approx(factor * prior.mean.mass_kg)
    assert doubted.mean.com_m == pytest.approx(prior.mean.com_m)
    rows = np.array([factor, 1.0, 1.0, 1.0, *[factor] * 6])
    assert doubted.sd == pytest.approx(rows * prior.sd)


def test_else_the_stated_mass_is_kept(prior):
    ignored = replace(contradiction(), status="ignored")
    waived = replace(contradiction(severity=Severity.ERROR), status="waived")
    for doubted in (contradiction(1), ignored, waived, contradiction().muted("P281")):
        assert with_doubted_mass(prior, [doubted]) is prior
    assert with_doubted_mass(prior, []) is prior


def gains(*values, sd=0.02, trial="walk"):
    """Gain errors of plates in a trial, and those of all trials that it leaves undecided."""
    of_plates = {"kind": "plate", "quantity": GAIN, "unit": "1"}
    of_trials = [
        CalibrationEntry(plate=f"plate {k}", trial=trial, value=value, prior_sd=0.018, sd=sd, **of_plates)
        for k, value in enumerate(values)
    ]
    lasting = [
        CalibrationEntry(plate=f"plate {k}", value=value / 4, prior_sd=0.007, sd=0.03, **of_plates)
        for k, value in enumerate(values)
    ]
    return lasting + of_trials


@pytest.mark.parametrize("values", [(-0.0764, -0.107), (0.065, 0.066), (-0.05, -0.08, -0.06)])
def test_all_plates_alike(values):
    error, sd = common_gain(gains(*values))
    assert error == pytest.approx(sum(values) / len(values))
    prior = literature_prior(walking_subject().bsp)
    there = at_common_gain(prior, prior.mass_kg, (error, sd))
    assert there.mass_kg == pytest.approx((1 + error) * prior.mass_kg)
    assert there.mass_sd_kg == pytest.approx(sd * there.mass_kg)


@pytest.mark.parametrize(
    "values", [(-0.09,), (-0.09, 0.001), (-0.09, 0.08), (-0.15, -0.06), (-0.05, -0.08, -0.004), (0.01, 0.01)]
)
def test_a_plate_of_its_own(values):
    assert common_gain(gains(*values)) is None


def test_a_plate_that_nobody_stands_on_says_nothing():
    idle = gains(-0.08, 0.0, -0.09)
    idle[4] = gains(0.0, 0.0, sd=0.018)[3]
    error, _ = common_gain(idle)
    assert error == pytest.approx(-0.085)


def test_trials_that_differ_have_no_mass_in_common():
    first, second = gains(-0.08, -0.09), gains(0.002, -0.003, trial="second")
    assert common_gain([*first, *second[2:]]) is None
