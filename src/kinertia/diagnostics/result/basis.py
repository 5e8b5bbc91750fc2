"""R11 and R40, what is the result based on? Reports filters, forces, and what the prior decides."""

from collections.abc import Iterator

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.suitability import GROUPS, SHOWN_SHARE, informed, prior_values
from kinertia.diagnostics.runner import check
from kinertia.estimation.result.leg_moments import forces_used
from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where

_LEAST_SHARE = Limit(0.01)
"""Frames with less weight, from which share on they are mentioned."""


@check("R111", "R112", share=_LEAST_SHARE)
def filters(context: ResultContext) -> Iterator[Finding]:
    """Report R111 and R112: a cutoff that was chosen (R111), and impacts that were given less weight (R112)."""
    for trial in context.fit.trials if context.fit.settings.cutoff_hz == "gcv" else ():
        yield finding("R111", Where(trial=trial.name), cutoff_hz=Quantity(trial.kinematics.cutoff_hz, "Hz"))
    posterior = context.fit.posterior
    shares = () if posterior is None else posterior.down_weighted
    for trial, share in zip(context.fit.trials, shares, strict=False):
        if share > _LEAST_SHARE:
            yield finding("R112", Where(trial=trial.name), share=Quantity(share, "1", limit=_LEAST_SHARE))


@check("R402", "R403", "R404")
def basis(context: ResultContext) -> Iterator[Finding]:
    """Report which part of the result rests on assumptions, or on the prior."""
    fit = context.fit
    for trial in fit.trials:
        used = forces_used(trial.reactions, fit.settings, trial.motion_hz)
        impact = Quantity(trial.reactions.impact_n, "N")
        yield finding("R402", Where(trial=trial.name), which=Quantity(used.which), impact_n=impact)
    if fit.posterior is None:
        yield finding("R403")
    for output, group in GROUPS.items():
        shown = informed(fit, output)
        if shown is not None and shown.informed < SHOWN_SHARE * shown.total:
            counts = {"shown": Quantity(shown.informed, "1"), "count": Quantity(shown.total, "1")}
            words = {"group": Quantity(group.nouns), "values": Quantity(prior_values(fit))}
            yield with_evidence("R404", Where(part=group.nouns), counts | words)
