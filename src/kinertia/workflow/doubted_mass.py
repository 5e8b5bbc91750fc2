"""Moves the prior to the mass of the plates, where they contradict the stated one."""

from collections.abc import Sequence
from dataclasses import replace

from kinertia.estimation.common_gain import at_common_gain, common_gain
from kinertia.estimation.prepared import Prepared
from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.fit import SimultaneousFit
from kinertia.findings.finding import Finding, Severity

_DOUBTED = "S111"
_FEWEST = 2
"""Number of agreeing occasions or plates from which on they are likelier to be right than a written number."""


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
