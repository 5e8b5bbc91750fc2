"""P26, are the free moments right? Reports a wrong sign, and errors found by the estimate.

In some measured walks the motion needs free moments that differ from the measured ones by 3 to 6 N m/kN, in opposite
directions under the right and the left foot; in single support the vertical moment is also wrong by 1 to 3 N m before
the estimate. If reversing their sign does not explain it, two plates are unlikely to be the cause. The model is more
likely: an error of some tenths of a kg m2/s in the angular momentum of legs, trunk and arms has this effect, and a
trunk that bends, or skin over pelvis and shoulders, can cause it. The error of a plate appears under one foot, or under
both in the same direction, and in the mean over whole strides.
"""

from collections.abc import Iterator, Sequence

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.corrections import corrected
from kinertia.estimation.free_moment_sign import VERTICAL, residual_moments_nm, residual_moments_without_offsets_nm
from kinertia.estimation.simultaneous.calibration_entry import FREE_MOMENT, CalibrationEntry
from kinertia.estimation.trial_fit import TrialFit
from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where

_LESS = 0.8
"""Share of the residual as measured, below which the residual with the sign reversed speaks against the sign."""
_ONE_SIDED = 0.5
"""Share of the errors' sizes above which their sum is not that of mirror images."""


def free_moments(context: ResultContext) -> Iterator[Finding]:
    """Report a wrong sign of the free moments, and the errors that remain once it is right."""
    posterior = context.fit.posterior
    if posterior is None:
        for trial in context.fit.trials:
            yield from reversed_sign(trial)
        return
    if sign := posterior.free_moment_sign:
        evidence = {"rms_nm": Quantity(sign.rms_nm, "N m"), "log_odds": Quantity(sign.log_odds, "1")}
        if sign.wrong:
            yield with_evidence("P269", Where(), evidence)
        elif sign.open:
            yield with_evidence("P260", Where(), evidence)
    errors = [one for one in context.errors if one.quantity == FREE_MOMENT]
    yield from corrected(context, "P267", "error_nm_n", errors)
    if mirrored(errors):
        values = tuple(one.value for one in errors)
        plates = Quantity(", ".join(str(one.plate) for one in errors))
        yield finding("P268", error_nm_n=Quantity(values, "N m/N", 2.0 * errors[0].prior_sd), plates=plates)


def mirrored(errors: Sequence[CalibrationEntry]) -> bool:
    """Return whether errors were found under both feet that mirror each other: opposite signs, similar sizes."""
    off = [one.value for one in errors if one.found]
    if not off or not min(off) < 0.0 < max(off):
        return False
    return abs(sum(one.value for one in errors)) <= _ONE_SIDED * sum(abs(one.value) for one in errors)


def reversed_sign(trial: TrialFit) -> Iterator[Finding]:
    """Report P265: a trial whose free moments follow the measured motion once their sign is reversed, for an estimate
    without evidence of its own.
    """
    if not trial.kinematics.complete:
        return
    left, loads = trial.residuals["literature"][:, VERTICAL], trial.kinematics.foot_loads
    as_is, reversed_nm = residual_moments_nm(left, loads)
    without, reversed_without = residual_moments_without_offsets_nm(left, loads)
    if reversed_nm < _LESS * as_is and reversed_without < _LESS * without:
        evidence = {"rms_nm": Quantity(as_is, "N m"), "reversed": Quantity(reversed_nm, "N m", limit=_LESS * as_is)}
        yield with_evidence("P265", Where(trial=trial.name), evidence)
