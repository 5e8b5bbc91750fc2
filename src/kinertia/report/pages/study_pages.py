"""Writes the results of studies: of `kinertia plan` and `crossval`, and of the sensitivity study."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from kinertia.io.output_folder import complete_folder
from kinertia.io.versions import VERSION
from kinertia.report.figures.figure import bar_figure, dot_figure
from kinertia.report.figures.plots import has_matplotlib
from kinertia.report.pages.rendering import Part, drawing, render_parts
from kinertia.studies.cross_validation import Explained, HeldOut
from kinertia.studies.plan import Plan
from kinertia.studies.sensitivity import (
    AMPLITUDES,
    CONDITIONS,
    INSENSITIVE,
    KINDS,
    SHOWN,
    STRIDES,
    WITH_SQUATS,
    Sensitivity,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


PLAN_HEADINGS = ("recorded", "measured", "informed", "assumed", "mass", "CoM", "Ixx Iyy Izz")
PLAN_CAPTION = (
    "How many parameters each recording would inform well (measured), partly (informed) and not at all (assumed: the "
    "literature's), and the error bars as a share of the literature's, mean by class. Below the single recordings: "
    "the best sets of two and three."
)
_CLASSES = {"mass": slice(0, 1), "CoM": slice(1, 4), "Ixx Iyy Izz": slice(4, 7)}
CROSSVAL_HEADINGS = ("held out", "BSPs", "objective", "force (N)", "moment (N m)", "markers (mm)")


def sensitivity_frame(sensitivity: Sensitivity) -> pd.DataFrame:
    """Return one row per parameter and one column per condition: RMS error over the literature's."""
    return pd.DataFrame({"parameter": sensitivity.parameters, **sensitivity.errors})


def sensitivity_figure(sensitivity: Sensitivity) -> Figure:
    """Draw a map, parameters down and conditions across; dark is measured, white is no better than the literature."""
    from matplotlib.figure import Figure  # half a second, which the other studies need not wait

    figure = Figure(figsize=(9.0, 12.0), layout="constrained")
    axis = figure.subplots()
    values = np.array(list(sensitivity.errors.values())).T
    picture = axis.imshow(values, aspect="auto", cmap="cividis", vmin=0.0, vmax=1.0)
    for i, j in np.ndindex(*values.shape):
        shade = "black" if values[i, j] > 0.55 else "white"
        axis.text(j, i, f"{values[i, j]:.2f}", ha="center", va="center", fontsize=6.5, color=shade)
    titles = [CONDITIONS[key].title.replace("skin motion, ", "") for key in sensitivity.errors]
    axis.set_xticks(range(len(titles)), titles, rotation=40, ha="right", fontsize=8)
    axis.set_yticks(
        range(len(sensitivity.parameters)), [name.replace("_", " ") for name in sensitivity.parameters], fontsize=7
    )
    for row in range(len(SHOWN), len(sensitivity.parameters), len(SHOWN)):
        axis.axhline(row - 0.5, color="white", linewidth=1.5)
    figure.colorbar(picture, ax=axis, shrink=0.4, label="RMS error relative to the literature")
    return figure


_COLUMNS = ("study x 0.25", "study x 1", "study x 2", "artefact x 0.25", "artefact x 1", "artefact x 2")
_PAGE = """# Which body segment parameters survive noisy kinematics?

The study that Kinertia starts from ended on this question. `kinertia study sensitivity` answers it for the simultaneous
estimate: {draws} people drawn from the literature's prior walk two strides (2.5 s), are measured with noise, and are
estimated, one thing changed at a time. Numbers are RMS errors over people as a share of the literature's on the same
people: 1 is no better than the literature, below 0.5 an error counts as small. Left and right count as one. With so
many people a share is known to some {percent:.0f} % of its value. The command writes this page.

**Not highly sensitive** (small error up to twice the noise)

- with the study's noise (8.2 mm RMS at twice): {study}
- with skin motion linear in the joint angles (up to 36 mm on the thigh at twice): {artefact}

**Sensitive** (small error at a quarter of either noise, not at twice): {sensitive}

**Shown by no condition** (error above 0.9 whatever is recorded here): {never} of {count} parameters ({never_classes}).
These keep the literature's values, as their error bars show.

**Recording more**, mean over all {count} parameters, skin motion: {strides}.

## Conditions and parameters

{table}
{picture}"""
_PICTURE = """
![RMS error of every parameter in every condition, relative to the literature](sensitivity.png)
"""


def sensitivity_markdown(sensitivity: Sensitivity) -> str:
    """Summarise the answer on one page of Markdown."""
    heads, rows = ["parameter", *_COLUMNS], sensitivity_rows(sensitivity)
    return _PAGE.format(
        picture=_PICTURE if has_matplotlib() else "",
        table="\n".join(f"| {' | '.join(cells)} |" for cells in (heads, ["---", *["--:"] * len(_COLUMNS)], *rows)),
        **_answers(sensitivity),
    )


def sensitivity_rows(sensitivity: Sensitivity) -> list[list[str]]:
    """Return one row per parameter: RMS error over the literature's by kind and amplitude of the noise."""
    return [
        [name, *(f"{sensitivity.errors[key][i]:.2f}" for key in _COLUMNS)]
        for i, name in enumerate(sensitivity.parameters)
    ]


def render_sensitivity(sensitivity: Sensitivity) -> str:
    """Render the page of the sensitivity study."""
    answers = _answers(sensitivity)
    answer = [
        f"Not highly sensitive (small error up to twice the noise), with the study's noise: {answers['study']}.",
        f"Not highly sensitive, with skin motion linear in the joint angles: {answers['artefact']}.",
        f"Sensitive (small error at a quarter of either noise, not at twice): {answers['sensitive']}.",
        f"Shown by no condition: {answers['never']} of {answers['count']} parameters ({answers['never_classes']}). For "
        "these the literature's value stands; their error bars say so.",
        f"Recording more, mean over all parameters, skin motion: {answers['strides']}.",
    ]
    shares = "RMS errors as a share of the literature's on the same people: 1 is no better than the literature."
    parts = [
        Part(
            "The answer",
            (shares,),
            listed=answer,
            picture=drawing(sensitivity_figure(sensitivity)) if has_matplotlib() else "",
            caption="Parameters down, conditions across.",
            alt="Map of the errors of every parameter in every condition; the numbers are in sensitivity.csv.",
        ),
        Part("Parameters", headings=("parameter", *_COLUMNS), rows=sensitivity_rows(sensitivity)),
    ]
    lead = f"{sensitivity.draws} people in each condition, seed {sensitivity.seed}."
    return render_parts("Which body segment parameters survive noisy kinematics?", lead, parts)


def _answers(sensitivity: Sensitivity) -> dict[str, Any]:
    """Return the sentences of the page."""
    quarter, twice = (
        np.max([sensitivity.errors[f"{kind} x {amplitude:g}"] for kind in KINDS], axis=0)
        for amplitude in (AMPLITUDES[0], AMPLITUDES[-1])
    )
    sensitive = [sensitivity.parameters[i] for i in np.flatnonzero((quarter < INSENSITIVE) & (twice >= INSENSITIVE))]
    never = sensitivity.never()
    by_class = {
        what: sum(name.rpartition(".")[2] in members for name in never)
        for what, members in (("masses", SHOWN[:1]), ("CoM coordinates", SHOWN[1:4]), ("moments of inertia", SHOWN[4:]))
    }
    strides = [f"strides {count}: {sensitivity.errors[_of_strides(count)].mean():.2f}" for count in STRIDES]
    return {
        "draws": sensitivity.draws,
        "percent": 100.0 / np.sqrt(2.0 * sensitivity.draws),
        "count": len(sensitivity.parameters),
        "study": ", ".join(sensitivity.insensitive("study")) or "none",
        "artefact": ", ".join(sensitivity.insensitive("artefact")) or "none",
        "sensitive": ", ".join(sensitive) or "none",
        "never": len(never),
        "never_classes": ", ".join(f"{what}: {count}" for what, count in by_class.items() if count),
        "strides": "; ".join([*strides, f"{WITH_SQUATS}: {sensitivity.errors[WITH_SQUATS].mean():.2f}"]),
    }


def _of_strides(count: int) -> str:
    return f"strides {count}" if f"strides {count}" in CONDITIONS else "artefact x 1"


def save_sensitivity(sensitivity: Sensitivity, folder: str | Path) -> Path:
    """Write the files into a folder and return the folder."""
    with complete_folder(folder, "sensitivity") as work:
        text = json.dumps(sensitivity_summary(sensitivity), indent=1)
        (work / "sensitivity.json").write_text(text + "\n", encoding="utf-8")
        (work / "sensitivity.md").write_text(sensitivity_markdown(sensitivity), encoding="utf-8")
        (work / "sensitivity.html").write_text(render_sensitivity(sensitivity), encoding="utf-8")
        sensitivity_frame(sensitivity).to_csv(work / "sensitivity.csv", index=False, lineterminator="\n")
        if has_matplotlib():
            sensitivity_figure(sensitivity).savefig(work / "sensitivity.png", dpi=110)
    return Path(folder)


def sensitivity_summary(sensitivity: Sensitivity) -> dict[str, Any]:
    """Return the content of `sensitivity.json`."""
    return {
        "kinertia": VERSION,
        "seed": sensitivity.seed,
        "draws": sensitivity.draws,
        "small_errors_up_to_twice_the_noise": {kind: sensitivity.insensitive(kind) for kind in KINDS},
        "shown_by_no_condition": sensitivity.never(),
        "rms_error_over_literature": {
            key: dict(zip(sensitivity.parameters, values.tolist(), strict=True))
            for key, values in sensitivity.errors.items()
        },
    }


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
        {title: [counted[word] for counted in counts] for word, title in words.items()},
        "How many parameters each recording would inform well, partly and not at all.",
        "body segment parameters",
    )
    shares = [_shares(planned, chosen) for chosen in planned.sd]
    dots = dot_figure(
        names,
        {
            what: {"error bar as a share of the literature's": [by_class[what] for by_class in shares]}
            for what in _CLASSES
        },
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


def _values(explained: Explained) -> tuple[float, ...]:
    return explained.objective, explained.force_rms_n, explained.moment_rms_nm, 1e3 * explained.marker_rms_m


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
