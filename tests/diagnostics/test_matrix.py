"""Every code of the catalogue: asserted by a test, silent on fault-free walks, and muted by what explains it.

That the program makes each of them while tests run, with all that its sentences need, is held by `made_codes`; that
`check` and `fit` find the same, by `test_screening`.
"""

import ast
import re
from dataclasses import replace
from pathlib import Path

import pytest

from kinertia.diagnostics.runner import blocking, explained
from kinertia.findings.finding import Severity, finding
from kinertia.findings.quantity import Where
from kinertia.findings.rule import all_rules, matching
from kinertia.trial.data import Markers
from kinertia.workflow.check import check_recording
from recordings import RUNS, WALKS

TESTS = Path(__file__).parents[1]
RULES = all_rules()
ABOUT_CODES = ("findings", "report", "repository")
"""Tests of how findings are shown: that a code is in them says nothing about who finds it."""
PEOPLE = {
    "synthetic": (72.6, 1.803),
    "synthetic c3d": (72.6, 1.803),
    "gait2354": (72.6, 1.803),
    "rajagopal": (85.0, 1.83),
    "plug-in gait a": (40.0, 1.61),
    "plug-in gait b": (46.1, 1.505),
}
"""Masses by the plates (kg), and statures (m)."""
TRUE = {"gait2354": {"P266"}, "plug-in gait b": {"P272", "P282"}}
"""What is true of a walk: a vertical moment that the fit corrects; a foot over the edge of a plate, and its stance."""


def codes_in(path):
    """Codes in the texts of a module."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    texts = [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    return {code for text in texts for code in re.findall(r"\b[FMLPTSOR]\d{3}\b", text)}


def test_every_code_is_asserted_by_a_test():
    tests = [path for path in TESTS.rglob("test_*.py") if path.relative_to(TESTS).parts[0] not in ABOUT_CODES]
    paths = [*tests, *TESTS.glob("*_limits.py")]  # cases of `test_limits`
    asserted = set().union(*(codes_in(path) for path in paths if path != Path(__file__)))
    assert sorted(RULES.keys() - asserted) == []


@pytest.mark.parametrize("name", WALKS)
def test_every_code_is_silent_on_a_fault_free_walk(recording_of, name):
    mass_kg, height_m = PEOPLE[name]
    found = check_recording(recording_of(*WALKS[name]), mass_kg=mass_kg, height_m=height_m).findings
    assert {reported.code for reported in found if reported.severity > Severity.CORRECTED} == TRUE.get(name, set())


@pytest.mark.parametrize("name", sorted(WALKS.keys() & {"synthetic", "gait2354"}))
@pytest.mark.parametrize("share", [0.35, 0.6])
def test_one_repeated_frame_is_no_other_fault(recording_of, name, share):
    """A swinging foot seemed to stand in it, so that 14 of 45 such frames made an ERROR of the sampling rates."""
    recording, (mass_kg, height_m) = recording_of(*WALKS[name]), PEOPLE[name]
    places = recording.markers.positions.copy()
    frame = int(share * len(places))
    places[frame] = places[frame - 1]
    copied = replace(recording, markers=replace(recording.markers, positions=places))
    found = check_recording(copied, mass_kg=mass_kg, height_m=height_m).findings
    grave = {reported.code for reported in found if reported.is_open and reported.severity > Severity.CORRECTED}
    assert grave == TRUE.get(name, set()) | {"M122"}


@pytest.mark.parametrize(
    ("name", "step"), [(name, step) for name, step in (("rajagopal", 4), ("hamner", 3)) if name in RUNS]
)
def test_a_run_with_few_frames_a_second_is_no_fault_of_the_rates(recording_of, name, step):
    """At 25 and 20 Hz feet stand for 4 frames, and a frame less is a quarter of that."""
    recording = recording_of(*RUNS[name])
    markers = recording.markers
    few = Markers(markers.time[::step], markers.labels, markers.positions[::step])
    found = check_recording(replace(recording, markers=few)).findings
    assert not [reported.code for reported in found if reported.is_open and reported.severity is Severity.ERROR]


@pytest.mark.parametrize("code", [code for code, entry in RULES.items() if entry.supersedes])
def test_a_cause_mutes_what_it_explains_where_it_was_found(code):
    """And takes over its severity; elsewhere it says nothing of it."""
    for other in sorted({consequence for entry in RULES[code].supersedes for consequence in matching(entry)}):
        here, there = Where(trial="walk", plate="left"), Where(trial="run", plate="left")
        cause, muted, apart = explained(
            [finding(code, here), finding(other, here, Severity.ERROR), finding(other, there)]
        )
        assert (cause.muted_by, muted.muted_by, apart.muted_by) == (None, code, None), other
        assert cause.severity is Severity.ERROR, other
        assert cause in blocking([cause, muted]), other
