"""P22, are the plates' gains right, and P28, is all of the load on them? Reports what the estimate found.

The estimate determines gains only from the stated mass: plates that read a tenth more may read too much, or carry a
tenth more. Two plates have two amplifiers and two calibrations, but a person has one mass, so an error common to both
plates is first attributed to the mass, or to something carried.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.corrections import corrected, equal
from kinertia.estimation.simultaneous.calibration_entry import GAIN, CalibrationEntry
from kinertia.estimation.simultaneous.uncertainty.missing_load_evidence import SURE
from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where

_AMPLIFIER = "a calibration, amplifier or unit that all plates have in common"
_MORE = ("something worn or carried that the stated mass leaves out", "a wrong stated mass", _AMPLIFIER)
_LESS = ("a wrong stated mass", "support that no plate measures (handrail, walker, crutches, harness)", _AMPLIFIER)


def gains(context: ResultContext) -> Iterator[Finding]:
    """Report gain errors that were corrected, and one that all plates share, in all trials or in one."""
    errors = [one for one in context.errors if one.quantity == GAIN]
    yield from corrected(context, "P223", "gain_error", _certain(errors))
    lasting = [one for one in errors if one.trial is None]
    if equal(lasting):
        yield _of_all(context, lasting)
        return
    usual = min((one.prior_sd for one in lasting), default=np.inf)
    for trial in dict.fromkeys(one.trial for one in errors if one.trial is not None):
        own = [one for one in errors if one.trial == trial]
        if equal(own, usual):
            yield _of_all(context, own)


def missing_loads(context: ResultContext) -> Iterator[Finding]:
    """Report P288: plates of whose loads a part is missing, which is no error of their gain."""
    posterior = context.fit.posterior
    for one in () if posterior is None else posterior.missing_loads:
        missing = Quantity(one.missing, "1", sd=one.sd)
        log_odds = Quantity(one.log_odds, "1", limit=SURE)
        yield finding(
            "P288", Where(trial=one.trial, plate=one.plate, span_s=one.span_s), missing=missing, log_odds=log_odds
        )


def _of_all(context: ResultContext, gains: Sequence[CalibrationEntry]) -> Finding:
    """Report P224: a gain error of all plates, with the masses that the forces of the trials correspond to."""
    trial, total = gains[0].trial, context.ready.total_mass
    sd, limit = max(one.sd for one in gains), 2.0 * gains[0].prior_sd
    evidence = {"gain_error": Quantity(tuple(one.value for one in gains), "1", limit, sd=sd)}
    masses = tuple(float(mass.mass_kg) for name, mass in context.force_masses.items() if trial in (None, name))
    if masses:
        evidence["mass_by_force_kg"] = Quantity(masses, "kg")
    evidence["stated_kg"] = Quantity(total.total_kg, "kg", sd=total.sd_kg)
    evidence["plates"] = Quantity(", ".join(str(one.plate) for one in gains))
    return with_evidence("P224", Where(trial=trial), evidence, causes=_MORE if gains[0].value > 0.0 else _LESS)


def _certain(errors: Sequence[CalibrationEntry]) -> Iterator[CalibrationEntry]:
    """Yield the gain of a plate over all trials where that is certain, else its gain in each trial."""
    lasting = {one.plate: one for one in errors if one.trial is None}
    of_trials = {one.plate for one in errors if one.trial is not None}
    for one in errors:
        whole = one.plate not in of_trials or lasting[one.plate].supported
        if whole == (one.trial is None):
            yield one
