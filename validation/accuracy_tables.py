"""Tables of docs/validation/accuracy.md: error bars and joint moments in every laboratory."""

from collections.abc import Mapping, Sequence

import numpy as np

from validation.accuracy_study import ClassAccuracy, ScenarioAccuracy

HEADINGS = ("", "95 % coverage", "error / sd", "RMS error", "bound", "literature", "better (at best)")
_SHOWN = {
    "mass": (1.0, "kg", ".2f"),
    "CoM": (1e3, "mm", ".1f"),
    "moments of inertia": (1.0, "kg m2", ".4f"),
    "products of inertia": (1.0, "kg m2", ".4f"),
}


def accuracy_rows(scenario: ScenarioAccuracy) -> list[list[str]]:
    """Return one row per class of parameters, under `HEADINGS`."""
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
"""Caption of a table of `joint_rows`."""


def joint_rows(scenario: ScenarioAccuracy) -> list[list[str]]:
    """Return one row per joint, under `JOINT_HEADINGS`: RMS errors of the estimate beside IK + ID's."""
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
    """Return one table: per laboratory and joint the RMS error of joint moments, estimate / IK + ID."""
    joints = list(next(iter(accuracies.values())).joints)
    rows = [
        [scenario.title, *(f"{joint.moment_nm:.2f} / {joint.usual_nm:.2f}" for joint in scenario.joints.values())]
        for scenario in accuracies.values()
    ]
    return _table(["N m", *joints], rows)


def accuracy_markdown(accuracies: Mapping[str, ScenarioAccuracy]) -> str:
    """Return a table per scenario."""
    parts = []
    for scenario in accuracies.values():
        title = scenario.title[0].upper() + scenario.title[1:]
        joints, classes = _table(JOINT_HEADINGS, joint_rows(scenario)), _table(HEADINGS, accuracy_rows(scenario))
        parts.append("\n\n".join([f"### {title}", joints, classes]))
    return "\n\n".join(parts)


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    rule = ["---", *["--:"] * (len(headings) - 1)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (headings, rule, *rows))
