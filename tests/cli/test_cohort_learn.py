"""`kinertia cohort --learn`: second fits with what the others teach, of bodies and of a day's instruments."""

import json
import shutil
from dataclasses import replace
from unittest import mock

import numpy as np
import pytest

from cohort_kills import in_this_process
from command_line import run
from kinertia.estimation.prior import literature_prior
from kinertia.io.subject.learnt_files import read_population, read_session
from kinertia.io.subject.provenance import recordings
from kinertia.io.subject.reader import read_subject
from kinertia.report.exports.saved_fit import FIT_FILE, write_fit
from kinertia.workflow.from_files import prepare_subject

NAMES = tuple("ABCDEF")
DAYS = dict(zip(NAMES, ["2026-05-03"] * 3 + ["2026-06-11"] * 2, strict=False))


@pytest.fixture
def study(demo_run, tmp_path):
    """Six people whose recordings differ by empty lines, five of them with the day of the recording."""
    for k, name in enumerate(NAMES):
        folder = tmp_path / "study" / name
        shutil.copytree(demo_run[1] / "lab", folder)
        for path in folder.glob("*.trc"):
            path.write_bytes(path.read_bytes() + b"\n" * (k + 1))
        subject = folder / "subject.toml"
        text = subject.read_text(encoding="utf-8").replace('name = "synthetic walker"', f'name = "{name}"')
        day = f"date = {DAYS[name]}\n" if name in DAYS else ""
        subject.write_text(f"{text}\n[instruments]\nsame_plates = true\n{day}", encoding="utf-8")
    return tmp_path / "study"


@pytest.fixture
def quick(fit):
    """Fits that differ as the data let them, made at once; processes that start at once."""
    rng = np.random.default_rng(0)
    values, vectors = np.linalg.eigh(literature_prior(fit.literature).covariance - fit.posterior.covariance)
    root, asked = vectors * np.sqrt(np.maximum(values, 0.0)), []

    def fitted(wanted):
        asked.append(wanted)
        table = fit.literature.table() + (root @ rng.standard_normal(len(root))).reshape(12, 10)
        estimate = type(fit.estimate).from_table(fit.estimate.segments, table)
        return replace(fit, estimate=estimate, subject=fit.subject.model_copy(update={"name": wanted.subject.name}))

    def saved(content, folder, force):
        write_fit(*content, folder / FIT_FILE)

    with (
        mock.patch("kinertia.cohort.worker.fit_subject", fitted),
        mock.patch("kinertia.cohort.worker.content_of", lambda *given: given),
        mock.patch("kinertia.cohort.worker.save_fit", saved),
        mock.patch("kinertia.cli.cohort.fit_here", in_this_process),
        mock.patch("kinertia.cohort.learning.in_parallel", lambda task, cases, *_: [task(case) for case in cases]),
    ):
        yield asked


@pytest.mark.slow
def test_everybody_is_fitted_again_with_what_the_others_teach(study, quick, tmp_path):
    out = tmp_path / "out"
    outcome = run("cohort", study, "-o", out, "--learn", "--json-lines")
    assert outcome.status in (0, 1), outcome.err
    lines = [json.loads(line) for line in outcome.out.splitlines()]
    assert [line["people"] for line in lines if line["event"] == "end"] == [6, 6]
    people = [line for line in lines if line["event"] == "person"]
    assert sorted(line["person"] for line in people) == sorted(2 * NAMES)
    assert all(line["memory_mb"] > 50 for line in people)
    stages = {line["stage"] for line in lines if line["event"] == "progress"}
    assert {"looking for changes", "people", "tables", "page", "reading results"} <= stages
    (note,) = [line["sentence"] for line in lines if line["event"] == "note"]
    assert note.startswith("1 people without a date")

    first, second = quick[:6], {wanted.subject.name: wanted for wanted in quick[6:]}
    assert all(wanted.prior.population is None for wanted in first)
    for wanted in second.values():
        group = read_population(wanted.prior.population)
        assert not set(group.files) & set(recordings(wanted))
        assert set(group.people) == set(NAMES) - {wanted.subject.name}
    sessions = {name: wanted.instruments.session for name, wanted in second.items()}
    assert [person.name for person in read_session(sessions["D"])] == ["D", "E"]
    assert sessions["A"] == sessions["B"] != sessions["D"]
    assert sessions["F"] is None
    ready = prepare_subject(read_subject(out / "learnt" / "subjects" / "A.toml"))
    sources = [str(finding.evidence["source"].value) for finding in ready.findings if finding.code == "S408"]
    assert any("learnt from 5 people" in source for source in sources)
    assert any("known from 2 people (B, C)" in source for source in sources)

    with mock.patch("kinertia.cohort.learning.read_saved", side_effect=AssertionError("nothing is new")):
        again = run("cohort", study, "-o", out, "--learn")
    assert again.out.count("6 people: 0 to fit, 6 as before") == 2, again.out
    assert "note: 1 people without a date" in again.out
    assert len((out / "resources.csv").read_text(encoding="utf-8").splitlines()) == 7


@pytest.mark.slow
def test_recordings_that_two_have_teach_once(study, quick, tmp_path):
    """One person under two names, with another setting: the priors and the sessions of others count the trials once."""
    twin = study / "A again"
    shutil.copytree(study / "A", twin)
    text = (twin / "subject.toml").read_text(encoding="utf-8").replace('name = "A"', 'name = "A again"')
    (twin / "subject.toml").write_text(f"{text}\n[settings]\ncutoff_hz = 6.0\n", encoding="utf-8")
    outcome = run("cohort", study, "-o", tmp_path / "out", "--learn")
    assert "note: A again: not used for learning, since some of their recordings" in outcome.out, outcome.err
    second = {wanted.subject.name: wanted for wanted in quick[7:]}
    assert [*second] == ["A", "A again", *NAMES[1:]]
    for name, wanted in second.items():
        group = read_population(wanted.prior.population)
        assert len(set(group.files)) == len(group.files)
        assert {"A", "A again"} & set(group.people) == (set() if name.startswith("A") else {"A"})
    assert [person.name for person in read_session(second["B"].instruments.session)] == ["A", "B", "C"]
    assert second["A again"].instruments.session == second["B"].instruments.session


@pytest.mark.slow
def test_where_nothing_can_be_learnt_it_says_why(study, quick, tmp_path):
    for name in NAMES[2:]:
        shutil.rmtree(study / name)
    shutil.rmtree(study / "B")
    outcome = run("cohort", study, "-o", tmp_path / "out", "--learn")
    assert outcome.status == 2
    assert "nothing can be learnt from these people: no prior was learnt: 1 people whose" in outcome.err
    assert (tmp_path / "out" / "cohort.parquet").is_file()
