"""Compares left and right limbs, with the uncertainty of their difference.

In the prior left and right are similar but not equal (correlation 0.9). A difference that the data do not show follows
from the measured lengths of the two sides, and its uncertainty shows how much larger it may be.
"""

from dataclasses import dataclass

import numpy as np

from kinertia.model.bsp import MIRROR_SIGNS, PARAMETERS, BodySegmentParameters, partners

BEYOND_SD = 2.81
"""Standard deviations beyond which one of a pair's ten parameters differs: by chance in at most 5 % of equal pairs
(Bonferroni)."""


@dataclass(frozen=True, eq=False)
class Asymmetry:
    """Difference between the two segments of a pair.

    Attributes:
        segment: without its side.
        difference: (10,) right minus mirrored left, in the order and units of the table.
        sd: (10,) posterior standard deviations of the difference.
    """

    segment: str
    difference: np.ndarray
    sd: np.ndarray

    @property
    def differing(self) -> tuple[int, ...]:
        """Indices into `PARAMETERS` of those that differ beyond their uncertainty, the most significant first."""
        away = np.abs(self.difference) / self.sd
        return tuple(int(k) for k in np.argsort(-away) if away[k] > BEYOND_SD)


def asymmetries(bsp: BodySegmentParameters, covariance: np.ndarray) -> list[Asymmetry]:
    """Compute the difference of every pair of segments whose right and left were estimated.

    Args:
        bsp: the estimate.
        covariance: (10 s, 10 s) posterior covariance of its table.
    """
    table, pairs = bsp.table(), []
    for right, left in enumerate(partners(bsp.segments)):
        if left == right or not bsp.segments[right].endswith("_r"):
            continue
        of_pair = np.hstack([np.eye(10), -np.diag(MIRROR_SIGNS)])
        rows = np.r_[10 * right : 10 * right + 10, 10 * left : 10 * left + 10]
        variance = np.diag(of_pair @ covariance[np.ix_(rows, rows)] @ of_pair.T)
        if np.all(variance > 0):
            difference = table[right] - MIRROR_SIGNS * table[left]
            pairs.append(Asymmetry(bsp.segments[right][:-2], difference, np.sqrt(variance)))
    return pairs


def asymmetry_columns(pairs: list[Asymmetry]) -> dict[str, list[object]]:
    """Return the columns of a table of pairs and parameters: segment, parameter, right_minus_left, sd, differs."""
    rows = [
        (pair.segment, name, float(pair.difference[k]), float(pair.sd[k]), k in pair.differing)
        for pair in pairs
        for k, name in enumerate(PARAMETERS)
    ]
    names = ("segment", "parameter", "right_minus_left", "sd", "differs")
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}
