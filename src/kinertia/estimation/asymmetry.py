"""Compares left and right limbs with the error bars of their difference.

The prior has left and right alike but not the same (correlation 0.9): a difference that the data do not show is that
of the two sides' measured lengths, and its error bar says how much larger it may be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinertia.model.bsp import MIRROR_SIGNS, PARAMETERS, BodySegmentParameters, partners

BEYOND_SD = 2.81
"""Deviations beyond which one of a pair's ten parameters differs: by chance in 5 % of pairs that are the same, at most
(Bonferroni)."""


@dataclass(frozen=True, eq=False)
class Asymmetry:
    """One pair of segments.

    Attributes:
        segment: without its side.
        difference: (10,) right minus the left one's mirror image, in the table's order and units.
        sd: (10,) posterior deviations of it.
    """

    segment: str
    difference: np.ndarray
    sd: np.ndarray

    @property
    def differing(self) -> tuple[int, ...]:
        """Parameters, by their place in `PARAMETERS`, that differ beyond the error bars; the plainest first."""
        away = np.abs(self.difference) / self.sd
        return tuple(int(k) for k in np.argsort(-away) if away[k] > BEYOND_SD)


def asymmetries(bsp: BodySegmentParameters, covariance: np.ndarray) -> list[Asymmetry]:
    """Every pair of segments whose right and left were estimated.

    Args:
        bsp: the estimate.
        covariance: (10 s, 10 s) posterior, of its table.
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
    """One row per pair and parameter: segment, parameter, right_minus_left, sd, differs."""
    rows = [
        (pair.segment, name, float(pair.difference[k]), float(pair.sd[k]), k in pair.differing)
        for pair in pairs
        for k, name in enumerate(PARAMETERS)
    ]
    names = ("segment", "parameter", "right_minus_left", "sd", "differs")
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}
