"""What a result may be used for: one line per output, with its reason and a number.

The checks (`verdict`) judge the estimate as a whole; here it is said what follows for each of the
things that people take from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kinertia.diagnostics.result.verdict import (
    Level,
    Verdict,
    away_from_expected,
    contradicts,
    expected_source,
    impossible_estimates,
    residual_verdicts,
    verdict_of_markers,
    worst_level,
)
from kinertia.estimation.identifiability import INFORMED, MEASURED
from kinertia.estimation.result import Fit
from kinertia.estimation.simultaneous.fit import CONTRADICTION_SD
from kinertia.trial.rms import rms, rms_length

WORDS: dict[Level, str] = {"pass": "use", "caution": "use with care", "fail": "do not use"}
SHOWN_SHARE = 0.5
"""Share of parameters that the data measure or inform from which a table of them is this person's."""
_GROUPS = {
    "segment masses": slice(0, 1),
    "centres of mass": slice(1, 4),
    "moments of inertia": slice(4, 7),
}
_BAND_SD = 1.96


class Use(NamedTuple):
    """Whether an output may be used: "pass" (use), "caution" (use with care) or "fail" (do not use), and why.

    Examples:
        >>> [use.output for use in kinertia.uses(fit)]
        ['joint moments', 'segment masses', 'centres of mass', 'moments of inertia', 'motion']
    """

    output: str
    level: Level
    reason: str

    @property
    def word(self) -> str:
        """The level in words."""
        return WORDS[self.level]


def uses(fit: Fit) -> list[Use]:
    """What may be used: joint moments, segment masses, centres of mass, moments of inertia, motion."""
    segments = [_segments(fit, name, columns) for name, columns in _GROUPS.items()]
    return [_moments(fit), *segments, _motion(fit)]


def _moments(fit: Fit) -> Use:
    """By the residuals of the worst trial, and by the error bars where there are any."""
    verdicts = [verdict for trial in fit.trials for verdict in residual_verdicts(trial)]
    force, moment = (
        max(rms_length(trial.residuals["estimate"][:, part]) for trial in fit.trials)
        for part in (slice(0, 3), slice(3, 6))
    )
    reason = f"residual at most {force:.1f} N and {moment:.1f} N m (RMS)"
    sds = [trial.deviations.moments[:, 6:] for trial in fit.trials if trial.deviations is not None]
    turns = fit.skeleton.rotational[6:]
    if sds and turns.any():
        half = _BAND_SD * rms(np.concatenate(sds)[:, turns]) / fit.mass_kg
        reason += f"; 95 % of the joint moments lie within ± {half:.2f} N m/kg"
    if fit.warnings:  # of plates, clock, markers or masses: joint moments hang on all of them
        verdicts.append(Verdict("caution", ""))
        reason += f"; {len(fit.warnings)} warning{'s' if len(fit.warnings) > 1 else ''} below"
    return Use("joint moments", _with_convergence(fit, verdicts), reason if fit.converged else _NOT_CONVERGED)


_NOT_CONVERGED = "the estimate did not converge"


def _motion(fit: Fit) -> Use:
    verdicts = [verdict_of_markers(fit, trial) for trial in fit.trials]
    apart = 1e3 * max(rms(trial.marker_errors_m["final"]) for trial in fit.trials)
    reason = f"model and measured markers are at most {apart:.1f} mm apart (RMS)"
    sds = [trial.deviations.coordinates[:, 6:] for trial in fit.trials if trial.deviations is not None]
    turns = fit.skeleton.rotational[6:]
    if sds and turns.any():
        half = np.degrees(_BAND_SD * rms(np.concatenate(sds)[:, turns]))
        reason += f"; 95 % of the joint angles lie within ± {half:.1f} degrees"
    return Use("motion", _with_convergence(fit, verdicts), reason if fit.converged else _NOT_CONVERGED)


def _with_convergence(fit: Fit, verdicts: Sequence[Verdict]) -> Level:
    return worst_level(verdicts) if fit.converged else "fail"


def _segments(fit: Fit, name: str, columns: slice) -> Use:
    """By what the data say about these parameters, and by how far they are from the prior, each or together."""
    impossible, _ = impossible_estimates(fit)
    if not fit.converged or impossible:
        why = _NOT_CONVERGED if not fit.converged else f"{len(impossible)} segments are physically impossible"
        return Use(name, "fail", why)
    start = expected_source(fit).removesuffix("'s own values")
    if fit.posterior is None:
        return Use(name, "caution", "no error bars (two-level): nobody knows which of them the data show")
    estimated = fit.posterior.prior_sd[:, columns] > 0
    information = fit.posterior.information[:, columns][estimated]
    shown, measured = int((information > INFORMED).sum()), int((information > MEASURED).sum())
    reason = f"the data show {shown} of {information.size} ({measured} of them well)"
    reason += f"; the others are about as uncertain as {start}'s"
    if shown == information.size:
        reason = f"the data show all {shown} ({measured} of them well)"
    away = away_from_expected(fit)
    beyond = (away[:, columns] > CONTRADICTION_SD).any(axis=1)
    doubted = [fit.estimate.segments[i] for i in np.flatnonzero(beyond)]
    if doubted:
        reason += f"; beyond {CONTRADICTION_SD:g} prior SDs from {start}: {', '.join(doubted)}"
        if contradicts(away):
            return Use(name, "fail", reason)
    whole = fit.posterior.unlikeness
    unlike = whole is not None and whole.unlike
    if whole is not None and unlike:
        reason += f"; as far from {start} as {whole.people}, so that error bars are too small: see the warning below"
    if not shown:
        return Use(name, "fail", f"the data show none of {information.size}: they are about as uncertain as {start}'s")
    sound = shown >= SHOWN_SHARE * information.size and not doubted and not unlike
    return Use(name, "pass" if sound else "caution", reason)
