"""What girths and lengths make of the prior."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.errors import PriorError
from kinertia.estimation import body_measures
from kinertia.estimation.body_measures import expected_measures, measured_body, with_measures
from kinertia.estimation.prior import literature_prior
from kinertia.io.subject.body_files import BodyMeasures, measures_sheet
from kinertia.io.subject.tables import PriorFiles
from kinertia.model.stadium_body import measures
from kinertia.synthetic.walk import HEIGHT_M, MASS_KG, walking_subject
from kinertia.workflow.from_files import prepare_subject
from kinertia.workflow.known_body import KnownBody
from stadium_people import stadium_people
from validation.usual_build import stadium_mass_kg, stature_m

yeadon = pytest.importorskip("yeadon", reason="needs yeadon (pip install -e '.[test]')")
WALKER = walking_subject()
PRIOR = literature_prior(WALKER.literature)
NAMES = [measure.name for measure in measures()]
MAN = stadium_people()["Dan"]
MAN_KG, MAN_M = stadium_mass_kg(MAN.measures_m), float(stature_m(MAN.measures_m[None])[0])


def stated(chosen=lambda measure: True, factor=1.0):
    """A whole sheet."""
    rows = zip(measures(), MAN.measures_m, strict=True)
    return {measure.name: (factor * value, measure.sd_m) for measure, value in rows if chosen(measure)}


def test_more_measurements_say_more():
    few, many = (
        measured_body(stated(which), {"leg_knee_length": 0.42}, 0.08, MAN_KG, MAN_M)
        for which in (lambda measure: measure.first, lambda measure: True)
    )
    sd = [np.sqrt(np.diag(body.covariance)) / np.abs(body.values.ravel()) for body in (few, many)]
    assert np.all(sd[1] <= 1.02 * sd[0])
    assert np.median(sd[1]) < 0.8 * np.median(sd[0])
    assert not many.findings
    assert many.total_kg == pytest.approx(yeadon.Human(dict(MAN.both)).mass, abs=0.5), "what the package says of him"
    assert few.total_kg == pytest.approx(MAN_KG, abs=2.0 * few.total_sd_kg)


def test_slopes_are_those_of_one_measure_at_a_time():
    man = MAN.measures_m
    values = body_measures._predicted(man, 0.08)
    slopes = body_measures._slopes(man, 0.08, values)
    for k in (*range(0, len(man), 7), NAMES.index("trunk_hip_girth")):
        moved = man * np.exp(1e-4 * np.eye(len(man))[k])
        alone = (body_measures._predicted(moved, 0.08) - values).ravel() / 1e-4
        np.testing.assert_allclose(slopes[:, k], alone, atol=1e-9)


def test_covariances_are_covariances():
    mean, covariance = expected_measures(MAN_KG, MAN_M)
    assert np.linalg.eigvalsh(covariance)[0] > 0.0
    assert np.all(np.abs(np.exp(mean) / MAN.measures_m - 1.0) < 0.6)
    body = measured_body({}, {"leg_knee_length": 0.42}, 0.08, MAN_KG, MAN_M)
    assert np.linalg.eigvalsh(body.covariance)[0] > 0.0


def test_the_prior_moves_towards_the_measured_body_and_keeps_what_girths_do_not_say():
    expected, _ = expected_measures(MASS_KG, HEIGHT_M)
    thick = {
        name: (np.exp(expected[NAMES.index(name)]) * 1.08, 0.003)
        for name in NAMES
        if name.startswith("leg_") and "girth" in name
    }
    (prior, body), (plain, _) = (
        with_measures(PRIOR, WALKER.skeleton, stated_measures, MASS_KG, HEIGHT_M) for stated_measures in (thick, {})
    )
    names = PRIOR.mean.segments
    thigh, left = names.index("thigh_r"), names.index("thigh_l")
    assert prior.mean.mass_kg[thigh] > plain.mean.mass_kg[thigh] + 0.2 * PRIOR.sd[thigh, 0]
    assert prior.mean.inertia_kgm2[thigh, 1, 1] > 1.1 * plain.mean.inertia_kgm2[thigh, 1, 1], "girth squared, twice"
    assert prior.sd[thigh, 0] < PRIOR.sd[thigh, 0]
    np.testing.assert_array_equal(prior.mean.com_m[:, 2], PRIOR.mean.com_m[:, 2])
    apart = np.zeros(len(PRIOR.covariance))
    apart[10 * thigh], apart[10 * left] = 1.0, -1.0
    before = apart @ PRIOR.covariance @ apart
    assert apart @ prior.covariance @ apart == pytest.approx(before, rel=1e-6), "the mean of both sides says nothing"
    assert prior.mean.physically_consistent().all()
    assert body.total_kg == pytest.approx(MASS_KG, rel=0.2)


def test_a_usual_person_stays_near_the_tables():
    """Cuts and densities of tables and stadiums differ; that must not pass for knowledge of the person."""
    expected, _ = expected_measures(MASS_KG, HEIGHT_M)
    usual = {measure.name: (value, measure.sd_m) for measure, value in zip(measures(), np.exp(expected), strict=True)}
    prior, _ = with_measures(PRIOR, WALKER.skeleton, usual, MASS_KG, HEIGHT_M)
    moved = (prior.mean.table() - PRIOR.mean.table()) / PRIOR.sd
    assert np.abs(moved).max() < 2.0
    assert np.sqrt(np.mean(np.square(moved[:, [0, 2, 4, 5, 6]]))) < 1.0
    trunk = [PRIOR.mean.segments.index(name) for name in ("pelvis", "torso")]
    whole = np.zeros(len(PRIOR.covariance))
    whole[[10 * row for row in trunk]] = 1.0
    assert whole @ prior.covariance @ whole < 0.9 * (whole @ PRIOR.covariance @ whole)


def test_of_a_prosthesis_nothing_was_measured():
    artificial = ("shank_l", "foot_l")
    lone = replace(PRIOR, covariance=PRIOR.covariance * np.kron(np.eye(12), np.ones((10, 10))))
    alone, _ = with_measures(lone, WALKER.skeleton, stated(), MASS_KG, HEIGHT_M, artificial)
    rows = [PRIOR.mean.segments.index(name) for name in artificial]
    np.testing.assert_allclose(alone.mean.table()[rows], PRIOR.mean.table()[rows], rtol=1e-12)


def test_slips_are_named():
    wrong = {**stated(), "leg_mid_girth": (0.25, 0.007), "trunk_rib_width": (0.45, 0.01)}
    *far, across = measured_body(wrong, {}, 0.08, MAN_KG, MAN_M).findings
    assert {finding.code for finding in (*far, across)} == {"S403"}
    assert {reported.severity.name for reported in (*far, across)} == {"WARNING"}
    for finding, name in zip(far, ("trunk_rib_width", "leg_mid_girth"), strict=True):
        assert (finding.where.part, finding.evidence["value_m"].value) == (name, wrong[name][0])
        assert finding.evidence["expected_m"].value == pytest.approx(stated()[name][0], rel=0.1)
    assert across.evidence["ratio"].value == pytest.approx(stated()["trunk_rib_girth"][0] / 0.45)


def test_slips_are_the_likeliest_cause_of_a_body_that_cannot_be():
    wrong = {name: stated()[name] for name in ("leg_mid_girth", "trunk_hip_girth")} | {"leg_calf_girth": (0.038, 0.005)}
    with pytest.raises(PriorError) as caught:
        measured_body(wrong, {}, 0.08, MAN_KG, MAN_M)
    found = caught.value.finding
    assert (found.code, found.severity.name, found.where.part) == ("S403", "ERROR", "leg_calf_girth")


def test_of_a_sheet_in_inches_a_few_slips_are_named():
    inches = {name: (value / 2.54, sd) for name, (value, sd) in stated().items()}
    with pytest.raises(PriorError) as caught:
        measured_body(inches, {}, 0.08, MAN_KG, MAN_M)
    assert caught.value.finding.code == "S403"
    assert str(caught.value).count("; the other measures imply") == 3


def test_another_model_is_refused():
    prior = literature_prior(replace(WALKER.literature, segments=tuple(f"body{k}" for k in range(12))))
    with pytest.raises(PriorError, match="S405"):
        with_measures(prior, WALKER.skeleton, stated(), MASS_KG, HEIGHT_M)


def test_a_filled_in_sheet_is_part_of_the_prior_and_of_the_notes(c3d_lab, tmp_path):
    text = (c3d_lab / "subject.toml").read_text(encoding="utf-8")
    for name in ("static.c3d", "walk.c3d"):
        text = text.replace(f'"{name}"', f'"{(c3d_lab / name).as_posix()}"')
    sheet = measures_sheet().replace("between crotch and knee,,0.7", "between crotch and knee,60,0.7")
    sheet = sheet.replace("the calf where it is largest,,0.5", "the calf where it is largest,20,0.5")
    assert ",60,0.7," in sheet
    (tmp_path / "measures.csv").write_text(sheet, encoding="utf-8")
    path = tmp_path / "subject.toml"
    path.write_text(f'{text}\n[prior]\nmeasures = "measures.csv"\n', encoding="utf-8")
    ready = prepare_subject(path)
    thigh = ready.prior.mean.segments.index("thigh_r")
    assert ready.prior.mean.mass_kg[thigh] > ready.literature.mass_kg[thigh]
    sources = [finding.evidence["source"].value for finding in ready.findings if finding.code == "S408"]
    assert any("2 of 58" in source and "measures.csv" in source for source in sources)
    assert [finding.where.part for finding in ready.findings if finding.code == "S403"] == ["leg_calf_girth"]
    assert "S404" not in {finding.code for finding in ready.findings}
    known = KnownBody(PriorFiles(), measures=BodyMeasures("dan.csv", stated(factor=1.1)))
    of_another = known.measured_on(replace(ready, findings=()))
    (found,) = [finding for finding in of_another.findings if finding.code == "S404"]
    assert (found.where.file, found.evidence["stated_kg"].value) == ("dan.csv", ready.total_mass.body_kg)
    assert found.evidence["yeadon_kg"].value > 1.2 * ready.total_mass.body_kg


def test_what_is_a_prosthesis_on_both_sides_says_nothing_of_the_others():
    """The errors of what was not measured go with those of what was; they must not be taken for measured."""
    names, feet = PRIOR.mean.segments, ("foot_r", "foot_l")
    whole, without = (
        with_measures(PRIOR, WALKER.skeleton, stated(), MASS_KG, HEIGHT_M, prosthesis)[0] for prosthesis in ((), feet)
    )
    apart = (without.mean.table() - whole.mean.table()) / PRIOR.sd
    others = [k for k, name in enumerate(names) if name not in feet]
    assert np.abs(apart[others]).max() < 0.5


def test_who_was_weighed_with_something_of_unknown_mass_has_girths_of_more_masses():
    _, known = expected_measures(MASS_KG, HEIGHT_M)
    _, unknown = expected_measures(MASS_KG, HEIGHT_M, 0.1 * MASS_KG)
    girth, length = NAMES.index("leg_mid_girth"), NAMES.index("leg_knee_length")
    assert unknown[girth, girth] == pytest.approx(known[girth, girth] + 0.05**2)
    assert unknown[length, length] == known[length, length]
