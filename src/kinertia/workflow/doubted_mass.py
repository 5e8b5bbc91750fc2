"""Widens the deviation of a stated mass that plates contradict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from kinertia.estimation.prior import BspPrior
from kinertia.findings.finding import Finding, Severity

_DOUBTED = "S111"


def with_doubted_mass(prior: BspPrior, findings: Sequence[Finding]) -> BspPrior:
    """Widen the deviation of the total mass to what several occasions on plates contradict it by.

    Two plates and a static trial that agree are likelier than the number that somebody wrote down: they are not scaled
    to it. Whoever ignores the finding keeps the stated mass.
    """
    for one in findings:
        agreed = one.code == _DOUBTED and one.where.trial is None and one.severity is Severity.WARNING
        if agreed and one.is_open:
            by_force, stated = (one.evidence[name].value for name in ("mass_by_force_kg", "stated_kg"))
            assert isinstance(by_force, float)
            assert isinstance(stated, float)
            return replace(prior, mass_sd_kg=max(prior.mass_sd_kg, abs(by_force - stated)))
    return prior
