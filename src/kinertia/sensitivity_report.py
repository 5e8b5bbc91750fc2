"""The sensitivity study on paper: `sensitivity.json`, `sensitivity.csv`, and a picture."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from kinertia import __version__
from kinertia.io.folder import complete_folder
from kinertia.sensitivity_study import CONDITIONS, KINDS, SHOWN, Sensitivity


def sensitivity_frame(found: Sensitivity) -> pd.DataFrame:
    """One row per parameter, one column per condition: RMS error in prior deviations."""
    return pd.DataFrame({"parameter": found.parameters, **found.errors})


def sensitivity_figure(found: Sensitivity) -> Figure:
    """A map: parameters down, conditions across; dark is measured, white is no better than the literature."""
    figure = Figure(figsize=(9.0, 12.0), layout="constrained")
    axis = figure.subplots()
    values = np.array(list(found.errors.values())).T
    picture = axis.imshow(values, aspect="auto", cmap="cividis", vmin=0.0, vmax=1.0)
    for i, j in np.ndindex(*values.shape):
        shade = "black" if values[i, j] > 0.55 else "white"
        axis.text(j, i, f"{values[i, j]:.2f}", ha="center", va="center", fontsize=6.5, color=shade)
    titles = [CONDITIONS[key].title.replace("skin motion, ", "") for key in found.errors]
    axis.set_xticks(range(len(titles)), titles, rotation=40, ha="right", fontsize=8)
    axis.set_yticks(range(len(found.parameters)), [name.replace("_", " ") for name in found.parameters], fontsize=7)
    for row in range(len(SHOWN), len(found.parameters), len(SHOWN)):
        axis.axhline(row - 0.5, color="white", linewidth=1.5)
    figure.colorbar(picture, ax=axis, shrink=0.4, label="RMS error / prior deviation")
    return figure


def save_sensitivity(found: Sensitivity, folder: str | Path) -> Path:
    """Write the three files into a folder; returns the folder."""
    told = {
        "kinertia": __version__,
        "seed": found.seed,
        "draws": found.draws,
        "small_errors_up_to_twice_the_noise": {kind: found.insensitive(kind) for kind in KINDS},
        "shown_by_no_condition": found.never(),
        "rms_error_over_prior_sd": {
            key: dict(zip(found.parameters, values.tolist(), strict=True)) for key, values in found.errors.items()
        },
    }
    with complete_folder(folder) as work:
        (work / "sensitivity.json").write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
        sensitivity_frame(found).to_csv(work / "sensitivity.csv", index=False, lineterminator="\n")
        sensitivity_figure(found).savefig(work / "sensitivity.png", dpi=110)
    return Path(folder)
