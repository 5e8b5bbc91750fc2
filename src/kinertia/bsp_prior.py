"""How far a person's body segment parameters may be from the literature: the prior of the simultaneous estimate.

Standard deviations, and where they come from (all tables in Zatsiorsky 2002 after regression on mass and height, and
the spread between published methods; collected in the project's `reference/anthropometry.md`, section 4):

- mass: the larger of the between-subject residual deviation given mass and height (4b: thigh 7 %, shank 7 %, foot 10
  %, upper arm 9 %, forearm 9 %, trunk parts 10-12 %) and the spread between methods (4c: thigh 14 %, upper arm 16 %,
  foot 15 %);
- CoM: 3.5 % of the segment's length along it (4a: 1.2-5.6 % of length), and 5 % of the length across it, or 8 mm (no
  source gives the transverse deviation; tables differ by that much from one another); 10 mm to the side for pelvis and
  torso, which are nearly symmetric (no source; organs are not);
- moments of inertia: 20 % (4b: 12-24 % for the large ones); products of inertia: 8 % of the mean moment (no source; it
  covers principal axes some 5 degrees off).

Correlations: mass cut from the thigh goes to the trunk (the hip's cut plane is a matter of definition, 4c), and left
and right differ less than either from the literature: a person is nearly symmetric, but not bound to be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinertia.bsp import MIRROR_SIGNS, BodySegmentParameters

MASS_SD = {
    "pelvis": 0.14,
    "torso": 0.08,
    "thigh": 0.14,
    "shank": 0.07,
    "foot": 0.15,
    "upper_arm": 0.16,
    "forearm": 0.10,
}
"""Relative deviation of the mass, by segment."""
COM_ALONG_SD, COM_ACROSS_SD, SMALLEST_COM_SD_M, MIDLINE_SD_M = 0.035, 0.05, 0.008, 0.010
MOMENT_SD, PRODUCT_SD = 0.20, 0.08
SIDES_CORRELATION = 0.9
THIGH_TRUNK_CORRELATION = -0.35
SCALE_SD = 0.005
"""Relative deviation of the body mass on the scale."""


@dataclass(frozen=True, eq=False)
class BspPrior:
    """Gaussian prior of body segment parameters, and the total mass by the scale.

    Attributes:
        mean: need not be physically consistent (a start off by 50 % is not); estimates always are.
        covariance: (10 s, 10 s) of the table rows (mass, CoM, moments, products), segment after segment.
        mass_kg, mass_sd_kg: the total mass by the scale, and its deviation.

    Raises:
        ValueError: the covariance has the wrong shape or is not positive definite, or a deviation is not positive.
    """

    mean: BodySegmentParameters
    covariance: np.ndarray
    mass_kg: float
    mass_sd_kg: float

    def __post_init__(self) -> None:
        size = 10 * len(self.mean.segments)
        if self.covariance.shape != (size, size):
            raise ValueError(f"the covariance must be {size} x {size}, got {self.covariance.shape}")
        if not np.all(np.diag(self.covariance) > 0) or self.mass_sd_kg <= 0:
            raise ValueError("every prior deviation must be positive")
        correlation = self.covariance / np.outer(self.sd, self.sd)
        if not np.allclose(correlation, correlation.T) or np.linalg.eigvalsh(correlation)[0] <= 0:
            raise ValueError("the prior covariance must be symmetric and positive definite")

    @property
    def sd(self) -> np.ndarray:
        """(s, 10) prior deviations, in the table's order and units."""
        return np.sqrt(np.diag(self.covariance)).reshape(-1, 10)


def literature_prior(literature: BodySegmentParameters) -> BspPrior:
    """The prior around literature values of the 27-DOF model's segments, whose total mass is the scale's."""
    table = literature.table()
    sd = np.zeros_like(table)
    names = [segment.removesuffix("_r").removesuffix("_l") for segment in literature.segments]
    sd[:, 0] = table[:, 0] * [MASS_SD[name] for name in names]
    for row, name in enumerate(names):
        along = 0 if name == "foot" else 1
        length = 2.0 * abs(table[row, 1 + along])
        sd[row, 1:4] = np.maximum(COM_ACROSS_SD * length, SMALLEST_COM_SD_M)
        sd[row, 1 + along] = max(COM_ALONG_SD * length, SMALLEST_COM_SD_M)
        if not literature.segments[row].endswith(("_r", "_l")):
            sd[row, 3] = MIDLINE_SD_M
    sd[:, 4:7] = MOMENT_SD * table[:, 4:7]
    sd[:, 7:] = PRODUCT_SD * table[:, 4:7].mean(axis=1, keepdims=True)
    covariance = with_symmetry(np.diag(np.square(sd.ravel())), literature.segments, SIDES_CORRELATION)
    mass = {name: 10 * i for i, name in enumerate(literature.segments)}
    for side in "rl":
        for trunk in ("pelvis", "torso"):
            i, j = mass[f"thigh_{side}"], mass[trunk]
            shared = THIGH_TRUNK_CORRELATION * np.sqrt(covariance[i, i] * covariance[j, j])
            covariance[i, j] = covariance[j, i] = shared
    total = literature.total_mass_kg
    return BspPrior(literature, covariance, total, SCALE_SD * total)


def with_symmetry(covariance: np.ndarray, segments: tuple[str, ...], correlation: float) -> np.ndarray:
    """The covariance with this correlation between each right segment and the mirror image of its left one."""
    result = covariance.copy()
    sd = np.sqrt(np.diag(covariance))
    for i, segment in enumerate(segments):
        if segment.endswith("_r") and f"{segment[:-2]}_l" in segments:
            right = 10 * i + np.arange(10)
            left = 10 * segments.index(f"{segment[:-2]}_l") + np.arange(10)
            result[right, left] = result[left, right] = correlation * sd[right] * sd[left] * MIRROR_SIGNS
    return result
