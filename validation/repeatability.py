"""Do trials of one session, each fitted alone, agree about what they share?

Plates, clock, joint centres and body are the same in all trials of a person, plates and clock in those of a session.
What the fits say of them must agree within their deviations, which needs no truth to judge. All deviations contain the
same prior, so that chi2 over its degrees of freedom is at most 1 on average where they are honest.
"""

import csv
import json
import statistics
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from kinertia.estimation.simultaneous.instruments.instrument_errors import ZERO, CalibrationEntry

APART = 1.96
"""SDs beyond which two values, or a value and zero, differ (95 %)."""
_BEYOND = 0.99
INSTRUMENT_GROUPS = ("delay", "free moment", "position", "gain", "zero offset", "rotation")
GROUPS = (*INSTRUMENT_GROUPS, "joint", "mass", "com", "inertia")
"""Groups that are compared: instruments, joint centres and axes, body segment parameters."""
_PRODUCTS = ("ixy", "ixz", "iyz")
"""Not compared: hardly anything shows them."""


@dataclass(frozen=True)
class Estimate:
    """Estimate of an unknown by one trial, SI.

    Attributes:
        trial: name of the trial.
        value, sd, prior_sd: value, SD and prior SD of the unknown.
        warned: whether the fit itself advises to check the instrument.
    """

    trial: str
    value: float
    sd: float
    prior_sd: float
    warned: bool = False

    @property
    def accuses(self) -> bool:
        """Whether the value is beyond what is usual, and beyond its own SD."""
        return abs(self.value) > APART * max(self.sd, self.prior_sd)


@dataclass(frozen=True)
class Shared:
    """Estimates by several trials of an unknown that is the same in all of them.

    Attributes:
        name: name in the fits.
        group: one of GROUPS.
        unit: SI unit.
        estimates: estimates of at least two trials.
    """

    name: str
    group: str
    unit: str
    estimates: tuple[Estimate, ...]

    @property
    def chi2(self) -> float:
        """Squared deviations from the weighted mean, each over its variance, over the degrees of freedom."""
        mean, _ = weighted_mean(self.estimates)
        squares = sum(((estimate.value - mean) / estimate.sd) ** 2 for estimate in self.estimates)
        return squares / (len(self.estimates) - 1)

    @property
    def beyond(self) -> bool:
        """Whether `chi2` is beyond the 99 % point for this number of trials."""
        freedom = len(self.estimates) - 1
        return self.chi2 > float(chi2.ppf(_BEYOND, freedom)) / freedom

    @property
    def apart(self) -> list[bool]:
        """Whether each pair of trials differs by more than 1.96 SDs of the difference."""
        return [
            abs(a.value - b.value) > APART * float(np.hypot(a.sd, b.sd)) for a, b in combinations(self.estimates, 2)
        ]

    def accusations(self) -> Iterator[tuple[Estimate, bool]]:
        """Yield each trial that accuses an instrument, and whether the other trials contradict it."""
        if self.group not in INSTRUMENT_GROUPS:
            return
        for estimate in self.estimates:
            if estimate.accuses:
                mean, sd = weighted_mean([other for other in self.estimates if other is not estimate])
                yield estimate, abs(estimate.value - mean) > APART * float(np.hypot(estimate.sd, sd))


@dataclass(frozen=True)
class GroupSums:
    """Summary of all unknowns of a group: chi2 over degrees of freedom, pairs and SDs.

    Attributes:
        unknowns: number of unknowns.
        mean, worst: mean and worst chi2 over degrees of freedom.
        worst_name: name of the worst unknown.
        beyond: number of unknowns beyond the 99 % point.
        pairs_apart: share of the pairs of trials that differ.
        median_sd: median SD of the single estimates, SI.
    """

    unknowns: int
    mean: float
    worst: float
    worst_name: str
    beyond: int
    pairs_apart: float
    median_sd: float


def weighted_mean(estimates: Sequence[Estimate]) -> tuple[float, float]:
    """Return the mean, weighted by inverse variances, and its SD."""
    weights = [estimate.sd**-2 for estimate in estimates]
    mean = sum(weight * estimate.value for weight, estimate in zip(weights, estimates, strict=True)) / sum(weights)
    return mean, sum(weights) ** -0.5


def shared(folders: Sequence[Path], instruments_only: bool = False) -> list[Shared]:
    """List all unknowns that at least two of the fits in these folders estimate.

    Args:
        folders: results of `kinertia fit`, one trial each.
        instruments_only: whether the trials are of different people.
    """
    found: dict[tuple[str, str, str], list[Estimate]] = {}
    for folder in folders:
        for key, estimate in (*_calibrated(folder), *([] if instruments_only else _body(folder))):
            if not (instruments_only and key[1] not in INSTRUMENT_GROUPS):
                found.setdefault(key, []).append(estimate)
    return [Shared(*key, tuple(estimates)) for key, estimates in found.items() if len(estimates) > 1]


def group_sums(unknowns: Iterable[Shared]) -> dict[str, GroupSums]:
    """Summarise each group that has any unknowns."""
    by_group: dict[str, list[Shared]] = {}
    for unknown in unknowns:
        by_group.setdefault(unknown.group, []).append(unknown)
    return {group: _sums(by_group[group]) for group in GROUPS if group in by_group}


def _sums(unknowns: Sequence[Shared]) -> GroupSums:
    worst = max(unknowns, key=lambda unknown: unknown.chi2)
    return GroupSums(
        unknowns=len(unknowns),
        mean=statistics.fmean(unknown.chi2 for unknown in unknowns),
        worst=worst.chi2,
        worst_name=worst.name,
        beyond=sum(unknown.beyond for unknown in unknowns),
        pairs_apart=statistics.fmean(apart for unknown in unknowns for apart in unknown.apart),
        median_sd=statistics.median_high([estimate.sd for unknown in unknowns for estimate in unknown.estimates]),
    )


def _calibrated(folder: Path) -> Iterator[tuple[tuple[str, str, str], Estimate]]:
    for entry in json.loads((folder / "fit.json").read_text(encoding="utf-8"))["calibration"]:
        error = CalibrationEntry(**entry)
        if error.sd and (error.trial is None or error.quantity == ZERO):
            group = error.quantity if error.of_instrument else "joint"
            yield (
                (str(replace(error, trial=None)), group, error.unit),
                Estimate(folder.name, error.value, error.sd, error.prior_sd, error.supported),
            )


def _body(folder: Path) -> Iterator[tuple[tuple[str, str, str], Estimate]]:
    with (folder / "bsp.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            parameter = row["parameter"]
            if parameter in _PRODUCTS or not float(row["sd"] or 0.0) > 0.0:
                continue
            group = parameter if parameter == "mass" else "com" if parameter.startswith("com") else "inertia"
            value, sd, prior_sd = (float(row[key]) for key in ("estimate", "sd", "prior_sd"))
            yield (f"{parameter} of {row['segment']}", group, _UNITS[group]), Estimate(folder.name, value, sd, prior_sd)


_UNITS = {"mass": "kg", "com": "m", "inertia": "kg m2"}
