"""Compares joint angles, moments and powers of the files with Kinertia's, in Plug-in Gait's convention."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.motion.model_outputs import ModelOutput, model_outputs
from kinertia.report.figures.coordinate_titles import Coordinate
from kinertia.report.figures.figure import SIDES, Figure, small_multiples, written
from kinertia.report.figures.time_figures import MOST_FRAMES, panel_over_time, time_axis
from kinertia.report.wording import INTERVAL_SD
from kinertia.trial.file_contents import FileOutputs
from kinertia.trial.sampled_data import nearest_samples

_SHOWN = {"ANGLES": (0, 1.0, "deg"), "MOMENTS": (0, 1e-3, "N m/kg"), "POWERS": (2, 1.0, "W/kg")}
"""Component that is compared (flexion, of angle and moment), with its factor and unit here."""
_NAMES = {"ANGLES": "flexion angle", "MOMENTS": "extension moment", "POWERS": "power"}
_ANKLE = {"ANGLES": "dorsiflexion angle", "MOMENTS": "plantarflexion moment", "POWERS": "power"}
_PER_KG_N_M = 10.0
"""No joint moment per kg is this large; larger ones are not divided by body mass."""
_FEWEST = 10
"""Frames to compare."""


@dataclass(frozen=True, eq=False)
class OutputComparison:
    """One quantity of one joint and side, from the file and from Kinertia.

    Attributes:
        trial, joint, side, kind, unit: what is compared, with Plug-in Gait's signs.
        ours, sd, theirs: (w,) at the frames of the fit; `sd` is NaN without error bars, `theirs` where missing.
    """

    trial: str
    joint: str
    side: str
    kind: str
    unit: str
    ours: np.ndarray
    sd: np.ndarray
    theirs: np.ndarray

    @property
    def quantity(self) -> str:
        """Name of the quantity: "Knee extension moment"."""
        return f"{self.joint} {(_ANKLE if self.joint == 'Ankle' else _NAMES)[self.kind]}"

    @property
    def rms(self) -> float:
        """RMS difference, file minus ours."""
        return float(np.sqrt(np.nanmean(np.square(self.theirs - self.ours))))

    @property
    def mean(self) -> float:
        """Mean difference, file minus ours."""
        return float(np.nanmean(self.theirs - self.ours))

    @property
    def correlation(self) -> float:
        """Correlation of both curves."""
        both = np.isfinite(self.theirs)
        return float(np.corrcoef(self.theirs[both], self.ours[both])[0, 1])

    @property
    def outside(self) -> float | None:
        """Share of the frames in which the file's value is outside our 95 % interval; None without error bars."""
        both = np.isfinite(self.theirs) & np.isfinite(self.sd)
        if not both.any():
            return None
        return float((np.abs(self.theirs - self.ours)[both] > INTERVAL_SD * self.sd[both]).mean())

    @property
    def beyond(self) -> bool | None:
        """Whether the RMS difference exceeds our error bar, 1.96 times the RMS of our SD; None without error bars."""
        if not np.isfinite(self.sd).any():
            return None
        return self.rms > INTERVAL_SD * float(np.sqrt(np.nanmean(np.square(self.sd))))


def compared_outputs(fit: Fit, trial: TrialFit) -> list[OutputComparison]:
    """Pair the quantities that both have; none for a file without outputs."""
    stated = trial.kinematics.trial.outputs
    if stated is None:
        return []
    loads = trial.reactions.at(trial.time)
    outputs = model_outputs(
        trial.skeleton, fit.estimate, trial.motion, loads, fit.mass_kg, "plug-in-gait", trial.deviations
    )
    return [
        comparison for output in outputs if (comparison := _compared(trial, output, stated, fit.mass_kg)) is not None
    ]


def _compared(trial: TrialFit, output: ModelOutput, stated: FileOutputs, mass_kg: float) -> OutputComparison | None:
    if output.name not in stated.values or output.kind not in _SHOWN:
        return None
    component, factor, unit = _SHOWN[output.kind]
    divisor = moment_divisor(stated, output.kind, mass_kg)
    theirs = stated.values[output.name][nearest_samples(stated.time, trial.time), component] / divisor
    if np.isfinite(theirs).sum() < _FEWEST:
        return None
    ours, sd = factor * output.values[:, component], factor * output.sd[:, component]
    return OutputComparison(trial.name, output.joint, output.side, output.kind, unit, ours, sd, theirs)


def moment_divisor(stated: FileOutputs, kind: str, mass_kg: float) -> float:
    """Return body mass where the file's moments are not per kg, else 1; powers are treated alike."""
    moments = [values for name, values in stated.values.items() if name.endswith("Moment")]
    whole = bool(moments) and max(float(np.nanmax(np.abs(values))) for values in moments) > _PER_KG_N_M
    return mass_kg if whole and kind != "ANGLES" else 1.0


def outputs_figure(trial: TrialFit, compared: list[OutputComparison], most_frames: int = MOST_FRAMES) -> Figure:
    """Draw all quantities over time: ours with 95 % bands, the file's dashed."""
    panels = []
    for quantity in dict.fromkeys(comparison.quantity for comparison in compared):
        sides = [comparison for comparison in compared if comparison.quantity == quantity]
        title = f"{quantity} ({sides[0].unit})"
        columns = {comparison.side: k for k, comparison in enumerate(sides)}
        ours, sd, theirs = (
            np.stack([getattr(comparison, name) for comparison in sides], axis=1) for name in ("ours", "sd", "theirs")
        )
        coordinate = Coordinate(quantity, title, columns, True)
        lines: Mapping[str, tuple[np.ndarray, dict[str, Any]]] = {
            "Kinertia": (ours, {"width": 2}),
            "in the file": (theirs, {"dash": "dash", "width": 1.6}),
        }
        panels.append(panel_over_time(trial, coordinate, lines, (ours, sd), most_frames))
    alt = f"Angles, moments and powers of {trial.name} over time: Kinertia's and those that the file holds."
    return small_multiples(panels, alt, time_axis(trial.kinematics))


def outputs_summary(fit: Fit) -> list[dict[str, Any]]:
    """Return the files' own outputs for `kinertia compare --json`, per trial, joint, side, quantity."""
    return [
        {
            "trial": comparison.trial,
            "side": comparison.side,
            "quantity": comparison.quantity,
            "unit": comparison.unit,
            "rms": comparison.rms,
            "mean": comparison.mean,
            "correlation": comparison.correlation,
            "outside": comparison.outside,
            "beyond": comparison.beyond,
        }
        for trial in fit.trials
        for comparison in compared_outputs(fit, trial)
    ]


def outputs_sentence(fit: Fit) -> str:
    """State how far the files' own joint moments are from Kinertia's, joint by joint; empty where they have none."""
    compared = [
        comparison
        for trial in fit.trials
        for comparison in compared_outputs(fit, trial)
        if comparison.kind == "MOMENTS"
    ]
    parts = []
    for joint in dict.fromkeys(comparison.joint for comparison in compared):
        of_joint = [comparison for comparison in compared if comparison.joint == joint]
        rms = float(np.sqrt(np.mean([comparison.rms**2 for comparison in of_joint])))
        beyond = ", beyond the error bar" if any(comparison.beyond for comparison in of_joint) else ""
        parts.append(f"{joint.lower()} {rms:.2f}{beyond}")
    return f"RMS differences (N m/kg) from the files' own flexion moments: {'; '.join(parts)}" if parts else ""


def outputs_view(fit: Fit, trials: Sequence[TrialFit], most_frames: int = MOST_FRAMES) -> list[dict[str, Any]]:
    """Return the content of a page: a figure and table rows for each trial whose file has outputs."""
    shown = []
    for trial in trials:
        compared = compared_outputs(fit, trial)
        if compared:
            figure = written(outputs_figure(trial, compared, most_frames))
            shown.append({"name": trial.name, "rows": [_row(comparison) for comparison in compared], "figure": figure})
    return shown


def _row(comparison: OutputComparison) -> dict[str, Any]:
    digits = 1 if comparison.kind == "ANGLES" else 2
    outside = comparison.outside
    return {
        "kind": comparison.kind,
        "quantity": f"{comparison.quantity} ({comparison.unit})",
        "side": SIDES[comparison.side][0],
        "rms": f"{comparison.rms:.{digits}f}",
        "mean": f"{comparison.mean:+.{digits}f}",
        "correlation": f"{comparison.correlation:.2f}",
        "outside": "" if outside is None else f"{100.0 * outside:.0f}",
        "beyond": "" if comparison.beyond is None else "yes" if comparison.beyond else "no",
    }
