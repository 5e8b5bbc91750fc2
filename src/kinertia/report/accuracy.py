"""The accuracy study on paper and screen: a page, `accuracy.json`, `accuracy.md`, and rows for the terminal."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from kinertia.io.output_folder import complete_folder
from kinertia.io.provenance import VERSION
from kinertia.report.result_page import Part, render_parts
from kinertia.report.row_figures import dot_figure
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
    for name, accuracy in scenario.classes.items():
        factor, unit, form = _SHOWN.get(name, (1.0, "prior sd", ".2f"))
        errors = (f"{factor * value:{form}}" for value in (accuracy.rms, accuracy.bound, accuracy.rms_literature))
        coverage = f"{100 * accuracy.coverage:.1f} ± {100 * accuracy.coverage_sd:.1f} %"
        rows.append([f"{name} ({unit})", coverage, f"{accuracy.ratio:.2f}", *errors, _better(accuracy)])
    return rows


def _better(accuracy: ClassAccuracy) -> str:
    text = f"{100 * accuracy.better:.0f} %"
    return text if np.isnan(accuracy.attainable) else f"{text} ({100 * accuracy.attainable:.0f} %)"


JOINT_HEADINGS = ("", "N m", "usual", "ratio", "sd (coverage)", "W", "deg", "IK", "sd (coverage)", "varying", "IK")
JOINT_CAPTION = (
    "RMS errors of joint moments (N m) and joint angles (degrees) of the estimate. usual: inverse kinematics, "
    "literature BSPs, forces as measured, the best of 6, 10 and 12 Hz per joint; sd (coverage): sd reported, and how "
    "often the truth lies in the 95 % interval; W: the same of joint powers; varying: without each angle's constant "
    "error."
)
"""What stands under a table of `joint_rows`."""


def joint_rows(scenario: ScenarioAccuracy) -> list[list[str]]:
    """One row per joint, under `JOINT_HEADINGS`: RMS errors of the estimate beside the usual pipeline's."""
    rows = []
    for joint, accuracy in scenario.joints.items():
        angles = (accuracy.angle_rad, accuracy.angle_ik_rad, accuracy.change_rad, accuracy.change_ik_rad)
        moments = [
            f"{accuracy.moment_nm:.2f}",
            f"{accuracy.usual_nm:.2f}",
            f"{accuracy.moment_nm / accuracy.usual_nm:.2f}",
        ]
        deviation = f"{accuracy.moment_sd_nm:.2f} ({100 * accuracy.coverage:.0f} %)"
        shown = [f"{np.degrees(angle):.2f}" for angle in angles]
        shown.insert(2, f"{np.degrees(accuracy.angle_sd_rad):.2f} ({100 * accuracy.angle_coverage:.0f} %)")
        rows.append([joint, *moments, deviation, f"{100 * accuracy.power_coverage:.0f} %", *shown])
    return rows


def moments_markdown(accuracies: Mapping[str, ScenarioAccuracy]) -> str:
    """One table: per laboratory and joint the RMS error of joint moments, estimate / usual pipeline."""
    joints = list(next(iter(accuracies.values())).joints)
    rows = [
        [scenario.title, *(f"{one.moment_nm:.2f} / {one.usual_nm:.2f}" for one in scenario.joints.values())]
        for scenario in accuracies.values()
    ]
    return _table(["N m", *joints], rows)


def accuracy_markdown(accuracies: Mapping[str, ScenarioAccuracy]) -> str:
    """A table per scenario."""
    parts = []
    for scenario in accuracies.values():
        title = scenario.title[0].upper() + scenario.title[1:]
        joints, classes = _table(JOINT_HEADINGS, joint_rows(scenario)), _table(HEADINGS, accuracy_rows(scenario))
        parts.append("\n\n".join([f"### {title}", joints, classes]))
    return "\n\n".join(parts)


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    rule = ["---", *["--:"] * (len(headings) - 1)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (headings, rule, *rows))


def render_accuracy(accuracies: Mapping[str, ScenarioAccuracy], seed: int) -> str:
    """The page: joint moments of all laboratories in one figure, then the tables of each."""
    scenarios = list(accuracies.values())
    figure = dot_figure(
        [one.title for one in scenarios],
        {
            f"{joint} (N m)": {
                "usual pipeline": [one.joints[joint].usual_nm for one in scenarios],
                "estimate": [one.joints[joint].moment_nm for one in scenarios],
            }
            for joint in scenarios[0].joints
        },
        "RMS error of joint moments in every laboratory, usual pipeline and estimate.",
    )
    parts = [Part("Joint moments", (JOINT_CAPTION,), figure, "RMS error against the truth.")]
    for one in scenarios:
        title = one.title[0].upper() + one.title[1:]
        people = f"{one.draws} people, {100 * one.converged:.0f} % converged."
        parts.append(Part(title, (people,), headings=JOINT_HEADINGS, rows=joint_rows(one)))
        parts.append(Part(f"{title}: parameters", headings=HEADINGS, rows=accuracy_rows(one)))
    return render_parts("Do the error bars hold?", f"People drawn from the literature's prior; seed {seed}.", parts)


def accuracy_summary(accuracies: Mapping[str, ScenarioAccuracy], seed: int) -> dict[str, Any]:
    """What `accuracy.json` says."""
    scenarios = {key: asdict(scenario) for key, scenario in accuracies.items()}
    return {"kinertia": VERSION, "seed": seed, "scenarios": scenarios}


def save_accuracy(accuracies: Mapping[str, ScenarioAccuracy], seed: int, folder: str | Path) -> Path:
    """Write `accuracy.html`, `accuracy.json` and `accuracy.md` into a folder; returns the folder."""
    content = accuracy_summary(accuracies, seed)
    with complete_folder(folder, "accuracy") as work:
        (work / "accuracy.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        (work / "accuracy.html").write_text(render_accuracy(accuracies, seed), encoding="utf-8")
        (work / "accuracy.md").write_text(accuracy_markdown(accuracies) + "\n", encoding="utf-8")
    return Path(folder)
