"""Reports instrument errors that estimates have corrected, and instruments that differ within a session: S50.

Where an error moves joint moments beyond their error bars and nothing contradicts it, the instrument is its cause.
Otherwise the model may equally be the cause: soft tissue that lags looks like a delay of the forces, a trunk that bends
like a displaced plate. Such an error is called apparent and is no reason to check an instrument.
"""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.runner import check
from kinertia.estimation.simultaneous.instruments.instrument_errors import DELAY, NOTABLE, ZERO, CalibrationEntry
from kinertia.estimation.simultaneous.instruments.priors import DELAY_PRIOR_S, TRIAL_DELAY_PRIOR_S, ZERO_PRIOR_N
from kinertia.findings.finding import Finding, Severity, finding, with_evidence
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.model.skeleton import GRAVITY_M_S2

_FEWEST = 2
"""Equal errors of so many plates may be the error of all: of a single plate it is its own."""
APART_SD = Limit(3.0)


def reported(prior_sd: float, unit: str) -> Limit:
    """Return the limit of an instrument error with this prior SD: twice it; usual is what the prior expects."""
    return Limit(NOTABLE * prior_sd, unit, usual=(-prior_sd, prior_sd))


def corrected(
    context: ResultContext, code: str, headline: str, errors: Iterable[CalibrationEntry], largest: float = np.inf
) -> list[Finding]:
    """List a finding for each of these errors that was found; arguments as in `correction`."""
    return [correction(code, headline, context.at(error), error, largest) for error in errors if error.found]


def correction(code: str, headline: str, where: Where, error: CalibrationEntry, largest: float = np.inf) -> Finding:
    """Return an error's finding; `headline` names its main quantity. An error above `largest` is a WARNING."""
    unsure = not error.supported
    evidence = {
        headline: Quantity(
            error.value, error.unit, NOTABLE * error.prior_sd, (-error.prior_sd, error.prior_sd), error.sd
        ),
        "moved": Quantity(error.moved or 0.0, "1", limit=1.0),
        "kind": Quantity("an apparent" if unsure else "a clear"),
        "condition": Quantity(" if other people's trials also show it" if unsure else ""),
    }
    since = f", since {error.contradicted_by} contradicts it" if error.contradicted_by else ""
    causes = (f"soft tissue or the model{since}", "the instrument") if unsure else ("the instrument",)
    return with_evidence(code, where, evidence, Severity.WARNING if abs(error.value) > largest else None, causes)


def equal(errors: Sequence[CalibrationEntry], usual_sd: float = np.inf) -> bool:
    """Return whether errors of the same quantity of several plates have all been found, and differ no more than errors
    of single plates do: by their prior SD, or this one if it is smaller.
    """
    if len(errors) < _FEWEST or not all(error.found for error in errors):
        return False
    values = [error.value for error in errors]
    usual = NOTABLE * np.sqrt(2) * min(usual_sd, *(error.prior_sd for error in errors))
    return min(values) * max(values) > 0.0 and max(values) - min(values) <= usual


@check("T214", "T215", delay=reported(DELAY_PRIOR_S.sd, "s"), trial_delay=reported(TRIAL_DELAY_PRIOR_S.sd, "s"))
def delays(context: ResultContext) -> Iterator[Finding]:
    """Report the common delay of all forces, and the additional delays of several trials; of one trial its total.

    A delay within its prior is reported, too, if joint moments would leave their error bars without its correction.
    """
    common = [error for error in context.errors if error.quantity == DELAY and error.trial is None]
    of_trials = [error for error in context.errors if error.quantity == DELAY and error.trial is not None]
    if of_trials and len(context.fit.trials) == 1:
        common, of_trials = of_trials, []
    for code, errors in (("T214", common), ("T215", of_trials)):
        yield from (
            correction(code, "delay_s", context.at(error), error)
            for error in errors
            if error.found or error.moves_moments
        )


@check("P214", "P215", zero=reported(ZERO_PRIOR_N.sd, "N"))
def zero_offsets(context: ResultContext) -> Iterator[Finding]:
    """Report zero offsets that were corrected, and those that all plates of a trial share: an unmeasured force."""
    zeros = [error for error in context.errors if error.quantity == ZERO]
    yield from corrected(context, "P215", "zero_offset_n", zeros)
    for trial, axis in dict.fromkeys((zero.trial, zero.axis) for zero in zeros):
        of_axis = [zero for zero in zeros if (zero.trial, zero.axis) == (trial, axis)]
        if equal(of_axis):
            read_n = tuple(zero.value for zero in of_axis)
            yield finding(
                "P214",
                context.along(axis, trial),
                force_n=Quantity(float(np.mean(read_n)), "N", sd=max(zero.sd for zero in of_axis)),
                tilt_rad=Quantity(
                    float(np.arctan(np.sum(read_n) / (GRAVITY_M_S2 * context.ready.total_mass.total_kg))), "rad"
                ),
                zero_offset_n=Quantity(read_n, "N", limit=2.0 * of_axis[0].prior_sd),
            )


def session_contradictions(
    person: str, of_person: Sequence[CalibrationEntry], others: Sequence[CalibrationEntry]
) -> Iterator[Finding]:
    """Report S501: instrument errors that differ between one person's trials and the others' in a session.

    Args:
        person: name of the person.
        of_person, others: errors of instruments by their trials.
    """
    by_others = {entry.key: entry for entry in others}
    for error in of_person:
        other = by_others.get(error.key, error)
        apart_sd = float(np.hypot(error.sd, other.sd))
        if abs(error.value - other.value) > APART_SD * apart_sd:
            yield finding(
                "S501",
                Where(plate=error.plate, part=f"{error} by {person}"),
                error=Quantity(error.value, error.unit, sd=error.sd),
                other_error=Quantity(other.value, error.unit, sd=other.sd),
                sd=Quantity(apart_sd, error.unit, limit=APART_SD * apart_sd),
                person=Quantity(person),
                instrument=Quantity(str(error)),
            )
