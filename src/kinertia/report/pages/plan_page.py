"""Writes the results of `kinertia plan` and `kinertia crossval`: rows for the terminal, files and a page."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from kinertia.io.results.output_folder import complete_folder
from kinertia.io.versions import VERSION
from kinertia.report.figures.figure import bar_figure, dot_figure
from kinertia.report.pages.rendering import Part, render_parts
from kinertia.studies.cross_validation import Explained, HeldOut
from kinertia.studies.plan import Plan

PLAN_HEADINGS = ("recorded", "measured", "informed", "assumed", "mass", "CoM", "Ixx Iyy Izz")
PLAN_CAPTION = (
    "How many parameters each recording would inform well (measured), partly (informed) and not at all (assumed: the "
    "literature's), and the error bars as a share of the literature's, mean by class. Below the single recordings: "
    "the best sets of two and three."
)
_CLASSES = {"mass": slice(0, 1), "CoM": slice(1, 4), "Ixx Iyy Izz": slice(4, 7)}
CROSSVAL_HEADINGS = ("held out", "BSPs", "objective", "force (N)", "moment (N m)", "markers (mm)")


def _shares(planned: Plan, names: tuple[str, ...]) -> dict[str, float]:
    """Return SDs as a share of the literature's, mean by class."""
    ratio = planned.sd[names] / planned.prior_sd
    return {what: float(ratio[:, columns].mean()) for what, columns in _CLASSES.items()}


def plan_rows(planned: Plan) -> list[list[str]]:
    """Return one row per recording or set of recordings, under `PLAN_HEADINGS`."""
    return [
        [
            " + ".join(names),
            *(str(count) for count in planned.counts(names).values()),
            *(f"{share:.2f}" for share in _shares(planned, names).values()),
        ]
        for names in planned.sd
    ]


def plan_summary(planned: Plan) -> dict[str, Any]:
    """Return the content of `plan.json`."""
    return {
        "kinertia": VERSION,
        "recordings": {" + ".join(names): planned.counts(names) for names in planned.sd},
        "sd_over_literature": {" + ".join(names): _shares(planned, names) for names in planned.sd},
    }


def render_plan(planned: Plan) -> str:
    """Render the page of the plan."""
    names = [" + ".join(chosen) for chosen in planned.sd]
    counts = [planned.counts(chosen) for chosen in planned.sd]
    words = {"measured": "measured", "informed": "informed", "assumed": "assumed (the literature's)"}
    bars = bar_figure(
        names,
        {title: [one[word] for one in counts] for word, title in words.items()},
        "How many parameters each recording would inform well, partly and not at all.",
        "body segment parameters",
    )
    shares = [_shares(planned, chosen) for chosen in planned.sd]
    dots = dot_figure(
        names,
        {what: {"error bar as a share of the literature's": [one[what] for one in shares]} for what in _CLASSES},
        "Predicted error bars over those of the literature, mean by class, for each recording.",
    )
    parts = [
        Part("What each recording would show", (PLAN_CAPTION,), bars, headings=PLAN_HEADINGS, rows=plan_rows(planned)),
        Part(
            "Error bars",
            ("1 is no better than the literature; 0.5 halves its error bar.",),
            dots,
            "The predicted error bar of every single parameter is in plan.csv.",
        ),
    ]
    return render_parts("What to record", "Predicted from the motions alone; nothing was estimated.", parts)


def save_plan(planned: Plan, folder: str | Path) -> Path:
    """Write `plan.html`, `plan.csv` and `plan.json` into a folder and return the folder.

    Raises:
        FileError: the folder cannot be written to.
    """
    with complete_folder(folder, "plan") as work:
        planned.table.to_csv(work / "plan.csv", index=False, lineterminator="\n")
        text = json.dumps(plan_summary(planned), indent=2)
        (work / "plan.json").write_text(text + "\n", encoding="utf-8")
        (work / "plan.html").write_text(render_plan(planned), encoding="utf-8")
    return Path(folder)


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
