"""Fits coordinates to the markers of single frames: Gauss-Newton within the ranges of the model.

The sum of squared distances between measured and model markers is minimised frame by frame (`marker_sums` has the
analytic derivatives). A coordinate with a clamped range stays within it, as in OpenSim. Beyond the range that anatomy
knows it pays: one deviation is as bad as a marker that is MARKER_M off, which keeps joints from making up for markers
in ways that no joint can. Beyond another range it may be made to pay, too: that decides which of two poses is meant
that fit the markers nearly as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinertia.model.coordinate_range import Bounds
from kinertia.model.skeleton import Skeleton
from kinertia.motion import marker_sums
from kinertia.motion.marker_sums import damped_steps

_STEP_TOLERANCE = 1e-5
"""Rad or m; the step below it is still taken and leaves an error several times smaller."""
MARKER_M = 0.01
"""By how much a marker errs where a coordinate errs by one deviation of its range."""


@dataclass(frozen=True)
class Stop:
    """When to stop.

    Attributes:
        gain_tolerance_m2: a step that would lower a frame's sum of squared distances by less is its last.
        most_steps: after so many a frame counts as not converged.
        choosing: whether ranges count that neither anatomy knows nor the model clamps.
    """

    gain_tolerance_m2: float
    most_steps: int
    choosing: bool = False


@dataclass(frozen=True, eq=False)
class PoseFit:
    """Outcome of `fit_poses` for n frames.

    Attributes:
        q: (n, c) rad and m.
        converged: (n,) False where the iteration stopped at its limit.
        cost_m2: (n,) sum of squared marker distances, and what was paid for leaving ranges.
        normal: (n, c, c) J^T J of the visible markers.
    """

    q: np.ndarray
    converged: np.ndarray
    cost_m2: np.ndarray
    normal: np.ndarray

    def put(self, rows: np.ndarray, other: PoseFit, kept: np.ndarray) -> None:
        """Overwrite those of these rows that are `kept` (r,) by the rows of another outcome."""
        for own, new in zip(self._arrays, other._arrays, strict=True):
            own[rows[kept]] = new[kept]

    @property
    def _arrays(self) -> tuple[np.ndarray, ...]:
        return self.q, self.converged, self.cost_m2, self.normal


def fit_poses(model: Skeleton, measured: np.ndarray, q: np.ndarray, stop: Stop) -> PoseFit:
    """The poses nearest to markers measured (n, m, 3), each frame by itself, from these coordinates (n, c) on.

    Steps are damped (Levenberg) per frame: a step that makes the fit worse is taken back and the damping raised.
    """
    bounds = model.bounds
    q = bounds.clamped(q)
    n = len(q)
    damping = np.full(n, 1e-6)
    best = np.full(n, np.inf)
    accepted = q.copy()
    step = np.zeros_like(q)
    converged = np.zeros(n, dtype=bool)
    active = np.arange(n)
    normal = np.zeros((n, q.shape[1], q.shape[1]))
    last_h, last_g = normal, np.zeros_like(q)
    for _ in range(stop.most_steps):
        h, g, cost = normal_equations(model, measured[active], q[active])
        paid = bounds.beyond(q[active]) * (price := _price(bounds, q[active], stop.choosing))
        g -= price * paid
        cost += np.square(paid).sum(axis=1)
        better = cost <= best[active] * (1 + 1e-12)
        up = active[better]
        best[up], accepted[up] = cost[better], q[up]
        h[~better], g[~better] = last_h[~better], last_g[~better]
        damping[up] = np.maximum(damping[up] * 0.1, 1e-9)
        damping[active[~better]] *= 100.0
        step[active] = _steps(model, h, g, accepted[active], damping[active], stop.choosing)
        gain = np.einsum("nc,nc->n", step[active], g)
        # a step that was cut at the end of a range may lead upwards: then the next one is shorter
        small = (np.abs(step[active]).max(axis=1) < _STEP_TOLERANCE) | ((gain >= 0) & (gain < stop.gain_tolerance_m2))
        done = active[small]
        converged[done] = True
        accepted[done] += step[done]
        normal[done] = h[small]
        active, last_h, last_g = active[~small], h[~small], g[~small]
        if not active.size:
            break
        q[active] = accepted[active] + step[active]
    normal[active] = last_h
    return PoseFit(accepted, converged, best, normal)


def _price(bounds: Bounds, q: np.ndarray, choosing: bool) -> np.ndarray:
    """(n, c) m per rad or m beyond a range; zero within."""
    counts = (bounds.beyond(q) != 0) & (bounds.anatomical | choosing)
    result: np.ndarray = np.where(counts, MARKER_M / bounds.sd(q), 0.0)
    return result


def _steps(
    model: Skeleton, normal: np.ndarray, gradient: np.ndarray, q: np.ndarray, damping: np.ndarray, choosing: bool
) -> np.ndarray:
    """(n, c) damped steps from q that keep within clamped ranges; the gradient has what is paid beyond the others."""
    bounds, columns = model.bounds, np.arange(q.shape[1])
    price, held = _price(bounds, q, choosing), bounds.held(q, gradient)
    if price.any() or held.any():
        free = ~held
        usual = normal[:, columns, columns].mean(axis=1, keepdims=True)
        normal = normal * (free[:, :, None] & free[:, None, :])
        normal[:, columns, columns] += np.where(held, usual, np.square(price))
        gradient = np.where(free, gradient, 0.0)
    step: np.ndarray = bounds.clamped(q + damped_steps(normal, gradient, damping)) - q
    return step


def normal_equations(model: Skeleton, measured: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """J^T J (n, c, c), J^T r (n, c) and r^T r (n,) of the visible markers (n, m, 3); r = measured - model."""
    tree, axes = model.tree, model.map
    carrier, local = model.carried_markers
    at, slopes = axes.places_and_slopes(q)
    return marker_sums.normal_equations(
        tree, axes.owner, slopes, at, carrier, local, np.ascontiguousarray(measured), axes.count
    )
