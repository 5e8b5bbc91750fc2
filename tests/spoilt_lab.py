"""Spoiling the files of a laboratory, and what `kinertia fit` must say of it."""

import json
import re
from dataclasses import dataclass
from typing import Any

import pytest

from command_line import run
from kinertia.io.text.trc import read_trc, write_trc

COMMAND = {
    "forces": "walk.mot",
    "loads": "walk.xml",
    "static": "static.trc",
    "mass": "72.6",
    "height": "1.803",
    "sex": "male",
}


@dataclass(frozen=True)
class Refusal:
    """What `kinertia fit` says where it fails: its error lines, and the findings that it gives to scripts."""

    message: str
    findings: list[dict[str, Any]]

    @property
    def blocking(self):
        """Open errors that nothing else explains."""
        return blocking(self.findings)

    @property
    def codes(self):
        """Their codes, each once."""
        return blocking_codes(self.findings)


def blocking(findings):
    """Open errors, in findings as scripts get them, that nothing else explains."""
    return [
        finding
        for finding in findings
        if (finding["severity"], finding["status"], finding["muted_by"]) == ("ERROR", "open", None)
    ]


def blocking_codes(findings):
    """Their codes, each once."""
    return list(dict.fromkeys(finding["code"] for finding in blocking(findings)))


def refused(lab, walk="walk.trc", **changes):
    """Run `kinertia fit` where it must fail. The folder beside the results must stay as it was."""
    options = {**(COMMAND if walk.endswith(".trc") else {"static": "static.c3d", "sex": "male"}), **changes}
    arguments = [walk if walk.startswith("/") else lab / walk]
    for name, value in options.items():
        if value is not None:
            arguments += [f"--{name}", lab / value if name in ("forces", "loads", "static") else value]
    return complaint(lab, *arguments)


def complaint(lab, *arguments):
    outcome = run("fit", *arguments, "-o", lab.parent / "results" / "out", "--json")
    assert outcome.status == 2, outcome
    told = json.loads(outcome.out)
    said = [line for line in outcome.err.splitlines() if line not in ("reading", "calibration", "inverse kinematics")]
    errors = [line for line in said if not line.startswith(("next: ", "then: "))]
    assert all(line.startswith("error: ") for line in errors), outcome.err
    assert [path.name for path in lab.parent.iterdir()] == ["lab"]
    refusal = Refusal("\n".join(errors), told["findings"])
    assert len(errors) == max(1, len(refusal.blocking))
    return refusal


def expect(refusal, *parts):
    """The message of something without a code has these parts."""
    assert not refusal.findings, refusal
    for part in parts:
        assert re.search(part, refusal.message), f"{part!r} is not in {refusal.message!r}"


def expect_found(refusal, code, /, where=None, **evidence):
    """It is refused by findings of this code alone, in this place, with this evidence; texts contain what is given."""
    assert refusal.codes == [code], refusal.message
    for found in refusal.blocking:
        place = {name: found["where"].get(name) for name in where or {}}
        assert place == (where or {}), found
        expect_evidence(found, evidence)
        assert found["message"] in refusal.message
        assert found["remedy"] in refusal.message


def expect_evidence(found, evidence):
    """Numbers of the evidence are these, texts contain these."""
    for name, expected in evidence.items():
        value = found["evidence"][name]["value"]
        if isinstance(expected, str):
            assert re.search(expected, str(value)), (name, value)
        else:
            assert value == pytest.approx(expected, rel=0.01), (name, value)


def spoil(path, change):
    """Rewrite a text file line by line: `change` gets the list of lines and alters it."""
    lines = path.read_text().splitlines()
    change(lines)
    path.write_text("\n".join(lines) + "\n")


def edit_cell(line, column, value):
    def change(lines):
        cells = lines[line - 1].split("\t")
        cells[column] = value
        lines[line - 1] = "\t".join(cells)

    return change


def changed_markers(path, change):
    markers = read_trc(path)
    positions = markers.positions.copy()
    change(positions, markers.labels.index)
    write_trc(path, type(markers)(markers.time, markers.labels, positions))
