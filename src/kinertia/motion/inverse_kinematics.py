"""Solves inverse kinematics by global optimisation (Lu & O'Connor 1999), per frame.

For every frame the sum of squared distances between measured and model markers is minimised over all coordinates at
once, and joints beyond their ranges are penalised (`pose_fit`). Several poses may fit a frame nearly as well, and
several sets of angles describe the same pose: an arm rotated by half a turn with the elbow bent backwards, a foot
upside down. So frames a tenth of a second apart are solved first; among equally good poses each takes the one that
continues its neighbour's, outwards from the frame that fits best, and among equivalent angles those that do not jump
(`pose_fit`). All other frames start from there.

Model and markers differ by millimetres to centimetres (skin, marker placement), so a pose that is fitted to fewer
markers differs: where a marker vanishes for a frame, the joint jumps, and accelerations at the edges of the gap are
hundreds of times those of the body. If a marker in a gap keeps its offset, in the axes of its segment, it has no effect
on the pose, which stays continuous.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from kinertia.errors import MarkerSetError, TrialError
from kinertia.model.skeleton import Skeleton
from kinertia.motion.marker_sums import variances
from kinertia.motion.pose_fit import EquivalentAngles, PoseFit, Stop, fit_poses
from kinertia.motion.workload import one_blas_thread, pieces
from kinertia.trial.data import Markers
from kinertia.trial.sampled_data import rms

_WARM_START_EVERY_S = 0.1
_FAR_RAD_S, _FAR_RAD = 10.0, 0.2
"""Rad or m between frames: people hardly ever move faster than this, beyond an initial allowance; a frame that does is
also started from its neighbour."""
_AS_GOOD, _AS_GOOD_M2 = 1.05, 1e-7
"""A pose is as good as another if its sum of squared distances is at most this factor times the other's plus this
constant."""
MOST_STEPS = 60
_ROUNDS = 6
"""Number of times that frames with gaps are solved again: each round leaves about half of the pose's error."""
_DOUBTED_RAD, _ANEW_RAD = 0.5, 1.0
_DOUBTED, _DOUBTED_M = 2.0, 0.005
"""Frames are solved again if they did not converge, exceed a range by more than the first, or have an RMS marker
distance above the third times the trial's usual value and above the fourth. They restart with no joint farther than the
second from its neutral angle."""
_UNINFORMED_RAD_PER_M = 60.0
"""A coordinate counts as undetermined if 10 mm of white marker noise would give it an SD of more than 0.6 rad (or 0.6
m)."""


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
        """Root mean square of the marker distances over all visible markers and frames, m."""
        return rms(self.errors_m)


@one_blas_thread
def solve_ik(
    skeleton: Skeleton,
    markers: Markers,
    name: str = "markers",
    consecutive: bool = True,
    gain_tolerance_m2: float = 0.0,
    most_steps: int = MOST_STEPS,
) -> InverseKinematics:
    """Compute all coordinates at every frame, by least squares on all visible markers.

    Args:
        skeleton: the model; its markers and those of the trial are matched by label.
        markers: measured markers.
        name: the trial's, for messages.
        consecutive: neighbouring frames show nearly the same pose, so that one may start from the other.
        gain_tolerance_m2: a step that would lower a frame's sum of squared distances by less is its last; only
            coordinates that the markers hardly determine would still change.
        most_steps: after so many steps from one start, a frame counts as not converged.

    Raises:
        MarkerSetError: fewer than three root markers of the skeleton are in the trial.
        TrialError: R101, no frame has three visible root markers.
    """
    used = [m for m in skeleton.markers if m.label in markers.labels]
    model = skeleton.with_markers(used)
    measured = markers.positions[:, [markers.labels.index(m.label) for m in used]]
    q = np.tile([model.start.get(name, 0.0) for name in model.coordinates], (len(measured), 1))
    q[:, :6], placed = _place_root(model, measured, name)
    if not placed.any():
        raise TrialError.found(name, "R101")
    fine, equal = np.flatnonzero(placed), EquivalentAngles.of(model)
    stop = Stop(gain_tolerance_m2, most_steps)
    choosing = replace(stop, choosing=True)
    if consecutive:
        every = max(1, round(_WARM_START_EVERY_S * markers.rate_hz)) if len(fine) > 1 else 1
        coarse = np.unique(np.append(fine[::every], fine[-1]))
        poses = _best_fit(model, measured[coarse], q[coarse], choosing)
        _carry_on(model, measured[coarse], markers.time[coarse], poses, equal, choosing)
        if len(coarse) > 1:
            q[fine] = PchipInterpolator(coarse, equal.continuous(poses.q))(fine)
    converged, informed = np.zeros(len(q), dtype=bool), np.zeros(q.shape, dtype=bool)
    for some in (fine[piece] for piece in pieces(len(fine))):
        if not consecutive:
            q[some] = _best_fit(model, measured[some], q[some], choosing).q
        poses = fit_poses(model, measured[some], q[some], stop)
        if consecutive:
            _carry_on(model, measured[some], markers.time[some], poses, equal, stop)
        q[some], converged[some], informed[some] = poses.q, poses.converged, ~_uninformed(poses.normal)
    if consecutive:
        _hold_in_gaps(model, measured, placed, q, stop)
    errors = np.full(measured.shape[:2], np.nan)
    for some in (fine[piece] for piece in pieces(len(fine))):
        errors[some] = _distances(model, measured[some], q[some])
    q[~informed] = np.nan
    q = equal.continuous(q) if consecutive else equal.nearest(q, np.broadcast_to(equal.neutral, q.shape))
    return InverseKinematics(markers.time, model.coordinates, q, model.labels, errors, converged)


def _hold_in_gaps(model: Skeleton, measured: np.ndarray, placed: np.ndarray, q: np.ndarray, stop: Stop) -> None:
    """Solve frames with missing markers again, with the offsets that these have before and after (`GapOffsets`)."""
    gaps = GapOffsets(measured, placed)
    for _ in range(_ROUNDS):
        for some in (gaps.frames[piece] for piece in pieces(len(gaps.frames))):
            q[some] = fit_poses(model, gaps.filled(model, q, some), q[some], stop).q


def _distances(model: Skeleton, measured: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the distances (n, m) m between measured and model markers."""
    result: np.ndarray = np.linalg.norm(measured - model.marker_positions(model.pose(q)), axis=-1)
    return result


def _best_fit(model: Skeleton, measured: np.ndarray, q: np.ndarray, stop: Stop) -> PoseFit:
    """Apply `fit_poses`, again from near neutral for doubtful frames, and keep the better fit."""
    poses = fit_poses(model, measured, q, stop)
    doubtful = np.flatnonzero(_doubtful(model, measured, poses))
    if doubtful.size:
        anew, neutral = poses.q[doubtful], q[doubtful]
        anew[:, 6:] = np.clip(anew[:, 6:], neutral[:, 6:] - _ANEW_RAD, neutral[:, 6:] + _ANEW_RAD)
        other = fit_poses(model, measured[doubtful], anew, stop)
        poses.put(doubtful, other, _as_good(other.cost_m2, poses.cost_m2[doubtful]))
    return poses


def _doubtful(model: Skeleton, measured: np.ndarray, poses: PoseFit) -> np.ndarray:
    seen = np.isfinite(measured).all(axis=-1).sum(axis=1)
    miss = np.sqrt(poses.cost_m2 / seen)
    beyond = np.abs(model.bounds.beyond(poses.q)).max(axis=1) > _DOUBTED_RAD
    result: np.ndarray = ~poses.converged | beyond | (miss > np.maximum(_DOUBTED * np.median(miss), _DOUBTED_M))
    return result


def _as_good(cost: np.ndarray, other: np.ndarray) -> np.ndarray:
    return cost <= _AS_GOOD * other + _AS_GOOD_M2


def _carry_on(
    model: Skeleton, measured: np.ndarray, time: np.ndarray, poses: PoseFit, equal: EquivalentAngles, stop: Stop
) -> None:
    """Solve frames that lie far from their neighbours again from there, outwards from the best one and back.

    On the way out, frames keep a pose that is as good, so that all follow the solution of the best one; on the way
    back, only one that is clearly better.
    """
    far = _far(equal, time, poses.q)
    if not far.any():
        return
    count, best = len(time), int(np.argmin(_strangeness(measured, poses, equal)))
    outwards = [(k, k - 1) for k in range(best + 1, count)] + [(k, k + 1) for k in range(best - 1, -1, -1)]
    back = [(k, k + 1) for k in range(count - 2, -1, -1)] + [(k, k - 1) for k in range(1, count)]
    for pairs, returning in ((outwards, False), (back, True)):
        for k, beside in pairs:
            if not far[min(k, beside)]:
                continue
            again = fit_poses(model, measured[[k]], poses.q[[beside]], stop)
            cost = poses.cost_m2[[k]]
            better = ~_as_good(cost, again.cost_m2) if returning else _as_good(again.cost_m2, cost)
            poses.put(np.array([k]), again, better)
            near = slice(max(k - 1, 0), k + 2)
            far[near.start : near.start + len(time[near]) - 1] = _far(equal, time[near], poses.q[near])


def _far(equal: EquivalentAngles, time: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the mask (n - 1,) of frame pairs whose poses q (n, c) are farther apart than a person moves."""
    change = np.abs(equal.nearest(q[1:], q[:-1]) - q[:-1]).max(axis=1)
    result: np.ndarray = change > _FAR_RAD + _FAR_RAD_S * np.diff(time)
    return result


def _strangeness(measured: np.ndarray, poses: PoseFit, equal: EquivalentAngles) -> np.ndarray:
    """Return mean squared marker distances (n,) m2 plus one square centimetre per square rad away from neutral."""
    seen = np.isfinite(measured).all(axis=-1).sum(axis=1)
    away = np.square(
        equal.nearest(poses.q, np.broadcast_to(equal.neutral, poses.q.shape))[:, 6:] - equal.neutral[6:]
    ).mean(axis=1)
    result: np.ndarray = poses.cost_m2 / seen + 1e-4 * away
    return result


def _place_root(model: Skeleton, measured: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Fit the root segment to its markers: return root coordinates (n, 6), and (n,) whether three were visible."""
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


def _uninformed(normal: np.ndarray) -> np.ndarray:
    """Return the mask (n, c) of coordinates that visible markers do not determine, from J^T J (n, c, c)."""
    result: np.ndarray = np.sqrt(variances(normal, 1e-9)) > _UNINFORMED_RAD_PER_M
    return result


class GapOffsets:
    """Interpolated marker offsets in the gaps of a trial.

    Args:
        measured: (n, m, 3) m; NaN where not seen.
        placed: (n,) frames that have a pose.
    """

    def __init__(self, measured: np.ndarray, placed: np.ndarray) -> None:
        self._measured = measured
        seen = np.isfinite(measured).all(axis=-1) & placed[:, None]
        frames = np.arange(len(seen))[:, None]
        before = np.maximum.accumulate(np.where(seen, frames, -1), axis=0)
        after = np.minimum.accumulate(np.where(seen, frames, len(seen))[::-1], axis=0)[::-1]
        ever = seen.any(axis=0)
        # before the first and after the last frame that shows a marker, the offset is that of this frame
        self._before = np.where(ever, np.where(before < 0, after, before), 0)
        self._after = np.where(ever, np.where(after >= len(seen), self._before, after), 0)
        self._gap = ~seen & ever & placed[:, None]

    @property
    def frames(self) -> np.ndarray:
        """Frames with a pose that lack a marker visible elsewhere in the trial."""
        return np.flatnonzero(self._gap.any(axis=1))

    def filled(self, model: Skeleton, q: np.ndarray, frames: np.ndarray) -> np.ndarray:
        """Return the markers (f, m, 3) m of these frames, gaps filled by the poses q (n, c) of all frames."""
        ends = [at[frames] for at in (self._before, self._after)]
        edges = np.unique(np.concatenate([end[self._gap[frames]] for end in ends]))
        local = self._errors(model, q, edges)
        columns = np.arange(self._gap.shape[1])
        first, last = (local[np.minimum(np.searchsorted(edges, end), len(edges) - 1), columns] for end in ends)
        length = np.maximum(ends[1] - ends[0], 1)
        share = np.clip((frames[:, None] - ends[0]) / length, 0.0, 1.0)[..., None]
        pose = model.pose(q[frames])
        turned = pose.rotation[:, model.marker_segments]
        error = (turned @ (first + share * (last - first))[..., None])[..., 0]
        held = model.marker_positions(pose) + error
        result: np.ndarray = np.where(self._gap[frames][..., None], held, self._measured[frames])
        return result

    def _errors(self, model: Skeleton, q: np.ndarray, frames: np.ndarray) -> np.ndarray:
        """Return measured minus model markers (f, m, 3) m of these frames, in the axes of their segments."""
        pose = model.pose(q[frames])
        turned = pose.rotation[:, model.marker_segments].transpose(0, 1, 3, 2)
        result: np.ndarray = (turned @ (self._measured[frames] - model.marker_positions(pose))[..., None])[..., 0]
        return result
