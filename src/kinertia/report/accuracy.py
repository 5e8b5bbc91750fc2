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

HEADINGS = ("", "95 % coverage", "error / sd", "RMS error", "bound", "literature", "better (at best)")
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
        coverage = f"{100 * found.coverage:.1f} ± {100 * found.coverage_sd:.1f} %"
        rows.append([f"{name} ({unit})", coverage, f"{found.ratio:.2f}", *errors, _better(found)])
    return rows


def _better(found: ClassAccuracy) -> str:
    told = f"{100 * found.better:.0f} %"
    return told if np.isnan(found.attainable) else f"{told} ({100 * found.attainable:.0f} %)"


JOINT_HEADINGS = ("", "N m", "usual", "ratio", "sd (coverage)", "deg", "IK", "varying", "IK")
JOINT_CAPTION = (
    "RMS errors of joint moments (N m) and joint angles (degrees) of the estimate. usual: inverse kinematics, "
    "literature BSPs, forces as measured, the best of 6, 10 and 12 Hz per joint; sd (coverage): sd reported, and how "
    "often the truth lies in the 95 % interval; varying: without each angle's constant error."
)
"""What stands under a table of `joint_rows`."""


def joint_rows(scenario: ScenarioAccuracy) -> list[list[str]]:
    """One row per joint, under `JOINT_HEADINGS`: RMS errors of the estimate beside the usual pipeline's."""
    rows = []
    for joint, found in scenario.joints.items():
        angles = (found.angle_rad, found.angle_ik_rad, found.change_rad, found.change_ik_rad)
        moments = [f"{found.moment_nm:.2f}", f"{found.usual_nm:.2f}", f"{found.moment_nm / found.usual_nm:.2f}"]
        deviation = f"{found.moment_sd_nm:.2f} ({100 * found.coverage:.0f} %)"
        rows.append([joint, *moments, deviation, *(f"{np.degrees(angle):.2f}" for angle in angles)])
    return rows


def moments_markdown(found: Mapping[str, ScenarioAccuracy]) -> str:
    """One table: per laboratory and joint the RMS error of joint moments, estimate / usual pipeline."""
    joints = list(next(iter(found.values())).joints)
    rows = [
        [scenario.title, *(f"{one.moment_nm:.2f} / {one.usual_nm:.2f}" for one in scenario.joints.values())]
        for scenario in found.values()
    ]
    return _table(["N m", *joints], rows)


def accuracy_markdown(found: Mapping[str, ScenarioAccuracy]) -> str:
    """A table per scenario."""
    parts = []
    for scenario in found.values():
        title = scenario.title[0].upper() + scenario.title[1:]
        joints, classes = _table(JOINT_HEADINGS, joint_rows(scenario)), _table(HEADINGS, accuracy_rows(scenario))
        parts.append("\n\n".join([f"### {title}", joints, classes]))
    return "\n\n".join(parts)


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    rule = ["---", *["--:"] * (len(headings) - 1)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (headings, rule, *rows))


def save_accuracy(found: Mapping[str, ScenarioAccuracy], seed: int, folder: str | Path) -> Path:
    """Write `accuracy.json` and `accuracy.md` into a folder; returns the folder."""
    told = {
        "kinertia": VERSION,
        "seed": seed,
        "scenarios": {key: asdict(scenario) for key, scenario in found.items()},
    }
    with complete_folder(folder, "accuracy") as work:
        (work / "accuracy.json").write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
        (work / "accuracy.md").write_text(accuracy_markdown(found) + "\n", encoding="utf-8")
    return Path(folder)
