"""Compare what trials of one session share.

Fits every trial of a session alone and compares what they share.

With `--keep`, results stay in FOLDER/SESSION/TRIAL, and those that are there are not computed again. With `--only`, the
page is printed and not written. `repeatability.py` has what trials share, and how that is judged.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from kinertia.estimation.simultaneous.instruments.instrument_errors import SHOWN_UNIT
from validation.measured_data import data_folder
from validation.measured_trials import table
from validation.page import write_page
from validation.repeatability import Shared, group_sums, shared

MARKER_SET = Path(__file__).resolve().parent / "marker_sets" / "plug-in-gait-sacrum.toml"
CHILDREN = ("HC002D", "HC030A", "HC032A", "HC036A", "HC038A", "HC040A")
CHILD = """[subject]
name = "{child}"
sex = "male"
population = "child"
[model]
static = "{folder}/static.c3d"
markers = "{markers}"
[[trial]]
markers = "{folder}/{trial}.c3d"
"""


@dataclass(frozen=True)
class Session:
    """Trials with the same plates and synchronisation.

    Attributes:
        name, title: name and title of the session.
        folder: folder of the data.
        people: trials of each person.
        options: options of `kinertia fit` besides the trial's files; "" where a subject file states all.
    """

    name: str
    title: str
    folder: str
    people: dict[str, tuple[str, ...]]
    options: str = ""


SESSIONS = (
    Session(
        "subject4",
        "subject4: standing, walks, a drop jump and squats of one person",
        "subject4",
        {"": ("static1", "walking1", "walking2", "walkingTI1", "walkingTO1", "walkingTS1", "DJ1", "squats1")},
        "--model addbiomechanics_scaled.osim --loads {trial}_external_forces.xml --calibrate --mass 62.6",
    ),
    Session(
        "treadmill",
        "Hamner's treadmill: one person running at 2 and 3 m/s",
        "field/hamner_treadmill_run",
        {"": ("run200", "run300")},
        "--model final.osim --calibrate --mass 72.84",
    ),
    Session(
        "children",
        "Six children on the same plates, walking straight and turning",
        "field/biomechzoo",
        dict.fromkeys(CHILDREN, ("straight", "turn")),
    ),
)


@dataclass(frozen=True)
class Outcome:
    """Outcome of one fit.

    Attributes:
        trial: name of the trial.
        folder: folder of the results.
        said: why there are no results, else "".
    """

    trial: str
    folder: Path
    said: str


def arguments(session: Session, person: str, trial: str, data: Path, results: Path) -> list[str]:
    """Return the arguments of `kinertia fit`; writes the subject file where there is one."""
    lab = data / session.folder
    if session.options:
        words = session.options.format(trial=trial).split()
        files = [str(lab / word) if (lab / word).is_file() else word for word in words]
        return [str(lab / f"{trial}.trc"), "--forces", str(lab / f"{trial}_grf.mot"), *files]
    subject = results.with_suffix(".toml")
    text = CHILD.format(child=person, folder=lab / person, markers=MARKER_SET, trial=trial)
    subject.write_text(text, encoding="utf-8")
    return [str(subject)]


def fitted(session: Session, person: str, trial: str, data: Path, keep: Path) -> Outcome:
    """Fit one trial alone by the command, in a separate process; existing results are reused."""
    name = f"{person} {trial}".strip()
    folder = keep / session.name / name.replace(" ", "-")
    ended = folder.with_suffix(".json")
    if not ended.exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        words = ["fit", *arguments(session, person, trial, data, folder), "-o", str(folder), "--quiet"]
        command = [sys.executable, "-m", "kinertia", *words]
        run = subprocess.run(command, capture_output=True, encoding="utf-8", check=False, env=dict(os.environ))
        outcome = {"command": words, "status": run.returncode, "said": run.stdout + run.stderr}
        ended.write_text(json.dumps(outcome, indent=1), encoding="utf-8")
        print(f"{session.name}: {name}: status {run.returncode}", file=sys.stderr, flush=True)
    said = json.loads(ended.read_text(encoding="utf-8"))["said"]
    refused = "" if (folder / "fit.json").exists() else re.sub(r"(?<![\w.])/[^ :]*/", "", " ".join(said.split()))
    return Outcome(name, folder, refused)


def section(session: Session, data: Path, keep: Path) -> str:
    """Return the page's part about one session."""
    people = [
        [fitted(session, person, trial, data, keep) for trial in trials] for person, trials in session.people.items()
    ]
    folders = [[trial.folder for trial in trials if not trial.said] for trials in people]
    parts = [f"## {session.title}"]
    if len(people) > 1:
        parts += [
            "### Each person's trials against each other",
            compared([shared_value for folder in folders for shared_value in shared(folder)]),
        ]
        together = shared(
            [folder for folders_of_person in folders for folder in folders_of_person], instruments_only=True
        )
        parts += ["### The instruments, all people", compared(together)]
    else:
        parts.append(compared(shared(folders[0])))
    refused = [f"- {trial.trial}: {trial.said}" for trials in people for trial in trials if trial.said]
    if refused:
        parts += ["Without results:", "\n".join(refused)]
    return "\n\n".join(parts)


def compared(unknowns: Sequence[Shared]) -> str:
    """Return the table of the groups, and the warnings about instruments."""
    units = {unknown.group: unknown.unit for unknown in unknowns}
    rows = []
    for group, sums in group_sums(unknowns).items():
        row = [group, str(sums.unknowns), f"{sums.mean:.2f}", f"{sums.worst:.2f} ({sums.worst_name})"]
        row += [str(sums.beyond), f"{100 * sums.pairs_apart:.0f} %", _deviation(sums.median_sd, units[group])]
        rows.append(row)
    heads = ["group", "unknowns", "chi2/n, mean", "worst", "beyond 99 %", "pairs apart", "median sd"]
    accused = [(unknown, estimate, wrong) for unknown in unknowns for estimate, wrong in unknown.accusations()]
    contradicted = [
        f"- {estimate.trial}: {shared_value.name}: {_deviation(estimate.value, shared_value.unit)}"
        for shared_value, estimate, wrong in accused
        if wrong
    ]
    said = f"Values that are beyond 1.96 of their prior and of their own deviation: {len(accused)}; "
    said += f"contradicted by the other trials: {len(contradicted)}. "
    warned = [wrong for _, estimate, wrong in accused if estimate.warned]
    said += f"Of them the fits say to check the instrument: {len(warned)}; contradicted: {sum(warned)}."
    return "\n\n".join([table(heads, rows), said, *(["\n".join(contradicted)] if contradicted else [])])


def _deviation(value: float, unit: str) -> str:
    scale, shown = {**SHOWN_UNIT, "kg": (1.0, "kg"), "kg m2": (1.0, "kg m2")}[unit]
    return f"{scale * value:.2g} {shown}"


def document(sections: Sequence[str]) -> str:
    """Return the text of docs/validation/sessions.md."""
    return TEXT.format(sections="\n\n".join(sections))


TEXT = """# Trials of one session

Error bars of measured people can be judged without knowing the truth: trials of one session share plates and
synchronisation, and trials of one person also share the body. Each trial below is fitted alone by `kinertia fit`, and
the estimates of the same unknown are compared.

*chi2/n*: squares about the weighted mean of the trials, each over its variance, divided by the degrees of freedom. All
deviations contain the same prior, so honest ones give at most 1 on average. *Beyond 99 %*: unknowns whose chi2/n is
above the 99 % point for their number of trials. *Pairs apart*: pairs of trials that differ by more than 1.96 deviations
of their difference. *Median sd*: of a single trial, since bars that are long are no success.

{sections}
"""


def main(
    keep: Annotated[Path | None, typer.Option(help="Folder for the results, which are used again.")] = None,
    only: Annotated[str | None, typer.Option(help="One session, printed.")] = None,
) -> None:
    """Write the page, or print the part about one session."""
    with tempfile.TemporaryDirectory() as temporary:
        kept = (keep or Path(temporary)).resolve()
        parts = [section(chosen, data_folder(), kept) for chosen in SESSIONS if only in (None, chosen.name)]
    if only:
        print("\n\n".join(parts))
    else:
        write_page("sessions", document(parts))
