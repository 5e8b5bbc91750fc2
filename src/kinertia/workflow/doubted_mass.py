"""Moves the prior to the mass of the plates, where these contradict the stated one alike.

The estimate determines gains only from the stated mass. Two plates have two amplifiers and two calibrations, and a
person has one mass: if every plate has a gain error in the same direction, the mass is doubted first.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kinertia.estimation.prepared import Prepared
from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.calibration_entry import GAIN, CalibrationEntry
from kinertia.estimation.simultaneous.fit import SimultaneousFit
from kinertia.findings.finding import Finding, Severity

_DOUBTED = "S111"
_FEWEST = 2
"""Number of agreeing occasions or plates from which on they are likelier to be right than a written number."""
_FEWEST_PLATES, _ALIKE = 2, 0.5
"""Fewest plates, and the smallest of their gain errors as a share of the largest. A foot that reaches over the edge of
one plate adds to its error: 8 and 11 % for a mass that is wrong by 12 %."""
_LEAST = 0.03
"""Share of the mass from which the estimated mass is reported to differ."""
_UNINFORMED = (0.1, 0.9)
"""Shares of the prior SD: an unloaded plate has no error and the prior's standard deviation."""


def with_doubted_mass(prior: BspPrior, findings: Sequence[Finding]) -> BspPrior:
    """Return the prior at the plates' mass, where several occasions or plates agree that the stated mass is wrong.

    They are not scaled to it. A user who ignores the finding keeps the stated mass.
    """
    for one in findings:
        if one.code != _DOUBTED or one.severity is not Severity.WARNING or not one.is_open:
            continue
        evidence = (one.evidence[name] for name in ("mass_by_force_kg", "stated_kg", "agreeing"))
        by_force, stated, agreeing = (float(each.value) for each in evidence if not isinstance(each.value, tuple))
        if agreeing >= _FEWEST:
            sd_kg = one.evidence["mass_by_force_kg"].sd or 0.0
            return prior.at_mass(prior.mass_kg + by_force - stated, max(prior.mass_sd_kg, sd_kg))
    return prior


def at_mass_of_plates(ready: Prepared, fitted: SimultaneousFit) -> Prepared | None:
    """Return the person at the mass that all plates agree on in an estimate.

    None if not all plates contradict the stated mass equally, if something was attached, or if the user ignores it.
    """
    gain = common_gain(fitted.posterior.instrument_errors)
    ignored = any(_DOUBTED.startswith(code) for code in ready.overrule.ignore)
    if gain is None or ignored or ready.attached:
        return None
    return replace(ready, prior=at_common_gain(ready.prior, fitted.bsp.total_mass_kg, gain))


def common_gain(errors: Sequence[CalibrationEntry]) -> tuple[float, float] | None:
    """Return the gain error common to all plates in all trials, with its SD; None if there is none.

    Args:
        errors: of instruments, significant or not.
    """
    gains = [one for one in errors if one.quantity == GAIN]
    gains = [one for one in gains if one.trial is not None] or gains
    informed = [one for one in gains if not _uninformed(one)]
    values = np.array([one.value for one in informed])
    if len({one.plate for one in informed}) < _FEWEST_PLATES or not all(one.found for one in informed):
        return None
    least, most = float(np.abs(values).min()), float(np.abs(values).max())
    mean = float(values.mean())
    if abs(np.sign(values).sum()) < len(values) or least < _ALIKE * most or abs(mean) < _LEAST:
        return None
    return mean, float(np.mean([one.sd for one in informed]))


def at_common_gain(prior: BspPrior, total_kg: float, gain: tuple[float, float]) -> BspPrior:
    """Return the prior at the mass for which plates with this common gain error are right.

    `total_kg` is the estimated mass of the body.
    """
    error, sd = gain
    mass_kg = total_kg * (1.0 + error)
    return prior.at_mass(mass_kg, max(prior.mass_sd_kg, sd * mass_kg))


def _uninformed(one: CalibrationEntry) -> bool:
    small, wide = _UNINFORMED
    return abs(one.value) < small * one.prior_sd and one.sd > wide * one.prior_sd
