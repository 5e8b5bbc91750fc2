"""The accuracy study on paper and screen: `accuracy.json`, `accuracy.md`, and rows for the terminal."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from kinertia.io.output_folder import complete_folder
from kinertia.io.provenance import VERSION
from kinertia.studies.accuracy import ClassAccuracy, ScenarioAccuracy

HEADINGS = ("", "95 % cover", "error / sd", "RMS error", "bound", "literature", "better (at best)")
_SHOWN = {
    "mass": (1.0, "kg", ".2f"),
    "CoM": (1e3, "mm", ".1f"),
    "moments of inertia": (1.0, "kg m2", ".4f"),
    "products of inertia": (1.0, "kg m2", ".4f"),
}


def accuracy_rows(scenario: ScenarioAccuracy) -> list[list[str]]:
    """One row per class of parameters, under `HEADINGS`."""
    rows = []
    for name, found in scenario.classes.items():
        factor, unit, form = _SHOWN.get(name, (1.0, "prior sd", ".2f"))
        errors = (f"{factor * value:{form}}" for value in (found.rms, found.bound, found.rms_literature))
        cover = f"{100 * found.cover:.1f} ± {100 * found.cover_sd:.1f} %"
        rows.append([f"{name} ({unit})", cover, f"{found.ratio:.2f}", *errors, _better(found)])
    return rows


def _better(found: ClassAccuracy) -> str:
    told = f"{100 * found.better:.0f} %"
    return told if np.isnan(found.attainable) else f"{told} ({100 * found.attainable:.0f} %)"


def angles_sentence(scenario: ScenarioAccuracy) -> str:
    """How far joint angles are off."""
    whole, changes = np.degrees(scenario.angles_rad), np.degrees(scenario.angle_changes_rad)
    return (
        f"Joint angles, RMS error: {whole[0]:.2f} degrees by inverse kinematics, {whole[1]:.2f} by the estimate; "
        f"without each angle's constant error {changes[0]:.2f} and {changes[1]:.2f}."
    )


def moments_sentence(scenario: ScenarioAccuracy) -> str:
    """How far joint moments are off, and how far their deviations say."""
    told = [
        f"{joint} {found.rms_nm:.1f} / {found.sd_nm:.1f} ({100 * found.cover:.0f} %)"
        for joint, found in scenario.moments.items()
    ]
    return f"Joint moments, RMS error / RMS deviation in N m (95 % cover): {', '.join(told)}."


def accuracy_markdown(found: Mapping[str, ScenarioAccuracy]) -> str:
    """A table per scenario."""
    parts = []
    for scenario in found.values():
        lines = [f"| {' | '.join(cells)} |" for cells in (HEADINGS, _rule(HEADINGS), *accuracy_rows(scenario))]
        title = scenario.title[0].upper() + scenario.title[1:]
        parts.append(
            "\n".join([f"### {title}", "", *lines, "", angles_sentence(scenario), "", moments_sentence(scenario)])
        )
    return "\n\n".join(parts)


def _rule(headings: Sequence[str]) -> list[str]:
    return ["---", *["--:"] * (len(headings) - 1)]


def save_accuracy(found: Mapping[str, ScenarioAccuracy], seed: int, folder: str | Path) -> Path:
    """Write `accuracy.json` and `accuracy.md` into a folder; returns the folder."""
    told = {
        "kinertia": VERSION,
        "seed": seed,
        "scenarios": {key: asdict(scenario) for key, scenario in found.items()},
    }
    with complete_folder(folder) as work:
        (work / "accuracy.json").write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
        (work / "accuracy.md").write_text(accuracy_markdown(found) + "\n", encoding="utf-8")
    return Path(folder)
