"""What Kinertia says of trials from laboratories that nothing was built with: regenerates docs/field-trials.md.

python benchmarks/field_trials.py FOLDER

FOLDER has the measured trials, one laboratory's in each folder.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from kinertia.cli.app import main as kinertia
from kinertia.diagnostics.result.soundness import CONTRADICTION_SD
from measured_trials import farthest, table, told
from walks import WALKS, fit_arguments

DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "field-trials.md"
_LAI_ARNOLD = "LaiArnoldModified2017_poly_withArms_weldHand_scaled.osim"


@dataclass(frozen=True)
class Case:
    """One command: files relative to the data, other options as they are typed."""

    title: str
    folder: str
    markers: str
    files: dict[str, str]
    options: str

    def arguments(self, data: Path) -> list[str]:
        """Of `kinertia fit`."""
        lab = data / self.folder
        named = [word for option, file in self.files.items() for word in (f"--{option}", str(lab / file))]
        return ["fit", str(lab / self.markers), *named, *self.options.split()]


def _subject4(name: str, title: str) -> Case:
    files = {
        "forces": f"{name}_grf.mot",
        "loads": f"{name}_external_forces.xml",
        "model": "addbiomechanics_scaled.osim",
    }
    return Case(f"subject4: {title}, model of AddBiomechanics", "subject4", f"{name}.trc", files, "--mass 60")


_HAMNER = {"forces": "subject02_running_grf.mot", "loads": "External_Loads.xml"}
CASES = (
    Case(
        "Hamner: run at 4 m/s on a treadmill, registered model",
        "field/hamner_run",
        "subject02_running.trc",
        {**_HAMNER, "model": "subject02_registered.osim"},
        "--mass 65.9",
    ),
    Case(
        "Hamner: the same, built-in model",
        "field/hamner_run",
        "subject02_running.trc",
        {**_HAMNER, "static": "subject02_static.trc"},
        "--mass 65.9 --height 1.83 --sex male",
    ),
    Case(
        "Hamner: run at 2 m/s on a treadmill, model of AddBiomechanics",
        "field/hamner_treadmill_run",
        "run200.trc",
        {"forces": "run200_grf.mot", "model": "final.osim"},
        "--mass 72.84",
    ),
    Case(
        "OpenCap, person 5: drop jump, LaiArnold model",
        "field/laiarnold5_jump",
        "DJ1.trc",
        {"forces": "DJ1_forces.mot", "model": _LAI_ARNOLD},
        "--mass 79.4",
    ),
    Case(
        "OpenCap, person 6: walk, LaiArnold model",
        "field/laiarnold6_walk",
        "walking1.trc",
        {"forces": "walking1_forces.mot", "model": _LAI_ARNOLD},
        "--mass 59",
    ),
    Case(
        "Rajagopal: run over plates, built-in model",
        "field/rajagopal_run",
        "motion_capture_run.trc",
        {"forces": "grf_run.mot", "loads": "grf_run.xml", "static": "static_run.trc"},
        "--mass 75.3 --height 1.75 --sex male",
    ),
    _subject4("walking1", "walk"),
    _subject4("walking2", "second walk"),
    _subject4("squats1", "squats"),
)


def commands(data: Path) -> dict[str, list[str]]:
    """Title of every trial -> arguments of the command."""
    fits = {case.title: case.arguments(data) for case in CASES}
    walks = {f"{title}, built-in model": ["fit", *fit_arguments(data, name)] for name, title in WALKS.items()}
    files = sorted((data / "c3d_variety").glob("*.c3d"))
    return {**fits, **walks, **{f"{file.name}": ["check", str(file)] for file in files}}


def run(arguments: list[str], folder: Path) -> dict[str, Any]:
    """Exit status, seconds, last words and, where there is an estimate, fit.json with the BSP table under "bsp"."""
    said, status, started = io.StringIO(), 0, time.perf_counter()
    more = ["-o", str(folder), "--quiet"] if arguments[0] == "fit" else []
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            kinertia([*arguments, *more])
        except SystemExit as ended:
            status = int(ended.code or 0)
    outcome = {"command": arguments[0], "status": status, "seconds": time.perf_counter() - started}
    # a path may be another one tomorrow
    outcome["said"] = re.sub(r"(?<![\w.])/[^ :]*/", "", said.getvalue().strip())
    if (folder / "fit.json").exists():
        outcome |= {"fit": json.loads((folder / "fit.json").read_text()), "bsp": pd.read_csv(folder / "bsp.csv")}
    return outcome


def document(runs: dict[str, dict[str, Any]]) -> str:
    """The text of docs/field-trials.md."""
    rows, warnings, files = [], [], []
    for title, outcome in runs.items():
        begin = [title, str(outcome["status"])]
        if outcome["command"] == "check":
            files.append([*begin, conclusion(outcome["said"])])
            continue
        if "fit" not in outcome:
            rows.append([*begin, *["-"] * 7, f"{outcome['seconds']:.0f}"])
            warnings.append(f"- {title}: {' '.join(outcome['said'].split())}")
            continue
        fit, (trial,) = outcome["fit"], outcome["fit"]["trials"]
        bsp = outcome["bsp"].query("prior_sd > 0")
        beyond = int(((bsp["estimate"] - bsp["literature"]).abs() > CONTRADICTION_SD * bsp["prior_sd"]).sum())
        residuals = [
            f"{trial[key][stage]:.1f}"
            for key in ("residual_force_rms_N", "residual_moment_rms_Nm")
            for stage in ("literature", "estimate")
        ]
        markers = " / ".join(f"{trial['marker_rms_m'][stage] * 1e3:.1f}" for stage in ("ik", "final"))
        rows.append(
            [
                *begin,
                f"{trial['cutoff_hz']:.0f}",
                *residuals,
                markers,
                f"{'yes' if fit['converged'] else 'no'}, {beyond} ({farthest(bsp)})",
                f"{outcome['seconds']:.0f}",
            ]
        )
        warnings += [f"- {title}: {each}" for each in told(fit)]
    heads = ["trial", "exit status", "cutoff before (Hz)"]
    heads += [f"{unit}, {stage}" for unit in ("N", "N m") for stage in ("before", "after")]
    heads += ["markers, before / after (mm)", "converged, parameters beyond 3 sd (farthest)", "s"]
    checked = table(["file", "exit status", "what stands against it"], files)
    return TEXT.format(results=table(heads, rows), warnings="\n".join(warnings), files=checked)


def conclusion(said: str) -> str:
    """What stands against a file by the words of `kinertia check`, on one line."""
    against = [" ".join(line.split()) for line in said.splitlines() if line.startswith(("ERROR ", "error: "))]
    return "; ".join(against).replace("|", "\\|") or "nothing stands against it"


TEXT = """# Field trials

What Kinertia says of recordings from other laboratories: walks, runs, a drop jump and squats, with their own models or
static trials, files as they were published. This page is written by `python benchmarks/field_trials.py FOLDER`; do not
edit it by hand.

Exit status 0: an estimate to use, perhaps with care; 1: an estimate not to be used; 2: refused. *Before*: the model's
or the literature's body segment parameters on the measured motion, both smoothed at the cutoff in the table, as a
colleague would compute them. *After*: motion, parameters and calibration together. RMS over the frames used. Seconds
are this machine's.

{results}

## Warnings given

{warnings}

## Other files

C3D files of other makers, which hold no gait or lack what a fit needs: what `kinertia check` says of each.

{files}
"""


def main() -> None:
    """Write the page."""
    data = Path(sys.argv[1])
    with tempfile.TemporaryDirectory() as folder:
        runs = {}
        for k, (title, arguments) in enumerate(commands(data).items()):
            runs[title] = run(arguments, Path(folder) / str(k))
            print(f"{title}: status {runs[title]['status']}, {runs[title]['seconds']:.0f} s", flush=True)
    DOCUMENT.write_text(document(runs), encoding="utf-8")


if __name__ == "__main__":
    main()
