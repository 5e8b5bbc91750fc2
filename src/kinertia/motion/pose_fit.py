"""Fits coordinates to the markers of single frames: Gauss-Newton within the ranges of the model.

The sum of squared distances between measured and model markers is minimised frame by frame (`marker_sums` has the
analytic derivatives). A coordinate with a clamped range stays within it, as in OpenSim. Beyond an anatomical range it
is penalised: one standard deviation costs as much as a marker distance of MARKER_M, which prevents impossible joint
angles from compensating for marker errors. Beyond other ranges it can be penalised, too: this decides between two poses
that fit the markers nearly equally well.
"""

from dataclasses import dataclass

import numpy as np

from kinertia.model.coordinate_range import Bounds
from kinertia.model.skeleton import Skeleton
from kinertia.motion import marker_sums
from kinertia.motion.marker_sums import damped_steps

_STEP_TOLERANCE = 1e-5
"""Rad or m; a smaller step is still taken and leaves an error several times smaller."""
MARKER_M = 0.01
"""Marker distance that costs as much as one standard deviation of a coordinate beyond its range."""


@dataclass(frozen=True)
class Stop:
    """Stopping criteria of the fit.

    Attributes:
        gain_tolerance_m2: a step that would lower a frame's sum of squared distances by less is its last.
        most_steps: after so many a frame counts as not converged.
        choosing: whether ranges count that are neither anatomical nor clamped in the model.
    """

    gain_tolerance_m2: float
    most_steps: int
    choosing: bool = False


@dataclass(frozen=True, eq=False)
class PoseFit:
    """Result of `fit_poses` for n frames.

    Attributes:
        q: (n, c) rad and m.
        converged: (n,) False where the iteration stopped at its limit.
        cost_m2: (n,) sum of squared marker distances and range penalties.
        normal: (n, c, c) J^T J of the visible markers.
    """

    q: np.ndarray
    converged: np.ndarray
    cost_m2: np.ndarray
    normal: np.ndarray

    def put(self, rows: np.ndarray, other: "PoseFit", kept: np.ndarray) -> None:
        """Overwrite those of these rows that are `kept` (r,) by the rows of another result."""
        for own, new in zip(self._arrays, other._arrays, strict=True):
            own[rows[kept]] = new[kept]

    @property
    def _arrays(self) -> tuple[np.ndarray, ...]:
        return self.q, self.converged, self.cost_m2, self.normal


def fit_poses(model: Skeleton, measured: np.ndarray, q: np.ndarray, stop: Stop) -> PoseFit:
    """Fit poses to measured markers (n, m, 3), each frame by itself, starting from these coordinates (n, c).

    Steps are damped (Levenberg) per frame: a step that worsens the fit is undone and the damping increased.
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
        # a step that was cut at a range limit may increase the cost: then the next one is shorter
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
    """Return the penalty (n, c) in m per rad or m beyond a range; zero within."""
    counts = (bounds.beyond(q) != 0) & (bounds.anatomical | choosing)
    return np.where(counts, MARKER_M / bounds.sd(q), 0.0)


def _steps(
    model: Skeleton, normal: np.ndarray, gradient: np.ndarray, q: np.ndarray, damping: np.ndarray, choosing: bool
) -> np.ndarray:
    """Return damped steps (n, c) from q that keep within clamped ranges; the gradient includes the range penalties."""
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
    """Compute J^T J (n, c, c), J^T r (n, c) and r^T r (n,) of the visible markers (n, m, 3); r = measured - model."""
    tree, axes = model.tree, model.map
    carrier, local = model.carried_markers
    at, slopes = axes.places_and_slopes(q)
    return marker_sums.normal_equations(
        tree, axes.owner, slopes, at, carrier, local, np.ascontiguousarray(measured), axes.count
    )
