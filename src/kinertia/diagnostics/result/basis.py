"""R11 and R40, what is the result based on? Filters, forces, segments without markers, and what the prior decides."""

from __future__ import annotations

from collections.abc import Iterator

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.suitability import GROUPS, SHOWN_SHARE, informed
from kinertia.estimation.forces_used import forces_used
from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.gait27 import ARM_COORDINATES, VIRTUAL_TRUNK

_LEAST_SHARE = 0.01
"""Frames with less weight, from which share on they are mentioned."""


def filters(context: ResultContext) -> Iterator[Finding]:
    """R111, a cutoff that was chosen, and R112, impacts that count less."""
    for trial in context.fit.trials if context.fit.settings.cutoff_hz == "gcv" else ():
        yield finding("R111", Where(trial=trial.name), cutoff_hz=Quantity(trial.kinematics.cutoff_hz, "Hz"))
    posterior = context.fit.posterior
    shares = () if posterior is None else posterior.down_weighted
    for trial, share in zip(context.fit.trials, shares, strict=False):
        if share > _LEAST_SHARE:
            yield finding("R112", Where(trial=trial.name), share=Quantity(share, "1", limit=_LEAST_SHARE))


def basis(context: ResultContext) -> Iterator[Finding]:
    """What of the result is assumption, or the prior's."""
    fit = context.fit
    yield from unseen_body(context)
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
            yield with_evidence("R404", Where(part=group.nouns), counts | {"group": Quantity(group.nouns)})


def unseen_body(context: ResultContext) -> Iterator[Finding]:
    """R401 of a 27-DOF model that was adapted to its trials.

    Differences of the joint moments (RMS) with and without the markers of arms and head are 0.1 to 5 N m at the legs in
    the walks of gait2354 and of Rajagopal's model, and without those of all of the upper body 1 to 7 N m.
    """
    skeleton = context.ready.skeleton
    held = [name for name in ARM_COORDINATES if name in skeleton.locked]
    joined = len(held) == len(ARM_COORDINATES)
    if VIRTUAL_TRUNK[0].label in skeleton.labels:
        upper = "trunk, arms and head are one upright segment" if joined else "trunk and head are one upright segment"
        yield _unseen("the trunk", upper)
    elif joined:
        yield _unseen("the arms", "trunk, arms and head are one segment, the arms hanging")
    elif held:
        yield _unseen(", ".join(held), "the arm hangs along the trunk")


def _unseen(part: str, assumed: str) -> Finding:
    return finding("R401", Where(part=part), assumed=Quantity(assumed))
