"""Can this result be used? Verdicts in words on a finished fit; the thresholds stand here and nowhere else.

Residuals are judged by OpenSim's published guideline for residual reduction ("Simulation with OpenSim - Best Practices"
and Hicks et al. 2015, J Biomech Eng 137:020905), which also wants the peak force below 5 % of the largest external
force. OpenSim judges each axis on its own; here it is the length of the vector, as in `fit.json`, which is stricter.
Judged are residuals with forces at the motion's bandwidth: what is faster no motion of the model can follow. Those with
forces at full bandwidth, which OpenSim's tools find, stand beside them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from kinertia.diagnostics.result.warnings import CONTRADICTING_COM_M
from kinertia.estimation.forces_used import full_bandwidth
from kinertia.estimation.simultaneous.fit import CONTRADICTION_SD
from kinertia.model.bsp import PARAMETERS, impossible_segments
from kinertia.model.centre_offsets import centre_offsets
from kinertia.trial.rms import rms

if TYPE_CHECKING:
    from kinertia.estimation.result import Fit, TrialFit

Level = Literal["pass", "caution", "fail"]

PASS_FORCE_N, CAUTION_FORCE_N = (5.0, 10.0), (10.0, 25.0)
"""Residual force: largest RMS, largest peak."""
PASS_MOMENT_NM, CAUTION_MOMENT_NM = (30.0, 50.0), (50.0, 75.0)
"""Residual moment: largest RMS, largest peak."""
PEAK_FORCE_SHARE = 0.05
"""Largest share of the peak external force that the peak residual force may have."""

PASS_MARKERS_M, CAUTION_MARKERS_M = 0.012, 0.020
"""RMS distance of the markers: OpenSim's guideline for inverse kinematics is 20 mm."""
_WRONG_MODEL_M = 0.045
"""Farther apart are markers of a sound model on nobody, wherever they sit."""

PLAIN_CONTRADICTION_SD = 4.0
"""A parameter this many prior SDs from the literature contradicts the model by itself: chance brings it about in one of
16 000."""
MOST_DOUBTED_SEGMENTS = 2
"""Segments with a parameter beyond `CONTRADICTION_SD` that are taken with care; more contradict the whole model."""

_NAMED = 4


class Verdict(NamedTuple):
    """One judgement: "pass", "caution" or "fail", and why, in one sentence.

    Examples:
        >>> kinertia.verdicts(fit)[0]
        Verdict(level='pass', sentence='the estimate converged')
    """

    level: Level
    sentence: str


def verdicts(fit: Fit) -> list[Verdict]:
    """Can a fit be used? Convergence, physics, the literature, residuals and markers of every trial."""
    judged = [_convergence(fit), _physics(fit), _literature(fit)]
    for trial in fit.trials:
        judged += [*residual_verdicts(trial), verdict_of_markers(fit, trial)]
    return judged


def stands_against(judged: Iterable[Verdict]) -> bool:
    """Whether any check failed: exit status 1."""
    return any(verdict.level == "fail" for verdict in judged)


def worst_level(judged: Iterable[Verdict]) -> Level:
    """The worst of the levels; "pass" of none."""
    levels = {verdict.level for verdict in judged}
    return "fail" if "fail" in levels else "caution" if "caution" in levels else "pass"


def _convergence(fit: Fit) -> Verdict:
    if fit.converged:
        return Verdict("pass", "the estimate converged")
    return Verdict("fail", "the estimate did not converge: the best step is reported")


def impossible_estimates(fit: Fit) -> tuple[list[str], list[str]]:
    """Segments that are physically impossible: of those that were estimated, and of the light ones that a model has and
    that were kept as they are.
    """
    impossible = impossible_segments(fit.estimate)
    held = set()
    if fit.posterior is not None:
        kept = np.flatnonzero(~fit.posterior.prior_sd.any(axis=1))
        held = {fit.estimate.segments[i] for i in kept}
    return [name for name in impossible if name not in held], [name for name in impossible if name in held]


def _physics(fit: Fit) -> Verdict:
    estimated, kept = impossible_estimates(fit)
    if not estimated and not kept:
        return Verdict("pass", "every segment is physically possible")
    if not estimated:
        return Verdict(
            "caution", f"physically impossible in the model, and kept as they are: {first_few(kept, _NAMED)}"
        )
    count = f"{len(estimated)} of {len(fit.estimate.segments)}"
    return Verdict("fail", f"physically impossible segments: {count} ({first_few(estimated, _NAMED)})")


def first_few(names: Sequence[str], most: int) -> str:
    """The first of a list, and how many more there are."""
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


def _literature(fit: Fit) -> Verdict:
    """The estimate against what it was expected to be near: in prior SDs where there are any."""
    if fit.posterior is None:
        change = fit.estimate.table() - fit.literature.table()
        moved = np.linalg.norm(change[:, 1:4], axis=1)
        worst = int(np.argmax(moved))
        doubted, plain = [], True
        far = int((moved > CONTRADICTING_COM_M).sum())
        kind, limit = ("centre of mass", "centres of mass"), f"{CONTRADICTING_COM_M * 1e3:g} mm"
        farthest = f"{fit.estimate.segments[worst]}, {moved[worst] * 1e3:.0f} mm"
    else:
        away = away_from_expected(fit)
        row, column = np.unravel_index(int(np.argmax(away)), away.shape)
        far = int((away > CONTRADICTION_SD).sum())
        doubted = [fit.estimate.segments[i] for i in np.flatnonzero((away > CONTRADICTION_SD).any(axis=1))]
        plain = contradicts(away)
        kind, limit = ("parameter", "parameters"), f"{CONTRADICTION_SD:g} prior SDs"
        farthest = f"{PARAMETERS[column]} of {fit.estimate.segments[row]}, {away[row, column]:.1f}"
    source = expected_source(fit)
    count = f"{far or 'no'} {kind[far > 1]} {'lie' if far > 1 else 'lies'}"
    said = f"{count} more than {limit} from {source} (farthest: {farthest})"
    if not far:
        return Verdict("pass", said)
    if plain:
        return Verdict("fail", f"{said}: the data contradict the model")
    return Verdict("caution", f"{said}: take {' and '.join(doubted)} with care")


def away_from_expected(fit: Fit) -> np.ndarray:
    """(s, 10) how far parameters are from where they were expected, in prior SDs; zero where they were kept."""
    assert fit.posterior is not None
    scale = np.where(fit.posterior.prior_sd > 0, fit.posterior.prior_sd, np.inf)
    result: np.ndarray = np.abs(fit.estimate.table() - fit.expected.table()) / scale
    return result


def contradicts(away: np.ndarray) -> bool:
    """Whether parameters (s, 10) that are so many prior SDs away contradict the model, and not a segment or two."""
    doubted = (away > CONTRADICTION_SD).any(axis=1).sum()
    return bool(doubted > MOST_DOUBTED_SEGMENTS or away.max() > PLAIN_CONTRADICTION_SD)


def expected_source(fit: Fit) -> str:
    """Where what the estimate was expected to be near is from."""
    if fit.more_known:
        return "the prior"
    return "the literature" if fit.file is None else "the model's own values"


def residual_verdicts(trial: TrialFit) -> list[Verdict]:
    """Force, moment and share of the peak external force that one trial leaves unexplained."""
    force, moment = _lengths(trial.residuals["estimate"])
    whole = _lengths(trial.full_residuals["estimate"])
    at, full = f"at the motion's bandwidth ({trial.motion_hz:.3g} Hz)", full_bandwidth(trial.reactions)
    external = float(np.linalg.norm(trial.kinematics.foot_loads[:, :, :3].sum(axis=1), axis=1).max())
    share = float(force.max()) / external
    small: Level = "pass" if share <= PEAK_FORCE_SHARE else "fail"
    return [
        _and(
            _by_guideline(f"{trial.name}: residual force {at}", "N", force, PASS_FORCE_N, CAUTION_FORCE_N),
            f"with {full} RMS {rms(whole[0]):.1f} N",
        ),
        _and(
            _by_guideline(f"{trial.name}: residual moment {at}", "N m", moment, PASS_MOMENT_NM, CAUTION_MOMENT_NM),
            f"with {full} RMS {rms(whole[1]):.1f} N m",
        ),
        Verdict(
            small,
            f"{trial.name}: the peak residual force is {100 * share:.1f} % of the peak external force "
            f"({external:.0f} N); at most {100 * PEAK_FORCE_SHARE:g} % is acceptable",
        ),
    ]


def _lengths(residual: np.ndarray) -> list[np.ndarray]:
    """Lengths (w,) of force and moment of a residual (w, 6)."""
    return [np.linalg.norm(part, axis=1) for part in np.hsplit(residual, 2)]


def _and(verdict: Verdict, remark: str) -> Verdict:
    """The same with something to know beside it."""
    return verdict._replace(sentence=f"{verdict.sentence}; {remark}")


def verdict_of_markers(fit: Fit, trial: TrialFit) -> Verdict:
    """How far the model's markers are from the measured ones, at the motion that the forces go with."""
    apart_m = rms(trial.marker_errors_m["final"])
    sentence = f"{trial.name}: model and measured markers are {apart_m * 1e3:.1f} mm apart (RMS)"
    if apart_m <= PASS_MARKERS_M:
        return Verdict("pass", f"{sentence}; well within OpenSim's guideline ({CAUTION_MARKERS_M * 1e3:g} mm)")
    if apart_m <= CAUTION_MARKERS_M:
        return Verdict(
            "caution", f"{sentence}; within OpenSim's guideline ({CAUTION_MARKERS_M * 1e3:g} mm), marginally"
        )
    advice = "; let markers and joint centres move (--calibrate)"
    # what moves hides what is grossly wrong, and helps no more where it has moved
    if apart_m > _WRONG_MODEL_M or centre_offsets(fit.skeleton):
        advice = "; see whether the model was scaled to this person, and whether all labels are right"
    advice = "" if fit.file is None else advice
    return Verdict("fail", f"{sentence}, beyond OpenSim's guideline ({CAUTION_MARKERS_M * 1e3:g} mm){advice}")


def _by_guideline(
    what: str, unit: str, size: np.ndarray, passing: tuple[float, float], marginal: tuple[float, float]
) -> Verdict:
    """Verdict on vector lengths (w,) by limits of RMS and peak."""
    typical, peak = rms(size), float(size.max())
    sentence = f"{what} RMS {typical:.1f} {unit}, peak {peak:.1f} {unit}"
    levels: tuple[tuple[Level, str, tuple[float, float]], ...] = (
        ("pass", "well within", passing),
        ("caution", "marginally within", marginal),
    )
    for level, where, limits in levels:
        if typical <= limits[0] and peak <= limits[1]:
            return Verdict(
                level, f"{sentence}: {where} OpenSim's guideline (at most {limits[0]:g} and {limits[1]:g} {unit})"
            )
    return Verdict(
        "fail", f"{sentence}: beyond OpenSim's guideline (at most {marginal[0]:g} and {marginal[1]:g} {unit})"
    )
