"""Assembles the page of one person: files, subject, findings of the check, results, letter, comparisons."""

import os
import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from starlette.requests import Request
from starlette.responses import HTMLResponse

from kinertia.cli.learning import norms_text
from kinertia.cli.web.entries import USE, entries, fields, label_of, marker_set_field, trouble
from kinertia.cli.web.file_table import file_table
from kinertia.cli.web.jobs import KINDS, Job, Jobs
from kinertia.cli.web.library import LIMITS, Library, PersonFolder
from kinertia.cli.web.remedies import Button, applied
from kinertia.cli.web.responses import page, time_left
from kinertia.cli.web.rows import CONDITION, END, START, conditions, trial_fields
from kinertia.cli.web.rows import rows as rows_of
from kinertia.errors import KinertiaError
from kinertia.estimation.result.mean_cycles import Control, band_columns, profiles_by_task
from kinertia.io.norms_file import read_norms
from kinertia.io.output_folder import write_then_rename
from kinertia.model.marker_set import SEGMENTS
from kinertia.report.comparison.side_by_side import render_comparison
from kinertia.report.comparison.what_changed import compared_sessions
from kinertia.report.exports.saved_fit import load_fit, read_saved
from kinertia.report.pages.finding_view import LOOKS
from kinertia.report.pages.page import render

_ENDED = {
    "cancelled": "Cancelled.",
    "interrupted": "Interrupted: Kinertia was closed before it was done. Start it again.",
}
_PREPARING = "preparing this computer for its first estimate"


@dataclass(frozen=True)
class Standing:
    """One person in the list.

    Attributes:
        name: name of the person.
        look: "info", "warning" or "error" by the verdict on the results; empty without.
        sentence: state of check and fit, in words.
        when: time of the last change.
        fitted: whether there are results.
    """

    name: str
    look: str
    sentence: str
    when: str
    fitted: bool


def standing(person: PersonFolder, jobs: Jobs) -> Standing:
    """Return the state of a person's check and fit."""
    outcome = person.outcome("results") if person.fitted else {}
    sentence, notes = outcome.get("line", ""), person.notes()
    job = jobs.of(person, "fit") or jobs.of(person, "check")
    if job is not None:
        what = "Fit" if job.kind == "fit" else "Check"
        sentence = f"{what}: {_stage(job, jobs)}"
    elif not sentence:
        how = notes.get("fit", {})
        sentence = "No results yet."
        if how:
            sentence = _ENDED.get(how.get("how", ""), how.get("message", sentence))
    when = time.strftime("%Y-%m-%d %H:%M", time.localtime(outcome.get("ended", person.changed())))
    return Standing(person.name, LOOKS.get(outcome.get("verdict", ""), ""), sentence, when, person.fitted)


def progress(person: PersonFolder, jobs: Jobs) -> dict[str, Any]:
    """Return the progress of the person's check and fit; null for those neither waiting nor running."""
    far: dict[str, Any] = {}
    preparing = jobs.preparing
    for kind in KINDS:
        job = jobs.of(person, kind)
        far[kind] = None if job is None else {"stage": _stage(job, jobs), "share": job.share, "left": time_left(job)}
        if job is not None and kind == "fit" and preparing is not None:
            far[kind] = {"stage": _PREPARING, "share": preparing.share, "left": time_left(preparing)}
    return far


def _stage(job: Job, jobs: Jobs) -> str:
    if job.kind == "fit" and jobs.preparing is not None:
        return _PREPARING
    before = jobs.place(job)
    if job.stage or not before:
        return job.stage or "starting"
    return f"waiting for {before} other{'s' if before > 1 else ''}"


def person_page(
    request: Request,
    person: PersonFolder,
    jobs: Jobs,
    problem: str = "",
    typed: Mapping[str, str] | None = None,
    said: str = "",
    text_typed: str = "",
) -> HTMLResponse:
    """Render the page of one person.

    Args:
        request: the request.
        person: the person.
        jobs: jobs waiting or running.
        problem: error in what was just typed, which is shown again.
        typed: fields of the form as typed.
        said: message on what was just done.
        text_typed: text of the subject file as typed.
    """
    content: Mapping[str, Any] = {}
    broken = ""
    try:
        content = entries(person)
    except KinertiaError as error:
        broken = str(error)
    rows = file_table(person.files(), dict(content))
    notes = person.notes()
    found = trouble(person) if person.subject.is_file() else notes.get("draft", "")
    return page(
        request,
        "person.html.j2",
        422 if problem else 200,
        person=person,
        rows=rows,
        use=USE,
        keys={"condition": CONDITION, "start": START, "end": END},
        trial_fields=trial_fields(dict(content), [row.name for row in rows], typed or {}),
        conditions=conditions(dict(content)),
        applied=applied(person, dict(content)),
        uses={row.name: (typed or {}).get(USE + row.name, row.use) for row in rows},
        fields=fields(dict(content), typed),
        marker_set=marker_set_field(dict(content), typed),
        more={table.kind: table for table in rows_of(dict(content), typed)},
        segments=SEGMENTS,
        text=person.subject.read_text(encoding="utf-8", errors="replace") if person.subject.is_file() else "",
        text_typed=text_typed,
        broken=broken,
        problem=problem,
        typed=bool(typed),
        trouble=found,
        explained=explained(person, found),
        draft=notes.get("draft", "") if person.files() else "",
        said=said,
        saved=notes.get("saved", False),
        jobs=progress(person, jobs),
        ended={kind: _how(notes, kind) for kind in KINDS},
        **_outcomes(person),
        looks=LOOKS,
        limits=LIMITS,
    )


def _outcomes(person: PersonFolder) -> dict[str, Any]:
    """Collect everything that the template shows of the last check, fit and comparison; old: of other files."""
    checked, results = (_known(person.outcome(kind)) for kind in ("check", "results"))
    fitted = results if person.fitted else {}
    pages = {"results/report.html": fitted, "check/check.html": checked}
    latest = [(page, outcome) for page, outcome in pages.items() if outcome and outcome.get("inputs") == person.inputs]
    return {
        "latest": {"purposes": [], "steps": [], **_with_buttons(latest[0][1]), "page": latest[0][0]} if latest else {},
        "compared": person.outcome("comparison"),
        "check": checked,
        "check_page": (person.check / "check.html").is_file(),
        "check_old": bool(checked) and checked.get("inputs") != person.inputs,
        "results": fitted,
        "fitted": person.fitted,
        "results_old": bool(results) and results.get("inputs") != person.inputs,
        "result_files": _result_files(person),
    }


def _with_buttons(outcome: Mapping[str, Any]) -> dict[str, Any]:
    """Return an outcome whose findings have buttons; those after the steps that come first are `others`."""
    shown = {
        kind: [
            {**finding, "buttons": [Button.of(setting) for setting in finding.get("settings", [])]}
            for finding in outcome[kind]
        ]
        for kind in ("steps", "findings")
    }
    return {
        **outcome,
        "steps": shown["steps"],
        "others": [finding for finding in shown["findings"] if finding not in shown["steps"]],
    }


def _how(notes: Mapping[str, Any], kind: str) -> dict[str, str]:
    """Return level and sentence on how the last check or fit ended that left no files."""
    ended = notes.get(kind, {})
    how = ended.get("how", "")
    if how == "failed":
        return {"level": "error", "sentence": ended.get("message", "")}
    return {"level": "warning", "sentence": _ENDED[how]} if how in _ENDED else {}


def _known(outcome: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return an outcome of this version; empty for one without a verdict."""
    return outcome if "verdict" in outcome else {}


def _result_files(person: PersonFolder) -> list[str]:
    if not person.fitted:
        return []
    paths = (path.relative_to(person.results) for path in person.results.rglob("*") if path.is_file())
    return sorted(path.as_posix() for path in paths if not path.name.startswith(".") and path.name != "outcome.json")


_CHOOSE = "choose one in the table above, or add its file"
_PLAIN = (
    (
        re.compile(r"\[\[trial\]\](: there is no such heading| lacks 'markers')"),
        f"No file is used as a walk: {_CHOOSE}.",
    ),
)
_MISSING = re.compile(r"\[subject\] lacks '(\w+)'")


class Explanation(NamedTuple):
    """A problem in plain words (empty where the exact text is plain enough), and as the command line reports it."""

    plain: str
    exact: str


def explained(person: PersonFolder, trouble: str) -> Explanation:
    """Explain the problem with a person's subject file, which is stated without its folder."""
    exact = trouble.replace(f"{person.folder}{os.sep}", "")
    if missing := _MISSING.search(exact):
        return Explanation(f"{label_of(missing[1])} is missing: fill it in, then save and check.", exact)
    return Explanation(next((plain for pattern, plain in _PLAIN if pattern.search(exact)), ""), exact)


def letter(person: PersonFolder, library: Library) -> str:
    """Render the two pages for a patient's file, with the library's norms if it has any."""
    saved = read_saved(person.results)
    norms = read_norms(library.norms) if library.norms.is_file() else {}
    profiles = profiles_by_task(saved.fit, norms)
    return render(saved.fit, saved.provenance, saved.versions, norms, profiles, saved.truth, template="letter")


def people_compared(people: Sequence[PersonFolder], library: Library) -> str:
    """Render what changed between two results, and several side by side."""
    fits = {person.name: load_fit(person.results) for person in people}
    found, reason = compared_sessions(list(fits.values()), norms=library.norms if library.norms.is_file() else None)
    return render_comparison(fits, None if found is None else found.shown(), reason)


def make_norms(people: Sequence[PersonFolder], library: Library) -> None:
    """Write the library's norms from the results of these people, one per control.

    Raises:
        KinertiaError: a person has no strides, two results are of one recording, models differ, or there is one person.
    """
    controls: list[Control] = []
    seen: dict[str, str] = {}
    for person in people:
        saved = read_saved(person.results)
        files = {} if saved.provenance is None else dict.fromkeys(saved.provenance.files.values(), person.name)
        if again := [seen[file] for file in files if file in seen]:
            raise KinertiaError(f"{person.name} and {again[0]} share recordings: choose each control once")
        seen |= files
        controls.append(Control.of(saved.fit))
    write_then_rename(library.norms, norms_text(band_columns(controls)))
