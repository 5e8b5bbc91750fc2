"""`kinertia population`: from people's results to a file that the fits of others start from."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from command_line import run
from kinertia.estimation.learnt_prior import information_of
from kinertia.estimation.prior import literature_prior
from kinertia.io.subject.provenance import Provenance, command_line, recordings
from kinertia.io.subject.reader import read_subject
from kinertia.report.exports.saved_fit import FIT_FILE, write_fit
from kinertia.workflow.from_files import prepare_subject
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
    sources = [str(one.evidence["source"].value) for one in grouped.findings if one.code == "S408"]
    assert any("learnt from 5 people" in source for source in sources)
    assert np.all(grouped.prior.sd <= 1.01 * np.sqrt(1.5) * plain.prior.sd)
    assert grouped.prior.sd.min() > 0
    own = recordings(read_subject(subject))[0]
    with_own = (tmp_path / "population.toml").read_text(encoding="utf-8").replace("hash2", own)
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
