"""Averages joint moments and angles over phases of each stride, in an estimate and in its posterior draws.

A draw in which only the body, or only plates and synchronisation, depart from the estimate shows what these contribute.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinertia.estimation.cycles import CycleCurve, curves_by_stage
from kinertia.estimation.drawn_fit import drawn_fit, kept_draws
from kinertia.estimation.result import Fit
from kinertia.estimation.simultaneous.uncertainty.posterior_draws import PosteriorDraws
from kinertia.estimation.trial_fit import TrialFit
from kinertia.motion.gait_cycle import PERCENT, Stride

EVENTS = ("loading", "mid-stance", "late stance", "push-off", "swing")
"""Phases of a stride: both feet, the other foot in the air (first half, second half), both feet again, this foot in the
air."""
_FEWER = 2
"""Factor by which draws of instruments are fewer: they only divide a variance."""
_KINDS = {"joint_moment": "moment", "angle": "angle"}
Key = tuple[str, str, str, str]
"""Trial, outcome, side, phase and number of the stride."""


@dataclass(frozen=True, eq=False)
class StrideFeatures:
    """k features of strides in an estimate and in n draws of it.

    Attributes:
        keys: what each is of.
        estimate: (k,) their values.
        drawn: by source (n, k) their values in each draw.
    """

    keys: tuple[Key, ...]
    estimate: np.ndarray
    drawn: Mapping[str, np.ndarray]


def stride_features(
    fit: Fit,
    trials: Sequence[TrialFit],
    sources: Mapping[str, PosteriorDraws],
    count: int,
    progress: Callable[[float], None] = lambda share: None,
) -> StrideFeatures:
    """Compute the features of these trials of a fit.

    Args:
        fit: by the simultaneous estimate.
        trials: some of its trials.
        sources: draws of everything ("all") or of a part (`only`).
        count: number of draws of each, at least two.
        progress: is told the share done.
    """
    estimate, keys = _features(replace(fit, trials=tuple(trials)), None)
    counts = {source: max(2, count // _FEWER) if source == "instruments" else count for source in sources}
    drawn, done = {}, 0
    for source, draws in sources.items():
        rows = []
        for number in range(counts[source]):
            rows.append(_features(_drawn(fit, trials, draws, number, source == "all"), keys)[0])
            done += 1
            progress(done / sum(counts.values()))
        drawn[source] = np.array(rows)
    return StrideFeatures(tuple(keys), estimate, drawn)


def features_of_draw(fit: Fit, trials: Sequence[TrialFit], draws: PosteriorDraws, keys: Sequence[Key]) -> np.ndarray:
    """Return the features (k,) of the first draw, with knees as estimated."""
    return _features(_drawn(fit, trials, draws, 0, False), keys)[0]


def _drawn(fit: Fit, trials: Sequence[TrialFit], draws: PosteriorDraws, number: int, knees: bool) -> Fit:
    assert fit.posterior is not None  # it has draws
    own = replace(draws, trials=tuple(draws.trials[fit.trials.index(trial)] for trial in trials))
    return drawn_fit(replace(fit, trials=tuple(trials), posterior=replace(fit.posterior, draws=own)), number, knees)


def only(draws: PosteriorDraws, body: bool) -> PosteriorDraws:
    """Return draws in which only the body, or only plates and synchronisation, differ from draw to draw."""
    trials = tuple(
        replace(
            one,
            coefficients=np.zeros_like(one.coefficients),
            **({"plates": np.zeros_like(one.plates), "delay_s": np.zeros_like(one.delay_s)} if body else {}),
            **({"impact": np.zeros_like(one.impact)} if body else {}),
        )
        for one in draws.trials
    )
    mean = np.broadcast_to(draws.coordinate_values.mean(axis=0), draws.coordinate_values.shape)
    still = replace(draws, coordinate_values=mean, trials=trials).without_places()
    return still if body else replace(still, bsp=np.broadcast_to(draws.bsp.mean(axis=0), draws.bsp.shape))


def usual_sources(fit: Fit) -> dict[str, PosteriorDraws]:
    """Return the draws of everything, of the body, and of plates and synchronisation.

    Raises:
        KinertiaError: the fit has no draws.
    """
    draws = kept_draws(fit)
    return {"all": draws, "body": only(draws, body=True), "instruments": only(draws, body=False)}


def _features(fit: Fit, keys: Sequence[Key] | None) -> tuple[np.ndarray, list[Key]]:
    """Return the features of all strides (k,), and what they are of, in the order of `keys` if given."""
    found: dict[Key, float] = {}
    curves = curves_by_stage(fit.trials, fit.mass_kg, stages=("estimate",))["estimate"]
    for curve in curves:
        if curve.kind in _KINDS and curve.stride.phase != "landing":
            for event, mean in _means(curve):
                name = f"{_KINDS[curve.kind]} {curve.quantity.removesuffix(f'_{curve.kind}')} {event}"
                found[curve.trial, name, curve.stride.side, f"{curve.stride.phase} {curve.stride.number}"] = mean
    order = sorted(found) if keys is None else list(keys)
    return np.array([found.get(key, np.nan) for key in order]), order


def _means(curve: CycleCurve) -> Iterator[tuple[str, float]]:
    """Yield the mean of each event of which all is known."""
    bounds = event_bounds(curve.stride)
    events = EVENTS if curve.stride.phase == "stride" else EVENTS[:-1]
    for event, first, last in zip(events, bounds, bounds[1:], strict=False):
        inside = (first <= PERCENT) & (last >= PERCENT)
        if inside.any() and np.isfinite(curve.value[inside]).all():
            yield event, float(curve.value[inside].mean())


def event_bounds(stride: Stride) -> tuple[float, ...]:
    """Return where in the stride (%) each of EVENTS begins, and the last ends; NaN where a contact is not known."""
    lifts, strikes, off = (
        stride.percent(time_s) for time_s in (stride.opposite_toe_off_s, stride.opposite_strike_s, stride.toe_off_s)
    )
    return 0.0, lifts, 0.5 * (lifts + strikes), strikes, off, 100.0
