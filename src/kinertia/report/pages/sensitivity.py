"""Writes the sensitivity study: a page, `sensitivity.md` with a picture, `sensitivity.json`, `sensitivity.csv`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from kinertia.io.results.output_folder import complete_folder
from kinertia.io.versions import VERSION
from kinertia.report.figures.plots import has_matplotlib
from kinertia.report.pages.rendering import Part, drawing, render_parts
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
