"""Determines the sign of the plates' free moments: the one with which the estimate fits better.

In some laboratories, all files have the wrong sign of the vertical moments: the free moments are then wrong by twice
their own size. The estimates with either sign show which is likelier, for all trials of a person together
(`uncertainty.evidence`). For 28 measured trials from eight laboratories the log odds of the opposite sign are
between -50 and -2.6 where the sign is right. Where it is wrong, they are 12 to 59 in walks and squats; in drop jumps,
which contain little information, 1 and 5.

Where the sign stays undetermined, a plate that only one sign displaces does not count as displaced: in a drop jump
whose plates are positioned correctly to 1 mm, the wrong sign displaces one by 26 mm.

A second estimate takes as long as the first, so two quicker tests come first. The residual vertical moment of measured
forces and motion is at least 1.2 times as large with the sign reversed in most fault-free trials, and at most 0.83
times in most faulty ones, for which the reversed sign is tried first. Then the quadratic at the optimum predicts the
odds, mostly within 1 of those that the second estimate gives, otherwise in favour of the sign that was not tried.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinertia.estimation.prepared import Prepared
from kinertia.estimation.simultaneous.fit import SimultaneousFit, compared_with
from kinertia.estimation.simultaneous.instruments.instrument_errors import OTHER_SIGN, POSITION, CalibrationEntry
from kinertia.estimation.simultaneous.instruments.priors import InstrumentPrior
from kinertia.estimation.simultaneous.mixture_prior import FaultMixture
from kinertia.estimation.simultaneous.uncertainty.evidence import FreeMomentSign
from kinertia.motion.dynamics import residual
from kinertia.motion.kinematics import Kinematics
from kinertia.trial.ground_contact import FIRM_LOAD_N, free_moment, with_turned_free_moments
from kinertia.trial.sampled_data import rms

_LARGE = 0.5
"""Share of the residual below which twice the free moments are too small for the measured motion to judge."""
_PLAINLY = 1.2
"""Ratio of the residuals, reversed over measured sign, above which the sign is right; below its inverse the reversed
sign is tried first."""
_NONE_NM = 0.2
"""RMS below which free moments are negligible: reversed, they change no joint moment by more than twice that."""
VERTICAL = 4
"""Index of the vertical moment in a wrench."""


@dataclass(frozen=True, eq=False)
class Signed:
    """The estimate with the likelier sign of the free moments.

    Attributes:
        fitted: the estimate; its posterior holds the sign.
        ready: the prepared person with the free moments used.
    """

    fitted: SimultaneousFit
    ready: Prepared


def with_likelier_sign(ready: Prepared, fit: Callable[[Prepared, Sequence[Kinematics]], SimultaneousFit]) -> Signed:
    """Fit a person's trials with the free moments as measured, or with reversed sign if that is likelier.

    Args:
        ready: the person.
        fit: the simultaneous estimate of a person, which also evaluates the same trials with other ground reactions.
    """
    rms_nm = rms(np.concatenate([_free_nm(k.foot_loads) for k in ready.kinematics]))
    residual = _reversal_ratio(ready) if rms_nm >= _NONE_NM else np.inf
    if residual > _PLAINLY:
        return Signed(fit(ready, ()), ready)
    turned = tuple(
        replace(k, trial=replace(k.trial, loads=with_turned_free_moments(k.trial.loads))) for k in ready.kinematics
    )
    other = replace(ready, kinematics=turned)
    likely_wrong = residual < 1.0 / _PLAINLY
    first, second = (other, ready) if likely_wrong else (ready, other)
    fitted = fit(first, second.kinematics)
    found, otherwise = fitted.result.evidence
    to_turned = -1.0 if likely_wrong else 1.0
    sign = FreeMomentSign(0.0 if otherwise is None else to_turned * (otherwise - found), rms_nm)
    if not sign.open and sign.wrong is likely_wrong:
        return Signed(_with_sign(fitted, sign), first)
    instead = fit(second, ())
    sign = FreeMomentSign(to_turned * (instead.result.evidence.found - found), rms_nm)
    kept, used, beside = (fitted, first, instead) if sign.wrong is likely_wrong else (instead, second, fitted)
    if not sign.open:
        return Signed(_with_sign(kept, sign), used)
    kept, known = compared_with(kept, beside), used.uncertainty.instruments
    undisputed = with_undisputed_plates(known, kept.posterior.instrument_errors)
    if undisputed is not known:
        again = fit(replace(used, uncertainty=replace(used.uncertainty, instruments=undisputed)), ())
        kept = compared_with(again, beside)
    return Signed(_with_sign(kept, sign), used)


def with_undisputed_plates(known: InstrumentPrior, errors: Sequence[CalibrationEntry]) -> InstrumentPrior:
    """Return the prior without large plate displacements along axes on which only one sign displaces a plate.

    Both signs are equally likely, and the plate is more likely where the file has it. Its position keeps the standard
    deviation of all plates, which then enters the uncertainty of the moments.
    """
    disputed = {error.axis for error in errors if error.quantity == POSITION and error.contradicted_by == OTHER_SIGN}
    if not disputed:
        return known
    certain = {name: FaultMixture.certain(prior.sd) for name, prior in known.plate.items() if name in disputed}
    return replace(known, plate={**known.plate, **certain})


def _with_sign(fitted: SimultaneousFit, sign: FreeMomentSign) -> SimultaneousFit:
    return replace(fitted, posterior=replace(fitted.posterior, free_moment_sign=sign))


def _reversal_ratio(ready: Prepared) -> float:
    """Return how many times as large the residual vertical moment is with the sign reversed, averaged over the trials.

    It is the residual of forces and measured motion with literature parameters.
    """
    ratios = []
    for k in ready.kinematics:
        moment_nm = residual(ready.skeleton, ready.literature, k.motion, k.foot_loads.sum(axis=1))[:, VERTICAL]
        as_is, turned = _rms_moments_nm(moment_nm, _free_nm(k.foot_loads))
        ratios.append(turned / as_is)
    return float(np.exp(np.mean(np.log(ratios))))


def residual_moments_nm(residual: np.ndarray, foot_loads: np.ndarray) -> tuple[float, float]:
    """Return the RMS residual vertical moment (N m, mean removed), as measured and with the free moments reversed.

    Both are equal where the free moments are too small to judge.

    Args:
        residual: (w,) N m, residual as measured.
        foot_loads: (w, 2, 6) on both feet.
    """
    free = _free_nm(foot_loads)
    as_is, turned = _rms_moments_nm(residual, free)
    return (as_is, as_is) if 2.0 * np.std(free) < _LARGE * as_is else (as_is, turned)


def residual_moments_without_offsets_nm(residual: np.ndarray, foot_loads: np.ndarray) -> tuple[float, float]:
    """Return the results of `residual_moments_nm`, less moment errors proportional to the load of either foot.

    A displaced plate under one foot is not a wrong sign, although the reversed moments may fit the motion better.
    """
    free = _free_nm(foot_loads)
    loads = np.column_stack([foot_loads[..., 1], np.ones(len(residual))])
    both = np.column_stack([residual, residual + 2.0 * free])
    rest = both - loads @ np.linalg.lstsq(loads, both, rcond=None)[0]
    as_is, turned = (float(spread_nm) for spread_nm in rest.std(axis=0))
    return as_is, turned


def _rms_moments_nm(residual: np.ndarray, free: np.ndarray) -> tuple[float, float]:
    return float(np.std(residual)), float(np.std(residual + 2.0 * free))


def _free_nm(foot_loads: np.ndarray) -> np.ndarray:
    """Return the sum (w,) N m of both feet's free moments, from loads (w, 2, 6)."""
    firm = foot_loads[..., 1] >= FIRM_LOAD_N
    result: np.ndarray = free_moment(np.where(firm[..., None], foot_loads, 0.0)).sum(axis=1)
    return result
