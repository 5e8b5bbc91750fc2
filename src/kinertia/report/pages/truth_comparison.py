"""Compares the estimate with a synthetic person's truth: what was wrong before and after."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from kinertia.estimation.result.fit import Fit
from kinertia.model.bsp import BodySegmentParameters
from kinertia.report.wording import INTERVAL_SD
from kinertia.trial.sampled_data import rms

JOINTS = {
    "hip flexion": ("hip_flexion",),
    "hip adduction": ("hip_adduction",),
    "hip rotation": ("hip_rotation",),
    "knee": ("knee",),
    "ankle": ("ankle", "subtalar"),
    "lumbar extension": ("lumbar_extension",),
    "lumbar bending": ("lumbar_bending",),
    "lumbar rotation": ("lumbar_rotation",),
    "arms": ("arm", "elbow"),
}
"""Beginnings of the names of each joint's coordinates, left and right."""
_PARAMETERS = (("mass (kg)", 1.0, 2), ("centre of mass (mm)", 1e3, 0), ("moments of inertia (kg m2)", 1.0, 4))


@dataclass(frozen=True, eq=False)
class Truth:
    """Known truth of a synthetic person.

    Attributes:
        bsp: parameters, segments in the order of the fit's.
        joint_loads: trial -> (w, c) N m and N in the frames and coordinates of the fit.
    """

    bsp: BodySegmentParameters
    joint_loads: Mapping[str, np.ndarray]

    def parameter_errors(self, source: BodySegmentParameters) -> tuple[float, float, float]:
        """Return the RMS over the segments of mass (kg), CoM distance (m), moments of inertia (kg m2)."""
        change = source.table() - self.bsp.table()
        distance = np.linalg.norm(change[:, 1:4], axis=1)
        mass, com, inertia = (rms(part) for part in (change[:, 0], distance, change[:, 4:7]))
        return mass, com, inertia

    def moment_errors(self, fit: Fit) -> dict[str, tuple[float, float]]:
        """Return per joint the RMS error (N m) over all trials of joint moments by IK + ID and by the estimate.

        IK + ID uses measured motion, literature BSPs, and forces as measured.
        """
        before, after = (self._moments_off(fit, stage) for stage in ("literature", "estimate"))
        return {joint: (rms(before[:, columns]), rms(after[:, columns])) for joint, columns in _columns(fit).items()}

    def moment_intervals(self, fit: Fit) -> dict[str, tuple[float, float]]:
        """Return per joint the median half-width (N m) of the 95 % intervals, and the share that holds the truth.

        Empty after two-level, which has no intervals.
        """
        deviations = [trial.deviations.moments for trial in fit.trials if trial.deviations is not None]
        if not deviations:
            return {}
        half, off = INTERVAL_SD * np.concatenate(deviations), np.abs(self._moments_off(fit, "estimate"))
        return {
            joint: (float(np.median(half[:, columns])), float(np.mean(off[:, columns] <= half[:, columns])))
            for joint, columns in _columns(fit).items()
        }

    def _moments_off(self, fit: Fit, stage: str) -> np.ndarray:
        """Return the errors (w, c) of a stage's joint loads in all trials."""
        return np.concatenate([trial.joint_loads[stage] - self.joint_loads[trial.name] for trial in fit.trials])


def _columns(fit: Fit) -> dict[str, list[int]]:
    """Return the columns of each joint's coordinates."""
    names = list(enumerate(fit.skeleton.coordinates))
    return {joint: [k for k, name in names if name.startswith(begins)] for joint, begins in JOINTS.items()}


def truth_rows(fit: Fit, truth: Truth) -> dict[str, list[tuple[str, str, str]]]:
    """Return RMS errors in words for the page: what, before, after; of the parameters, and of the joint moments."""
    pairs = zip(*(truth.parameter_errors(bsp) for bsp in (fit.literature, fit.estimate)), strict=True)
    parameters = [
        (name, f"{factor * before:.{digits}f}", f"{factor * after:.{digits}f}")
        for (name, factor, digits), (before, after) in zip(_PARAMETERS, pairs, strict=True)
    ]
    moments: Any = truth.moment_errors(fit).items()
    return {
        "parameters": parameters,
        "moments": [(joint, f"{before:.2f}", f"{after:.2f}") for joint, (before, after) in moments],
    }
