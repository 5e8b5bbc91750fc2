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
    return [correction(code, headline, context.at(one), one, largest) for one in errors if one.found]


def correction(code: str, headline: str, where: Where, one: CalibrationEntry, largest: float = np.inf) -> Finding:
    """Return an error's finding; `headline` names its main quantity. An error above `largest` is a WARNING."""
    unsure = not one.supported
    evidence = {
        headline: Quantity(one.value, one.unit, NOTABLE * one.prior_sd, (-one.prior_sd, one.prior_sd), one.sd),
        "moved": Quantity(one.moved or 0.0, "1", limit=1.0),
        "kind": Quantity("an apparent" if unsure else "a clear"),
        "condition": Quantity(" if other people's trials also show it" if unsure else ""),
    }
    since = f", since {one.contradicted_by} contradicts it" if one.contradicted_by else ""
    causes = (f"soft tissue or the model{since}", "the instrument") if unsure else ("the instrument",)
    return with_evidence(code, where, evidence, Severity.WARNING if abs(one.value) > largest else None, causes)


def equal(errors: Sequence[CalibrationEntry], usual_sd: float = np.inf) -> bool:
    """Return whether errors of the same quantity of several plates have all been found, and differ no more than errors
    of single plates do: by their prior SD, or this one if it is smaller.
    """
    if len(errors) < _FEWEST or not all(one.found for one in errors):
        return False
    values = [one.value for one in errors]
    usual = NOTABLE * np.sqrt(2) * min(usual_sd, *(one.prior_sd for one in errors))
    return min(values) * max(values) > 0.0 and max(values) - min(values) <= usual


@check("T214", "T215", delay=reported(DELAY_PRIOR_S.sd, "s"), trial_delay=reported(TRIAL_DELAY_PRIOR_S.sd, "s"))
def delays(context: ResultContext) -> Iterator[Finding]:
    """Report the common delay of all forces, and the additional delays of several trials; of one trial its total.

    A delay within its prior is reported, too, if joint moments would leave their error bars without its correction.
    """
    common = [one for one in context.errors if one.quantity == DELAY and one.trial is None]
    own = [one for one in context.errors if one.quantity == DELAY and one.trial is not None]
    if own and len(context.fit.trials) == 1:
        common, own = own, []
    for code, errors in (("T214", common), ("T215", own)):
        yield from (
            correction(code, "delay_s", context.at(one), one) for one in errors if one.found or one.moves_moments
        )


@check("P214", "P215", zero=reported(ZERO_PRIOR_N.sd, "N"))
def zero_offsets(context: ResultContext) -> Iterator[Finding]:
    """Report zero offsets that were corrected, and those that all plates of a trial share: an unmeasured force."""
    zeros = [one for one in context.errors if one.quantity == ZERO]
    yield from corrected(context, "P215", "zero_offset_n", zeros)
    for trial, axis in dict.fromkeys((one.trial, one.axis) for one in zeros):
        own = [one for one in zeros if (one.trial, one.axis) == (trial, axis)]
        if equal(own):
            read_n = tuple(one.value for one in own)
            yield finding(
                "P214",
                context.along(axis, trial),
                force_n=Quantity(float(np.mean(read_n)), "N", sd=max(one.sd for one in own)),
                tilt_rad=Quantity(
                    float(np.arctan(np.sum(read_n) / (GRAVITY_M_S2 * context.ready.total_mass.total_kg))), "rad"
                ),
                zero_offset_n=Quantity(read_n, "N", limit=2.0 * own[0].prior_sd),
            )


def session_contradictions(
    person: str, own: Sequence[CalibrationEntry], others: Sequence[CalibrationEntry]
) -> Iterator[Finding]:
    """Report S501: instrument errors that differ between one person's trials and the others' in a session.

    Args:
        person: name of the person.
        own, others: errors of instruments by their trials.
    """
    by_others = {one.key: one for one in others}
    for one in own:
        other = by_others.get(one.key, one)
        apart_sd = float(np.hypot(one.sd, other.sd))
        if abs(one.value - other.value) > APART_SD * apart_sd:
            yield finding(
                "S501",
                Where(plate=one.plate, part=f"{one} by {person}"),
                error=Quantity(one.value, one.unit, sd=one.sd),
                other_error=Quantity(other.value, one.unit, sd=other.sd),
                sd=Quantity(apart_sd, one.unit, limit=APART_SD * apart_sd),
                person=Quantity(person),
                instrument=Quantity(str(one)),
            )
