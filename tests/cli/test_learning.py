"""`kinertia population`: from people's results to a file that the fits of others start from."""

import csv
import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from command_line import run
from kinertia.cli.results import score_text
from kinertia.errors import SessionError
from kinertia.estimation.learnt_prior import information_of
from kinertia.estimation.prior import literature_prior
from kinertia.estimation.result.drawn_fit import drawn_fit
from kinertia.estimation.simultaneous.instruments.priors import InstrumentInformation
from kinertia.io.file_names import command_line
from kinertia.io.norms_file import read_norms
from kinertia.io.subject.learnt_files import PersonInstruments, read_session
from kinertia.io.subject.provenance import Provenance, recordings
from kinertia.io.subject.reader import read_subject
from kinertia.motion.spatiotemporal import MEASURES
from kinertia.report.exports.saved_fit import FIT_FILE, write_fit
from kinertia.settings import Instruments
from kinertia.workflow.from_files import check_plates, prepare_subject
from kinertia.workflow.session import session_instruments
from report_page import figures_of
from validation.other_prior import with_prior


@pytest.fixture
def cohort(fit, tmp_path):
    """Six people of the same recordings, each called by another name."""
    rng = np.random.default_rng(0)
    # posterior means of people spread as much as the data have taken from the prior's variance
    values, vectors = np.linalg.eigh(literature_prior(fit.literature).covariance - fit.posterior.covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    for k in range(6):
        noise = root @ rng.standard_normal(len(root))
        table = fit.literature.table() + noise.reshape(12, 10)
        bsp = type(fit.estimate).from_table(fit.estimate.segments, table)
        person = replace(fit, estimate=bsp, subject=fit.subject.model_copy(update={"name": f"p{k}"}))
        folder = tmp_path / "out" / "people" / f"p{k}"
        folder.mkdir(parents=True)
        files = {f"p{k}/walk.trc": f"hash{k}", "lab.toml": "marker set", f"p{k}/loads.xml": "loads"}
        write_fit(person, Provenance("kinertia fit", files), folder / FIT_FILE)
    return tmp_path / "out"


@pytest.mark.slow
def test_a_group_is_learnt_and_used(cohort, demo_command, tmp_path):
    _, folder, _ = demo_command
    outcome = run("population", cohort, "--without", "p3", "-o", tmp_path / "population.toml")
    assert outcome.status == 0, outcome.err
    assert "5 people" in outcome.out
    content = json.loads(run("population", cohort, "--without", "p3", "-o", tmp_path / "again.toml", "--json").out)
    assert content["people"] == 5
    assert [*content["parameters"][0]] == ["segment", "parameter", "mean", "mean_sd", "spread", "learnt"]
    assert len(content["parameters"]) == 12 * 10
    text = (tmp_path / "population.toml").read_text(encoding="utf-8")
    assert '"hash2"' in text
    assert '"hash3"' not in text
    subject = folder / "lab" / "subject.toml"
    with_group = subject.with_name("grouped.toml")
    with_group.write_text(
        subject.read_text(encoding="utf-8")
        + f'\n[prior]\npopulation = "{(tmp_path / "population.toml").as_posix()}"\n',
        encoding="utf-8",
    )
    plain, grouped = (prepare_subject(path) for path in (subject, with_group))
    sources = [str(finding.evidence["source"].value) for finding in grouped.findings if finding.code == "S408"]
    assert any("learnt from 5 people" in source for source in sources)
    assert np.all(grouped.prior.sd <= 1.01 * np.sqrt(1.5) * plain.prior.sd)
    assert grouped.prior.sd.min() > 0
    used_files = recordings(read_subject(subject))[0]
    with_own = (tmp_path / "population.toml").read_text(encoding="utf-8").replace("hash2", used_files)
    (tmp_path / "population.toml").write_text(with_own, encoding="utf-8")
    refused = run("fit", with_group, "-o", tmp_path / "fit")
    assert refused.status == 2
    assert "was learnt from these trials as well, so they would count twice" in refused.err
    assert command_line(["--without", "synthetic walker"]) in refused.err


@pytest.mark.slow
def test_what_cannot_be_learnt_is_said(cohort, tmp_path):
    assert "5 people" in run("population", cohort, "-o", tmp_path / "x.toml", "--without", "p0").out
    for arguments, words in (
        ([cohort, "--without", "nobody"], "nobody is called nobody here"),
        (
            [cohort, "--without", "p0", "--without", "p1"],
            "its mean and spread need at least 5",
        ),
        ([tmp_path], "holds no results of kinertia cohort or kinertia fit"),
        ([cohort, cohort / "people" / "p0"], "of its files also belong to another person here"),
    ):
        outcome = run("population", *arguments, "-o", tmp_path / "y.toml")
        assert outcome.status == 2
        assert words in outcome.err
    (tmp_path / "mine.toml").write_text("[subject]\n", encoding="utf-8")
    assert "not a file that kinertia population wrote" in run("population", cohort, "-o", tmp_path / "mine.toml").err


@pytest.mark.slow
def test_a_group_is_those_whom_the_cohort_lists_by_the_names_it_lists_them_by(cohort, tmp_path):
    """Results stay of people who have left the study, or are called otherwise there now."""
    people = cohort / "people"
    shutil.copytree(people / "p0", people / "=p0")
    listed = ["person,status", "'=p0,0", *(f"p{k},{k % 2}" for k in range(1, 5)), "p5,2"]
    (cohort / "people.csv").write_text("\n".join(listed), encoding="utf-8")
    outcome = run("population", cohort, "-o", tmp_path / "population.toml")
    assert outcome.status == 0, outcome.err
    printed = " ".join(outcome.out.split())
    for name in ("p0", "p5"):
        assert f"left out: {name}: has no current results according to people.csv, only older ones" in printed
    text = (tmp_path / "population.toml").read_text(encoding="utf-8")
    assert 'people = ["=p0", "p1", "p2", "p3", "p4"]' in text
    assert "hash5" not in text
    assert run("population", people / "p5", cohort, "-o", tmp_path / "with.toml").status == 0


def test_information_is_what_the_prior_does_not_explain(fit):
    """With the prior put back it gives the estimate, but for what is too little to count."""
    person = information_of(fit)
    sd = fit.posterior.prior_sd
    estimate, covariance = with_prior(person, person.literature)
    np.testing.assert_allclose(covariance, fit.posterior.covariance, atol=2.5e-3 * sd.max() ** 2)
    np.testing.assert_allclose((estimate.table() - fit.estimate.table()) / sd, 0.0, atol=0.05)


def test_who_was_fitted_at_the_mass_of_the_plates_can_be_learnt_from(fit):
    """Their prior is the tables' at another mass."""
    prior = literature_prior(fit.literature).at_mass(0.95 * fit.literature.total_mass_kg, 0.4)
    weighed = replace(fit, posterior=replace(fit.posterior, prior_mean=prior.mean, prior_sd=prior.sd))
    assert information_of(weighed).literature.mass_kg == pytest.approx(prior.mass_kg)


@pytest.fixture(scope="module")
def controls(fit, tmp_path_factory):
    """Three people, alike as draws from one posterior are."""
    folder = tmp_path_factory.mktemp("controls")
    for number, name in enumerate(("anna", "ben", "cleo")):
        (folder / name).mkdir()
        subject = fit.subject.model_copy(update={"name": name, "age_years": 20.0 + 10.0 * number})
        write_fit(replace(drawn_fit(fit, number), subject=subject), None, folder / name / FIT_FILE)
    return folder


def test_norms_and_scores(fit, demo_run, controls, tmp_path):
    file = tmp_path / "norms.csv"
    outcome = run("norms", controls, "-o", file)
    assert outcome.status == 0, outcome.err
    assert "norms of 3 people (20 to 40 years, " in outcome.out
    table = pd.read_csv(file)
    assert set(table.convention) == {"Kinertia gait27"}
    assert (table.n.max(), table.age_years_min[0], table.age_years_max[0]) == (3, 20.0, 40.0)
    assert {"foot_progression_clinical", "knee_angle_moment", "ground_force_upward"} <= set(table.quantity)
    norm = read_norms(file)["knee_angle_angle"]
    assert (norm.people, norm.convention, norm.age_years) == (3, "Kinertia gait27", (20.0, 40.0))
    assert "norms mix" not in outcome.out
    sides = fit.spatiotemporal.groupby("side").speed_m_s.mean()
    assert read_norms(file)["speed_m_s"].mean == pytest.approx([sides.mean()], rel=0.02), "draws of one person"
    results = tmp_path / "out"
    results.mkdir()
    shutil.copy(demo_run[1] / FIT_FILE, results)
    outcome = run("report", results, "--norms", file)
    assert outcome.status == 0, outcome.err
    assert "Gait Profile Score" in outcome.out
    notes = [line for line in outcome.out.splitlines() if line.startswith("note: ")]
    assert all("years" in line or "m/s" in line or "Age" in line for line in notes)
    page = (results / "report.html").read_text(encoding="utf-8")
    assert "Gait Profile Score" in page
    assert "norm, right" in json.dumps(figures_of(page), default=str)
    assert ">controls<" in page
    assert "norm, mean" in json.dumps(figures_of(page)["cycle-joint-moments"], default=str)
    scores = list(csv.DictReader((results / "gps.csv").open(encoding="utf-8")))
    assert len(scores) == 21
    cycles = pd.read_csv(results / "cycles.csv")
    pd.testing.assert_frame_equal(fit.cycles(norms=file), cycles, rtol=1e-4, check_dtype=False)
    pd.testing.assert_frame_equal(fit.gps(file).table, pd.read_csv(results / "gps.csv"), rtol=1e-4, check_dtype=False)
    assert run("report", results).status == 0
    assert not (results / "gps.csv").exists(), "scores of norms that the report no longer has"
    pd.testing.assert_frame_equal(fit.cycles(), pd.read_csv(results / "cycles.csv"), rtol=1e-4, check_dtype=False)


def test_norms_of_versions_without_measures_are_read(demo_run, controls, tmp_path):
    file, results = tmp_path / "norms.csv", tmp_path / "out"
    assert run("norms", controls, "-o", file).status == 0
    table = pd.read_csv(file)
    table[~table.quantity.isin(MEASURES)].to_csv(file, index=False)
    results.mkdir()
    shutil.copy(demo_run[1] / FIT_FILE, results)
    outcome = run("report", results, "--norms", file)
    assert outcome.status == 0, outcome.err
    page = (results / "report.html").read_text(encoding="utf-8")
    assert "Gait Profile Score" in page
    assert ">controls<" not in page


def test_one_folder_per_person(controls, tmp_path):
    outcome = run("norms", controls / "anna", controls, "-o", tmp_path / "n.csv")
    assert outcome.status == 0, "the same folder twice counts once"
    shutil.copytree(controls / "anna", tmp_path / "again")
    outcome = run("norms", controls, tmp_path / "again", "-o", tmp_path / "n.csv")
    assert outcome.status == 2
    assert "is a second fit of anna" in " ".join(outcome.err.split())


def test_people_whose_fits_are_named_after_their_trials_are_told_by_their_folders(fit, tmp_path):
    """Each child's trial is called "straight", and so is the fit."""
    for number, name in enumerate(("HC030A", "HC032A")):
        drawn = drawn_fit(fit, number)
        (tmp_path / name).mkdir()
        subject = fit.subject.model_copy(update={"name": drawn.trials[0].name})
        write_fit(replace(drawn, subject=subject), None, tmp_path / name / FIT_FILE)
    outcome = run("norms", tmp_path / "HC030A", tmp_path / "HC032A", "-o", tmp_path / "n.csv", "--json")
    assert json.loads(outcome.out)["people"] == ["HC030A", "HC032A"], outcome.err


def test_too_few_people_and_other_files_are_refused(controls, tmp_path):
    outcome = run("norms", controls / "anna", "-o", tmp_path / "n.csv")
    assert outcome.status == 2
    assert "at least 2 different people" in outcome.err
    assert not (tmp_path / "n.csv").exists()
    other = tmp_path / "mine.csv"
    other.write_text("a,b\n1,2\n")
    outcome = run("norms", controls, "-o", other)
    assert outcome.status == 2
    assert other.read_text() == "a,b\n1,2\n"


def test_norms_of_another_model_are_refused(demo_run, controls, tmp_path):
    file, results = tmp_path / "norms.csv", tmp_path / "out"
    assert run("norms", controls, "-o", file).status == 0
    file.write_text(file.read_text().replace("Kinertia gait27", "Plug-in Gait"))
    results.mkdir()
    shutil.copy(demo_run[1] / FIT_FILE, results)
    outcome = run("report", results, "--norms", file)
    assert outcome.status == 2
    assert "the norms are of Plug-in Gait" in " ".join(outcome.err.split())
    assert not (results / "report.html").exists()


def test_a_score_that_does_not_exist_is_not_printed_as_a_number():
    assert score_text(7.96) == "8.0 degrees"
    assert "nan" not in score_text(float("nan"))


@pytest.fixture(scope="module")
def session(c3d_lab, tmp_path_factory):
    """The file of the measured walk alone, and the outcome of the command."""
    path = tmp_path_factory.mktemp("session") / "instruments.toml"
    return path, run("instruments", c3d_lab / "subject.toml", "-o", path)


def subject_with(folder, c3d_lab, entries):
    """The measured walk's subject file with these lines under [instruments]."""
    text = (c3d_lab / "subject.toml").read_text(encoding="utf-8")
    for name in ("static.c3d", "walk.c3d"):
        text = text.replace(f'"{name}"', f'"{(c3d_lab / name).as_posix()}"')
    path = folder / "subject.toml"
    path.write_text(f"{text}\n[instruments]\n{entries}\n", encoding="utf-8")
    return path


@pytest.mark.slow
def test_the_command_writes_what_it_shows(session):
    path, outcome = session
    assert outcome.status == 0, outcome.err
    (person,) = read_session(path)
    assert person.plates == ("plate 1", "plate 2")
    shown = re.search(r"plate 2\s+gain\s+([+-][\d.]+)\s+([\d.]+)\s+%", outcome.out)
    written = re.search(r'\[found\."plate 2"\].*?gain_percent = ([-\d.]+)', path.read_text(encoding="utf-8"), re.DOTALL)
    assert float(shown[1]) == pytest.approx(float(written[1]), abs=0.06)
    assert np.linalg.eigvalsh(np.array(person.information))[0] > -1e-6


@pytest.mark.slow
def test_a_fit_leaves_out_what_it_has_said_itself(session, c3d_lab, tmp_path):
    path, _ = session
    prepared = prepare_subject(subject_with(tmp_path, c3d_lab, f'session = "{path.as_posix()}"'))
    assert prepared.uncertainty.instruments.session == ()
    (said,) = [finding for finding in prepared.findings if finding.code == "S408"]
    assert "1 person (synthetic walker) left out" in said.evidence["source"].value
    (person,) = read_session(path)
    text = path.read_text(encoding="utf-8")
    for known in person.files:
        text = text.replace(known, f"of somebody else: {known}")
    (tmp_path / "others.toml").write_text(text, encoding="utf-8")
    helped = prepare_subject(subject_with(tmp_path, c3d_lab, 'session = "others.toml"'))
    (information,) = helped.uncertainty.instruments.session
    np.testing.assert_array_equal(information.information, person.information)
    (tmp_path / "elsewhere.toml").write_text(text.replace('"plate 1", "plate 2"', '"left", "right"'), encoding="utf-8")
    with pytest.raises(SessionError, match="none of the session's plates") as caught:
        prepare_subject(subject_with(tmp_path, c3d_lab, 'session = "elsewhere.toml"'))
    assert caught.value.finding.code == "S502"


def test_what_the_laboratory_states_is_used_and_checked(c3d_lab, tmp_path):
    ready = prepare_subject(subject_with(tmp_path, c3d_lab, "plate_sd_mm = 2\nclock_sd_ms = 0.5"))
    known = ready.uncertainty.instruments
    assert (known.plate["x"].sd, known.delay_s.sd) == (0.002, 0.0005)
    outcome = run("fit", subject_with(tmp_path, c3d_lab, "plate_sd_mm = -2"), "-o", tmp_path / "out")
    assert outcome.status == 2
    assert "plate_sd_mm = -2" in outcome.err


def test_people_who_contradict_each_other_are_named():
    def person(name, delay_s):
        information = np.diag([1e4] * 8 + [1e8])
        rhs = tuple((information @ [*[0.0] * 8, delay_s]).tolist())
        rows = tuple(map(tuple, information.tolist()))
        return PersonInstruments(name=name, files=(name,), plates=("plate 1",), information=rows, rhs=rhs)

    alike = session_instruments([person("A", 0.010), person("B", 0.0101)], Instruments())
    assert alike.contradictions == ()
    assert alike.found["synchronisation"]["delay"][0] == pytest.approx(0.010, abs=1e-4)
    assert alike.found["synchronisation"]["delay"][1] == pytest.approx(1e-4 / np.sqrt(2.0), rel=0.01)
    (contradiction,) = session_instruments([person("A", 0.010), person("B", 0.002)], Instruments()).contradictions
    assert contradiction.code == "S501"
    found = [contradiction.evidence[name].value for name in ("error", "other_error")]
    assert found == pytest.approx([0.010, 0.002], abs=1e-4)


def test_fits_of_one_person_show_plates_no_better_than_one():
    """But the delay, which is not their body's."""

    def fitted(*files):
        information = np.diag([1e5] * 8 + [1e6])
        rhs = tuple((information @ [0.010, *[0.0] * 7, 0.010]).tolist())
        rows = tuple(map(tuple, information.tolist()))
        return PersonInstruments(name=files[0], files=files, plates=("plate 1",), information=rows, rhs=rhs)

    def found(*people):
        errors = session_instruments(people, Instruments()).found
        return errors["plate 1"]["position x"][:2], errors["synchronisation"]["delay"][1]

    once, again, other = fitted("static", "walk 1"), fitted("walk 2", "static"), fitted("another's static", "walk")
    (one_m, one_sd_m), one_s = found(once)
    (same_m, same_sd_m), same_s = found(once, again)
    (two_m, two_sd_m), two_s = found(once, other)
    assert (same_m, same_sd_m) == pytest.approx((one_m, one_sd_m), rel=1e-6)
    assert same_s == two_s == pytest.approx(one_s / np.sqrt(2.0), rel=0.05)
    assert two_sd_m < 0.9 * one_sd_m
    assert abs(two_m) > abs(one_m)


def test_a_fit_that_shows_little_takes_nothing_from_another_of_the_same_person():
    strong, weak = (
        InstrumentInformation(("plate 1",), np.diag([certain] * 8 + [1e6]), np.append(np.full(8, certain * 0.01), 1e4))
        for certain in (1e5, 1e2)
    )
    both = InstrumentInformation.of_one_person([strong, weak])
    np.testing.assert_allclose(np.diag(both.information)[:8], 1e5, rtol=0.2)
    np.testing.assert_allclose(both.rhs[:8] / np.diag(both.information)[:8], 0.01)
    assert (both.information[8, 8], both.rhs[8]) == pytest.approx((2e6, 2e4))


def test_columns_of_force_files_are_plates_only_where_somebody_says_so(sample_walk, tmp_path):
    walk = sample_walk / "gait2354" / "subject01_walk1"
    text = f"""
[subject]
mass_kg = 72.6
height_m = 1.803
sex = "male"
[model]
static = "{(walk.parent / "subject01_static.trc").as_posix()}"
[[trial]]
markers = "{walk.as_posix()}.trc"
forces = "{walk.as_posix()}_grf.mot"
loads = "{walk.as_posix()}_grf.xml"
"""
    path = tmp_path / "subject.toml"
    path.write_text(text, encoding="utf-8")
    outcome = run("instruments", path, "-o", tmp_path / "instruments.toml")
    assert outcome.status == 2
    assert "same_plates = true under [instruments]" in outcome.err
    path.write_text(f"{text}[instruments]\nsame_plates = true\n", encoding="utf-8")
    check_plates(read_subject(path))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["walk.c3d"], "expected a subject file"),
        (["subject.toml", "-o", "."], "a folder; give the name of a file"),
        (["subject.toml", "-o", "nowhere/x.toml"], "no such folder"),
        (["subject.toml", "-o", "subject.toml"], "not a file that kinertia instruments wrote"),
    ],
)
def test_what_cannot_be_is_refused_first(arguments, words, c3d_lab, monkeypatch):
    monkeypatch.chdir(c3d_lab)
    outcome = run("instruments", *arguments)
    assert outcome.status == 2
    assert words in outcome.err
