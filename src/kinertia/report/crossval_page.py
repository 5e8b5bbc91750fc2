"""Writes the results of `kinertia crossval`: rows for the terminal, `crossval.json` and a page."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from kinertia.io.results.output_folder import complete_folder
from kinertia.io.versions import VERSION
from kinertia.report.result_page import Part, render_parts
from kinertia.report.row_figures import dot_figure
from kinertia.studies.cross_validation import Explained, HeldOut

CROSSVAL_HEADINGS = ("held out", "BSPs", "objective", "force (N)", "moment (N m)", "markers (mm)")


def _values(one: Explained) -> tuple[float, ...]:
    return one.objective, one.force_rms_n, one.moment_rms_nm, 1e3 * one.marker_rms_m


def crossval_rows(held_out: Sequence[HeldOut], before: str) -> list[list[str]]:
    """Return two rows per trial under `CROSSVAL_HEADINGS`; `before` is the name of the parameters for comparison."""
    rows = []
    for held in held_out:
        for source, explained in ((before, held.literature), ("others", held.estimate)):
            objective, *rest = _values(explained)
            rows.append([held.trial, source, f"{objective:.0f}", *(f"{value:.1f}" for value in rest)])
    return rows


def crossval_sentence(held_out: Sequence[HeldOut]) -> str:
    """State how many trials are explained better."""
    better = sum(held.estimate.objective < held.literature.objective for held in held_out)
    return f"the BSPs from the other trials explain {better} of {len(held_out)} held-out trials better"


def crossval_summary(held_out: Sequence[HeldOut]) -> dict[str, Any]:
    """Return the content of `crossval.json`."""
    return {"kinertia": VERSION, "held_out": [asdict(held) for held in held_out]}


def render_crossval(held_out: Sequence[HeldOut], before: str) -> str:
    """Render the page of the cross-validation."""
    values = {
        before: [_values(held.literature) for held in held_out],
        "from the other trials": [_values(held.estimate) for held in held_out],
    }
    figure = dot_figure(
        [held.trial for held in held_out],
        {
            title: {name: [row[k] for row in rows] for name, rows in values.items()}
            for k, title in enumerate(CROSSVAL_HEADINGS[2:])
        },
        f"Residuals of each held-out trial with the BSPs of the {before} and with those from the other trials.",
    )
    sentence = crossval_sentence(held_out)
    part = Part(
        "Trials held out",
        (
            f"Motion and calibration were estimated with frozen BSPs: the {before}'s, and those from the other trials. "
            "The objective is half the sum of squared residuals, each divided by its SD: smaller is better.",
        ),
        figure,
        "Force and moment: RMS residual at the pelvis. Markers: RMS distance.",
        headings=CROSSVAL_HEADINGS,
        rows=crossval_rows(held_out, before),
    )
    return render_parts("Do the BSPs hold in other trials?", sentence[0].upper() + sentence[1:] + ".", [part])


def save_crossval(held_out: Sequence[HeldOut], before: str, folder: str | Path) -> Path:
    """Write `crossval.html` and `crossval.json` into a folder and return the folder.

    Raises:
        FileError: the folder cannot be written to.
    """
    with complete_folder(folder, "crossval") as work:
        text = json.dumps(crossval_summary(held_out), indent=2)
        (work / "crossval.json").write_text(text + "\n", encoding="utf-8")
        (work / "crossval.html").write_text(render_crossval(held_out, before), encoding="utf-8")
    return Path(folder)
