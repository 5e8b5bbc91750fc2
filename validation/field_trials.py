"""Judge recordings of other laboratories.

What Kinertia says of recordings of other laboratories, and whether it is as it should be.

What is true of the recordings is in field_cases.toml.
"""

from __future__ import annotations

import contextlib
import io
import json
import shlex
import tempfile
import time
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from kinertia.cli.commands import main as kinertia
from validation.measured_data import data_folder
from validation.measured_trials import messages_of, severe, table, unexplained
from validation.page import write_page
from validation.walks import fit_arguments

CASES = Path(__file__).with_name("field_cases.toml")
FILES = (".trc", ".c3d", ".mot", ".forces", ".xml", ".osim", ".toml")
_OF_RESULT = "R"
"""Codes of a result describe it; those of other families accuse a recording, a person or an instrument."""
_IMPOSSIBLE_POSE = "R305"
_ANYTHING = "*"


@dataclass(frozen=True)
class Case:
    """A recording, its user's command, and the known facts about it (fields as in field_cases.toml)."""

    title: str
    folder: Path
    arguments: tuple[str, ...]
    truth: str
    sound: bool | None
    status: tuple[int, ...]
    expected: tuple[str, ...]
    allowed: tuple[str, ...]
    never: tuple[str, ...]
    draft: str | None

    def against(self, outcome: Outcome) -> str:
        """Describe deviations from the expected outcome; empty where there are none."""
        found = {finding["code"] for finding in unexplained(outcome.content)}
        missing = [codes for codes in self.expected if not found & set(codes.split("|"))]
        accused = {
            finding["code"] for finding in severe(outcome.content) if finding["code"][0] != _OF_RESULT
        } - self._true
        if _ANYTHING in self.allowed:
            accused = set()
        against = [] if outcome.status in self.status else [f"exit status {outcome.status}"]
        against += [f"{' or '.join(codes.split('|'))} missing" for codes in missing]
        against += [f"{code} is false" for code in sorted(accused | found & set(self.never))]
        if outcome.status == 0 and _IMPOSSIBLE_POSE in found:
            against.append("an impossible pose")
        return ", ".join(against)

    @property
    def _true(self) -> set[str]:
        return {code for codes in (*self.expected, *self.allowed) for code in codes.split("|")}


@dataclass(frozen=True)
class Outcome:
    """Outcome of a command.

    Attributes:
        status: exit status.
        tries: number of commands until then.
        seconds: time of the last command.
        content: output of `--json`.
    """

    status: int
    tries: int
    seconds: float
    content: dict[str, Any]

    @property
    def joint_moments(self) -> str:
        """What it says of joint moments: use, use with care, do not use; refused where there is no estimate."""
        said = {rating["output"]: rating["use"] for rating in self.content.get("suitability") or []}
        return said.get("joint moments", "refused")

    def residuals(self) -> str:
        """Format root residuals (N, N m) with the literature's parameters and with the estimate, where there is one."""
        trials = self.content.get("trials") or []
        if len(trials) != 1 or "residual_force_rms_N" not in trials[0]:
            return "-"
        force, moment = trials[0]["residual_force_rms_N"], trials[0]["residual_moment_rms_Nm"]
        return " → ".join(f"{force[key]:.1f}, {moment[key]:.1f}" for key in ("literature", "estimate"))


def cases(data: Path) -> Iterator[Case]:
    """Yield every recording of field_cases.toml."""
    for laboratory in tomllib.loads(CASES.read_text(encoding="utf-8"))["laboratory"]:
        folder = data / laboratory["folder"]
        for recording in laboratory["recording"]:
            if "walk" in recording:
                arguments = fit_arguments(data, recording["walk"])
            else:
                words = shlex.split(f"{recording['files']} {laboratory.get('with', '')}")
                arguments = [str(folder / word) if word.endswith(FILES) else word for word in words]
            yield Case(
                title=f"{laboratory['title']}: {recording['title']}",
                folder=folder,
                arguments=("check" if laboratory.get("check") else "fit", *arguments),
                truth=recording["truth"],
                sound=recording.get("sound"),
                status=tuple(recording["status"]),
                expected=tuple(recording.get("expected", ())),
                allowed=(*laboratory.get("allowed", ()), *recording.get("allowed", ())),
                never=(*laboratory.get("never", ()), *recording.get("never", ())),
                draft=laboratory.get("draft"),
            )


def run(case: Case, out: Path) -> Outcome:
    """Return the outcome of the command, or of the second try, with a drafted marker set."""
    outcome = _outcome([*case.arguments, *(["-o", str(out)] if case.arguments[0] == "fit" else [])], 1)
    if case.draft is None or not {"L101", "L105"} & {finding["code"] for finding in unexplained(outcome.content)}:
        return outcome
    drafted = out.with_suffix(".toml")
    _outcome(["markers", str(case.folder / case.draft), "-o", str(drafted)], 1)
    return _outcome([*case.arguments, "--markers", str(drafted), "-o", str(out)], 2)


def _outcome(arguments: Sequence[str], tries: int) -> Outcome:
    printed, status, started = io.StringIO(), 0, time.perf_counter()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(io.StringIO()):
        try:
            kinertia([*arguments, "--json"])
        except SystemExit as ended:
            status = int(ended.code or 0)
    content = json.loads(printed.getvalue())
    return Outcome(status, tries, time.perf_counter() - started, content[0] if isinstance(content, list) else content)


def document(outcomes: Sequence[tuple[Case, Outcome]]) -> str:
    """Return the text of docs/validation/field-trials.md."""
    rows, messages = [], []
    for case, outcome in outcomes:
        against = case.against(outcome)
        codes = " ".join(dict.fromkeys(finding["code"] for finding in severe(outcome.content))) or "-"
        end = [str(outcome.status), outcome.joint_moments, str(outcome.tries), codes, outcome.residuals()]
        end.append(f"{outcome.seconds:.0f}")
        rows.append([case.title, case.truth, f"no: {against}" if against else "yes", *end])
        messages += [f"- {case.title}: {message}" for message in dict.fromkeys(messages_of(outcome.content))]
    heads = ["recording", "what is true of it", "as it should be", "exit status", "joint moments", "tries"]
    heads += ["findings", "residuals (N, N m), literature → estimate", "s"]
    good = sum(row[2] == "yes" for row in rows)
    return TEXT.format(
        good=good,
        count=len(rows),
        verdicts=verdicts(outcomes),
        results=table(heads, rows),
        messages="\n".join(messages),
    )


def verdicts(outcomes: Sequence[tuple[Case, Outcome]]) -> str:
    """Return how many sound recordings, and how many with a fault, get which verdict on joint moments."""
    said = ("use", "use with care", "do not use", "refused")
    rows = []
    for title, sound in (("nothing known that concerns joint moments", True), ("a fault that concerns them", False)):
        judged = [outcome.joint_moments for case, outcome in outcomes if case.sound is sound]
        rows.append([title, *(f"{judged.count(word)} of {len(judged)}" for word in said)])
    return table(["recordings with", *(f"*{word}*" for word in said)], rows)


TEXT = """# Field trials

What Kinertia says of recordings of other laboratories, files as they were published: {good} of {count} are as they
should be.

*As it should be*: the exit status is right; every fault that is known is named; nobody is accused of one that is not
there; no estimate to use has an impossible pose. *Exit status* 0: an estimate to use, perhaps with care; 1: an
estimate, or a recording, not to be used; 2: refused. *Tries*: 2 where no preset fits, and the marker set of `kinertia
markers` was used as drafted. *Findings* above CORRECTED. *Residuals*: RMS over the frames used, of measured motion with
the literature's body segment parameters, and of the estimate. Seconds are this machine's.

Does the verdict on joint moments separate sound recordings from doubtful ones? Recordings of which nobody can say, and
those that were only checked, are left out.

{verdicts}

{results}

## Findings

{messages}
"""


def main(
    data: Annotated[Path | None, typer.Option(help="Measured data, one laboratory's in each folder.")] = None,
    part: Annotated[str, typer.Option(help="Part of a title: only these are run, and no page is written.")] = "",
) -> None:
    """Run all recordings and write the page."""
    data, outcomes = (data or data_folder()).resolve(), []
    with tempfile.TemporaryDirectory() as folder:
        for k, case in enumerate(candidate for candidate in cases(data) if part in candidate.title):
            outcome = run(case, Path(folder) / str(k))
            outcomes.append((case, outcome))
            against = case.against(outcome) or "yes"
            print(f"{case.title}: {against} (status {outcome.status}, {outcome.seconds:.0f} s)", flush=True)
            for message in messages_of(outcome.content):
                print(f"    {message}", flush=True)
    if not part:
        write_page("field-trials", document(outcomes))
