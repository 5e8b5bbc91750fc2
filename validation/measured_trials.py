"""Tell what `kinertia fit` gives on four walks."""

import contextlib
import io
import json
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from kinertia.cli.commands import main as kinertia
from validation.measured_data import data_folder
from validation.page import write_page
from validation.walks import WALKS, fit_arguments

STAGES = ("literature", "corrected", "estimate")


def results(name: str, folder: Path, *more: str) -> dict[str, Any]:
    """Return fit.json of one walk, with the BSP table under "bsp"."""
    # results and warnings are in fit.json: the terminal's tables would only repeat them
    with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
        kinertia(["fit", *fit_arguments(data_folder(), name), *more, "-o", str(folder)])
    return {**json.loads((folder / "fit.json").read_text()), "bsp": pd.read_csv(folder / "bsp.csv")}


def unexplained(run: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return open findings that no other explains, from the output of `--json` or fit.json."""
    return [
        finding for finding in run.get("findings", []) if finding["status"] == "open" and finding["muted_by"] is None
    ]


def severe(run: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the unexplained findings that lower a verdict."""
    return [finding for finding in unexplained(run) if finding["severity"] in ("WARNING", "ERROR")]


def messages_of(run: Mapping[str, Any]) -> list[str]:
    """Return code and message of findings that lower a verdict."""
    return [f"{finding['code']} {finding['message']}" for finding in severe(run)]


def farthest(bsp: pd.DataFrame) -> str:
    """Return the parameter farthest from the literature's, in prior SDs."""
    away = (bsp["estimate"] - bsp["literature"]) / bsp["prior_sd"]
    worst = int(away.abs().argmax())
    return f"{bsp['parameter'].iloc[worst]} of {bsp['segment'].iloc[worst]} {away.iloc[worst]:+.1f}"


def table(headings: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a Markdown table; all columns but the first are right-aligned."""
    headings = list(headings)
    lines = [headings, ["---", *["--:"] * (len(headings) - 1)], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


_PAGE = """# Measured trials

What `kinertia fit` gives on four measured walks, one trial each, with its default settings.

## What was used

Markers: RMS distance between measured and model markers over the frames used, after inverse kinematics and in the
motion that goes with the estimate.

{used}

## Residual at the pelvis

RMS (maximum) over the frames used. *Literature*: literature BSPs on the smoothed motion. *Corrected*: literature BSPs
with pelvis correction. *Estimate*: BSPs, motion and calibration of the simultaneous estimate.

{residuals}

## Total mass

{masses}

## What the estimated body segment parameters are worth

How many of the 120 parameters the walk measures (information above 0.75), informs on (0.25 to 0.75) or leaves assumed;
see [accuracy](accuracy.md) for what the deviations are worth.

{worth}

## Warnings given

{warnings}

## Seconds

On the machine that wrote this page; see [speed](speed.md) for times next to OpenSim's on one machine.

{seconds}
"""


def document(runs: dict[str, dict[str, Any]]) -> str:
    """Return the text of docs/validation/measured-trials.md."""
    trials = {name: run["trials"][0] for name, run in runs.items()}
    used = table(
        ["walk", "frames", "used", "window (s)", "markers, IK (mm)", "markers, estimate (mm)", "converged"],
        (
            [WALKS[name], str(t["n_frames"]), str(t["n_dynamic_frames"]), "{:.2f} to {:.2f}".format(*t["window_s"])]
            + [f"{t['marker_rms_m'][stage] * 1e3:.1f}" for stage in ("ik", "final")]
            + ["yes" if runs[name]["converged"] else "no"]
            for name, t in trials.items()
        ),
    )
    residuals = table(
        ["walk", *STAGES],
        (
            [f"{WALKS[name]}, {kind} ({unit.replace('Nm', 'N m')})"]
            + [
                f"{t[f'residual_{kind}_rms_{unit}'][stage]:.1f} ({t[f'residual_{kind}_max_{unit}'][stage]:.1f})"
                for stage in STAGES
            ]
            for name, t in trials.items()
            for kind, unit in (("force", "N"), ("moment", "Nm"))
        ),
    )
    masses = table(
        ["walk", "scale (kg)", "by mean vertical force (kg)", "literature (kg)", "estimate (kg)"],
        (
            [WALKS[name], *(f"{mass:.1f}" for mass in (
                run["total_mass_kg"]["measured"], trials[name]["mass_from_force_kg"],
                run["total_mass_kg"]["literature"], run["total_mass_kg"]["estimate"],
            ))]
            for name, run in runs.items()
        ),
    )  # fmt: skip
    times = [stage for stage in next(iter(trials.values()))["seconds"]]
    seconds = table(
        ["walk", *times],
        ([WALKS[name], *(f"{t['seconds'][stage]:.2f}" for stage in times)] for name, t in trials.items()),
    )
    warnings = "\n".join(f"- {WALKS[name]}: {message}" for name, run in runs.items() for message in messages_of(run))
    return _PAGE.format(
        used=used,
        residuals=residuals,
        masses=masses,
        worth=_worth(runs),
        warnings=warnings or "None.",
        seconds=seconds,
    )


def _worth(runs: dict[str, dict[str, Any]]) -> str:
    rows = []
    for name, run in runs.items():
        words = run["bsp"]["evidence"].value_counts()
        counts = [str(words.get(word, 0)) for word in ("measured", "informed", "assumed")]
        rows.append([WALKS[name], farthest(run["bsp"]), *counts])
    return table(["walk", "farthest from the literature (prior SDs)", "measured", "informed", "assumed"], rows)


def main() -> None:
    """Fit all walks and write the page."""
    with tempfile.TemporaryDirectory() as folder:
        runs = {name: results(name, Path(folder) / name) for name in WALKS}
    write_page("measured-trials", document(runs))
