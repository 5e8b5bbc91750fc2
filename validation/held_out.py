"""Explain held-out trials by BSPs of the others."""

import contextlib
import io
import json
import tempfile
from pathlib import Path
from typing import Any

from kinertia.cli.commands import main as kinertia
from validation.measured_data import data_folder
from validation.measured_trials import table
from validation.page import write_page

TRIAL = """
[[trial]]
name = "{name}"
markers = "{markers}.trc"
forces = "{markers}_grf.mot"
loads = "{markers}_{loads}.xml"
"""


def subject_files(data: Path) -> dict[str, str]:
    """Return title -> text of the subject file."""
    gait, other = data / "gait2354", data / "subject4"
    person = '[subject]\nname = "gait2354"\nsex = "male"\nmass_kg = 72.6\nheight_m = 1.803\n'
    static = f'[model]\nstatic = "{gait}/subject01_static.trc"\n'
    whole = f'[subject]\nname = "subject4"\nmass_kg = 60.0\n[model]\nosim = "{other}/addbiomechanics_scaled.osim"\n'
    halves = "".join(
        TRIAL.format(name=name, markers=gait / "subject01_walk1", loads="grf") + f"window_s = {window_s}\n"
        for name, window_s in (("first half", [0.0, 1.25]), ("second half", [1.25, 2.5]))
    )
    trials = "".join(
        TRIAL.format(name=name, markers=other / name, loads="external_forces")
        for name in ("walking1", "squats1", "walking2")
    )
    return {
        "gait2354, one walk in two halves": f"{person}{static}{halves}",
        "subject4, its own OpenSim model, calibrated": f"{whole}calibrate = true\n{trials}",
    }


def held_out(text: str) -> list[dict[str, Any]]:
    """Return the output of `kinertia crossval` for a subject file."""
    with tempfile.TemporaryDirectory() as folder:
        subject, out = Path(folder) / "subject.toml", Path(folder) / "out"
        subject.write_text(text)
        with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
            kinertia(["crossval", str(subject), "-o", str(out)])
        return json.loads((out / "crossval.json").read_text())["held_out"]


def document(people: dict[str, list[dict[str, Any]]]) -> str:
    """Return the text of docs/validation/held-out.md."""
    rows = []
    for title, trials in people.items():
        for trial in trials:
            pairs = [(trial["literature"][key], trial["estimate"][key]) for key in trial["literature"]]
            objective, force, moment, markers = pairs
            rows.append([title, trial["trial"], " -> ".join(f"{value:.0f}" for value in objective)])
            rows[-1] += [" -> ".join(f"{value:.1f}" for value in pair) for pair in (force, moment)]
            rows[-1].append(" -> ".join(f"{1e3 * value:.1f}" for value in markers))
    better = sum(
        t["estimate"]["objective"] < t["literature"]["objective"] for trials in people.values() for t in trials
    )
    headings = ["person", "held out", "objective", "force (N)", "moment (N m)", "markers (mm)"]
    return f"""# Held-out trials

Small residuals on the fitted trial prove nothing. `kinertia crossval` holds every trial out in turn:
BSPs are estimated from the others and frozen; on the trial held out, motion and calibration are estimated again, once
with these BSPs and once with the literature's (or the model's own). Objective: half the sum of squares, each over its
deviation; residuals and marker distances are RMS. Left of the arrow the literature's BSPs, right of it those from the
other trials.

{table(headings, rows)}

The BSPs from the other trials explain {better} of {len(rows)} trials better than the literature's.
"""


def main() -> None:
    """Hold out trials and write the page."""
    people = {title: held_out(text) for title, text in subject_files(data_folder()).items()}
    write_page("held-out", document(people))
