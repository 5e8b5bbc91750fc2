"""Inverse kinematics by global optimisation (Lu & O'Connor 1999): all coordinates on all visible markers, per frame.

For every frame the sum of squared distances between measured and model markers is minimised over all coordinates at
once, by Gauss-Newton steps with an analytic Jacobian (`kinertia.motion.marker_sums`). Frames are independent problems.
A coarse pass over a frame every tenth of a second gives the warm start of all the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from kinertia.errors import MarkerSetError, TrialError
from kinertia.model.skeleton import Skeleton
from kinertia.motion import marker_sums
from kinertia.motion.frames_at_once import pieces
from kinertia.motion.marker_sums import damped_steps
from kinertia.motion.one_thread import one_blas_thread
from kinertia.trial.data import Markers
from kinertia.trial.rms import rms

_WARM_START_EVERY_S = 0.1
_FAR = 1.0
"""Rad or m between frames so far apart: more than a person moves."""
MOST_STEPS = 60
_STEP_TOLERANCE = 1e-5
"""Rad or m; the step below it is still taken and leaves an error several times smaller."""
_WOUND_RAD, _ANEW_RAD = 2.6, 1.0
"""Frames that did not converge, or have a joint turned farther than the first (a foot upside down fits its markers
nearly as well), start anew with no joint farther than the second from neutral."""
_UNINFORMED_RAD_PER_M = 60.0
"""A coordinate counts as not informed where 10 mm of white marker noise would give it more than 0.6 rad (or 0.6 m)."""


@dataclass(frozen=True)
class InverseKinematics:
    """Result of `solve_ik`.

    Attributes:
        time: (n,) s.
        coordinates: names, in the order of the columns of q.
        q: (n, c) rad and m; NaN where the visible markers do not determine the coordinate.
        labels: the markers used.
        errors_m: (n, m) distance between measured and model marker; NaN where not visible.
        converged: (n,) False where the iteration stopped at its limit.
    """

    time: np.ndarray
    coordinates: tuple[str, ...]
    q: np.ndarray
    labels: tuple[str, ...]
    errors_m: np.ndarray
    converged: np.ndarray

    @property
    def marker_rms_m(self) -> float:
        """Root mean square of the marker distances over all visible markers and frames."""
        return rms(self.errors_m)


@dataclass(frozen=True)
class _Stop:
    """When to stop: as `solve_ik` takes it."""

    gain_tolerance_m2: float
    most_steps: int


@one_blas_thread
def solve_ik(
    skeleton: Skeleton,
    markers: Markers,
    name: str = "markers",
    consecutive: bool = True,
    gain_tolerance_m2: float = 0.0,
    most_steps: int = MOST_STEPS,
) -> InverseKinematics:
    """All coordinates at every frame, by least squares on all visible markers.

    Args:
        skeleton: the model; its markers and those of the trial are matched by label.
        markers: measured markers.
        name: the trial's, for messages.
        consecutive: neighbouring frames show nearly the same pose, so that one may start from the other.
        gain_tolerance_m2: a step that would lower a frame's sum of squared distances by less is its last; what goes on
            moving then is a coordinate that the markers hardly show.
        most_steps: after so many, from one start, a frame counts as not converged.

    Raises:
        MarkerSetError: fewer than three root markers of the skeleton are in the trial.
        TrialError: no frame has three visible root markers.
    """
    used = [m for m in skeleton.markers if m.label in markers.labels]
    model = skeleton.with_markers(used)
    measured = markers.positions[:, [markers.labels.index(m.label) for m in used]]
    q = np.tile([model.start.get(name, 0.0) for name in model.coordinates], (len(measured), 1))
    q[:, :6], placed = _place_root(model, measured, name)
    if not placed.any():
        raise TrialError(
            name,
            "no frame shows three markers of the pelvis; check the labels and the gaps of the pelvis markers",
        )
    fine, stop = np.flatnonzero(placed), _Stop(gain_tolerance_m2, most_steps)
    if consecutive and len(fine) > 1:
        every = max(1, round(_WARM_START_EVERY_S * markers.rate_hz))
        coarse = np.unique(np.append(fine[::every], fine[-1]))
        q_coarse, _, _ = _best_fit(model, measured[coarse], q[coarse], stop)
        _carry_on(model, measured[coarse], q_coarse, stop)
        q_coarse[:, model.periodic] = np.unwrap(q_coarse[:, model.periodic], axis=0)
        q[fine] = PchipInterpolator(coarse, q_coarse)(fine)
    converged, errors = np.zeros(len(q), dtype=bool), np.full(measured.shape[:2], np.nan)
    for some in (fine[piece] for piece in pieces(len(fine))):
        fitted, converged[some], normal = _best_fit(model, measured[some], q[some], stop)
        errors[some] = _misses(model, measured[some], fitted)
        q[some] = np.where(_uninformed(normal), np.nan, fitted)
    q[~placed] = np.nan
    q[:, :6] = model.root.turned_back(q[:, :6])
    if consecutive:
        _unwrap(q, model)
    return InverseKinematics(markers.time, model.coordinates, q, model.labels, errors, converged)


def _misses(model: Skeleton, measured: np.ndarray, q: np.ndarray) -> np.ndarray:
    """(n, m) m, distances between measured and model markers."""
    result: np.ndarray = np.linalg.norm(measured - model.marker_positions(model.pose(q)), axis=-1)
    return result


def _best_fit(
    model: Skeleton, measured: np.ndarray, q: np.ndarray, stop: _Stop
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`_gauss_newton`, and once more from near neutral for frames whose outcome is doubtful; the better fit is kept."""
    q, converged, normal = _gauss_newton(model, measured, q, stop)
    joints = np.abs(q[:, 6:][:, model.rotational[6:]])
    doubtful = np.flatnonzero(~converged | (joints.max(axis=1, initial=0.0) > _WOUND_RAD))
    if doubtful.size:
        anew = q[doubtful]
        anew[:, 6:] = np.clip(anew[:, 6:], -_ANEW_RAD, _ANEW_RAD)
        anew, settled, shown = _gauss_newton(model, measured[doubtful], anew, stop)
        old, new = (
            np.nansum(np.square(_misses(model, measured[doubtful], one)), axis=1) for one in (q[doubtful], anew)
        )
        better = new <= old * (1.0 + 1e-6) + 1e-12
        kept = doubtful[better]
        q[kept], converged[kept], normal[kept] = anew[better], settled[better], shown[better]
    return q, converged, normal


def _carry_on(model: Skeleton, measured: np.ndarray, q: np.ndarray, stop: _Stop) -> None:
    """Start frames that lie far from their neighbour again from there; they keep what fits better.

    An arm turned by half a turn with the elbow bent backwards fits its markers nearly as well.
    """
    count = len(q)
    for order, step in ((range(1, count), -1), (range(count - 2, -1, -1), 1)):
        for k in order:
            change = q[k] - q[k + step]
            change[model.periodic] = (change[model.periodic] + np.pi) % (2 * np.pi) - np.pi
            if np.abs(change).max() < _FAR:
                continue
            again, _, _ = _gauss_newton(model, measured[[k]], q[[k + step]], stop)
            old, new = (np.nansum(np.square(_misses(model, measured[[k]], at))) for at in (q[[k]], again))
            if new < old:
                q[k] = again[0]


def _unwrap(q: np.ndarray, model: Skeleton) -> None:
    for c in np.flatnonzero(model.periodic):
        seen = np.isfinite(q[:, c])
        q[seen, c] = np.unwrap(q[seen, c])


def _place_root(model: Skeleton, measured: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Root coordinates (n, 6) by fitting the root segment to its markers, and (n,) whether three were visible."""
    root = np.flatnonzero(model.marker_segments == 0)
    if len(root) < 3:
        raise MarkerSetError(
            f"trial '{name}' has {len(root)} of the markers on the {model.segments[0]}; at least 3 are needed"
        )
    here, there = model.marker_locals[root], measured[:, root]
    seen = np.isfinite(there).all(axis=-1)
    placed = seen.sum(axis=1) >= 3
    weight = (seen / np.maximum(seen.sum(axis=1, keepdims=True), 1))[..., None]
    there = np.nan_to_num(there)
    mean_here = (weight * here).sum(axis=1)
    mean_there = (weight * there).sum(axis=1)
    covariance = np.einsum("nmi,nmj->nij", weight * (there - mean_there[:, None]), here - mean_here[:, None])
    u, _, vt = np.linalg.svd(covariance)
    flip = np.ones((len(u), 3))
    flip[:, 2] = np.sign(np.linalg.det(u @ vt))
    rotation = (u * flip[:, None, :]) @ vt
    return model.root.coordinates(rotation, mean_there - (rotation @ mean_here[..., None])[..., 0]), placed


def _gauss_newton(
    model: Skeleton, measured: np.ndarray, q: np.ndarray, stop: _Stop
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Minimise the squared marker distances frame by frame; returns q (n, c), (n,) converged, J^T J (n, c, c).

    Steps are damped (Levenberg) per frame: a step that makes the fit worse is taken back and the damping raised.
    """
    q = q.copy()
    n = len(q)
    damping = np.full(n, 1e-6)
    best = np.full(n, np.inf)
    accepted = q.copy()
    step = np.zeros_like(q)
    converged = np.zeros(n, dtype=bool)
    active = np.arange(n)
    normal = np.zeros((n, q.shape[1], q.shape[1]))
    gradient = np.zeros_like(q)
    for _ in range(stop.most_steps):
        h, g, cost = normal_equations(model, measured[active], q[active])
        better = cost <= best[active] * (1 + 1e-12)
        up = active[better]
        best[up], accepted[up] = cost[better], q[up]
        normal[up], gradient[up] = h[better], g[better]
        damping[up] = np.maximum(damping[up] * 0.1, 1e-9)
        damping[active[~better]] *= 100.0
        step[active] = damped_steps(normal[active], gradient[active], damping[active])
        gain = np.einsum("nc,nc->n", step[active], gradient[active])
        small = (np.abs(step[active]).max(axis=1) < _STEP_TOLERANCE) | (gain < stop.gain_tolerance_m2)
        done = active[small]
        converged[done] = True
        accepted[done] += step[done]
        active = active[~small]
        if not active.size:
            break
        q[active] = accepted[active] + step[active]
    return accepted, converged, normal


def normal_equations(model: Skeleton, measured: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """J^T J (n, c, c), J^T r (n, c) and r^T r (n,) of the visible markers (n, m, 3); r = measured - model."""
    tree, axes = model.tree, model.map
    carrier, local = model.carried_markers
    at, slopes = axes.places_and_slopes(q)
    return marker_sums.normal_equations(
        tree, axes.owner, slopes, at, carrier, local, np.ascontiguousarray(measured), axes.count
    )


def _uninformed(normal: np.ndarray) -> np.ndarray:
    """(n, c) True where the visible markers do not determine the coordinate, from J^T J (n, c, c)."""
    c = normal.shape[-1]
    deviation = np.sqrt(np.einsum("ncc->nc", np.linalg.inv(normal + 1e-9 * np.eye(c))))
    result: np.ndarray = deviation > _UNINFORMED_RAD_PER_M
    return result
