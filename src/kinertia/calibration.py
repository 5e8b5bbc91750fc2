"""Adapting a static model to the trials it will be used for: marker positions and coordinates that stand still.

A static trial shows where markers sit on a person who stands, often with raised arms; in gait the skin has moved (the
acromia by up to 10 cm after a T-pose). Over a few frames of the trials, coordinates that move (one set per frame) and
calibration that does not (marker positions, and locked coordinates such as the shoulder centre) are estimated together
by Gauss-Newton; the static trial is the prior. Frames are eliminated one by one (Schur complement), so the cost grows
linearly with their number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.errors import TrialError
from kinertia.ik import solve_ik
from kinertia.skeleton import Marker, Pose, Skeleton
from kinertia.trial import Markers, Trial

MARKER_NOISE_M = 0.01
"""Deviation of one marker coordinate in one frame; the frames used stand 0.1 s apart and count as independent."""
FRAME_SPACING_S = 0.1
_MAX_FRAMES = 60
_STEPS = 15
_TOLERANCE_M = 1e-5
_ENOUGH_M2 = 1e-6
"""Which coordinates markers show does not ask for a pose better than a millimetre."""


@dataclass(frozen=True)
class Adaptation:
    """Outcome of `adapt`.

    Attributes:
        skeleton: with adapted markers and locked coordinates.
        moved_m: per marker label, how far it moved in its segment.
        coordinates: per adapted locked coordinate, its value (rad or m).
    """

    skeleton: Skeleton
    moved_m: Mapping[str, float]
    coordinates: Mapping[str, float]


def adapt(
    skeleton: Skeleton,
    trials: Sequence[Markers],
    marker_sd_m: Mapping[str, float],
    coordinate_sd: Mapping[str, float],
) -> Adaptation:
    """Adapt marker positions and locked coordinates to trials, with the skeleton as the prior.

    Args:
        skeleton: from the static trial.
        trials: the markers of the trials.
        marker_sd_m: per segment, prior deviation of its markers' positions (m, each axis).
        coordinate_sd: per locked coordinate to adapt, its prior deviation (rad or m).

    Frames whose visible markers do not determine every coordinate are left out; at least one must remain.
    """
    present = {label for markers in trials for label in markers.labels}
    kept = [marker for marker in skeleton.markers if marker.label in present]
    rest = [marker for marker in skeleton.markers if marker.label not in present]
    base = skeleton.with_markers(kept)
    few = [sampled(markers) for markers in trials]
    measured = np.concatenate([markers.arranged(base.labels) for markers in few])
    start = np.concatenate([solve_ik(base, markers).q for markers in few])
    seen = np.isfinite(start).all(axis=1)
    measured, moving = measured[seen], start[seen]

    still = list(coordinate_sd)
    freed = base.free(still)
    columns = {name: i for i, name in enumerate(freed.coordinates)}
    still_at = np.array([columns[name] for name in still], dtype=int)
    moving_at = np.array([columns[name] for name in base.coordinates])
    prior = np.concatenate([[base.locked[name] for name in still], base.marker_locals.ravel()])
    deviation = np.concatenate(
        [list(coordinate_sd.values()), np.repeat([marker_sd_m[marker.segment] for marker in kept], 3)]
    )
    static = prior.copy()
    for _ in range(_STEPS):
        q = np.empty((len(moving), len(freed.coordinates)))
        q[:, moving_at], q[:, still_at] = moving, static[: len(still)]
        placed = freed.with_markers(_relocated(kept, static[len(still) :]))
        step, moving_step = _step(placed, measured, q, moving_at, still_at, (prior - static) / deviation**2, deviation)
        static, moving = static + step, moving + moving_step
        if np.abs(step).max() < _TOLERANCE_M:
            break
    markers = _relocated(kept, static[len(still) :])
    moved = {m.label: float(np.linalg.norm(m.position - k.position)) for m, k in zip(markers, kept, strict=True)}
    values = {name: float(value) for name, value in zip(still, static[: len(still)], strict=True)}
    return Adaptation(skeleton.with_markers([*markers, *rest]).lock(values), moved, values)


def hold_uninformed(
    skeleton: Skeleton, trials: Sequence[Trial], may_hold: Mapping[str, float]
) -> tuple[Skeleton, tuple[str, ...]]:
    """The skeleton with those coordinates held that no marker shows, and their names.

    Args:
        skeleton: from the static trial.
        trials: the trials it will be used for.
        may_hold: the coordinates that need not be shown, and the values at which they are held.

    Raises:
        TrialError: a trial never shows another coordinate, or one that another trial shows.
    """
    never = []
    for trial in trials:
        ik = solve_ik(skeleton, sampled(trial.markers), trial.name, gain_tolerance_m2=_ENOUGH_M2)
        shown = np.isfinite(ik.q).any(axis=0)
        never.append([name for name, known in zip(ik.coordinates, shown, strict=True) if not known])
    held = [name for name in skeleton.coordinates if all(name in names for names in never) and name in may_hold]
    for trial, names in zip(trials, never, strict=True):
        lost = [name for name in names if name not in held]
        if lost:
            raise TrialError(trial.name, _not_shown(skeleton, trial.markers, lost))
    return skeleton.lock({name: may_hold[name] for name in held}), tuple(held)


def _not_shown(skeleton: Skeleton, markers: Markers, coordinates: Sequence[str]) -> str:
    children = [joint.child for joint in skeleton.joints if {axis.coordinate for axis in joint.axes} & set(coordinates)]
    worn = [m.label for m in skeleton.markers if m.segment in children]
    gone = [label for label in worn if label not in markers.labels]
    missing = f"; not in the file: {', '.join(gone)}" if gone else ""
    return (
        f"in no frame do enough markers show {', '.join(coordinates)} (markers of {', '.join(children)}: "
        f"{', '.join(worn) or 'none'}{missing}); use a trial that has them"
    )


def sampled(markers: Markers) -> Markers:
    """A few frames, FRAME_SPACING_S apart, from all over the trial (at most sixty)."""
    duration = float(markers.time[-1] - markers.time[0])
    count = min(_MAX_FRAMES, len(markers.time), 1 + int(duration / FRAME_SPACING_S))
    every = -(-len(markers.time) // count)
    return Markers(markers.time[::every], markers.labels, markers.positions[::every])


def _relocated(markers: Sequence[Marker], positions: np.ndarray) -> list[Marker]:
    return [
        Marker(marker.label, marker.segment, position)
        for marker, position in zip(markers, positions.reshape(-1, 3), strict=True)
    ]


def _step(
    skeleton: Skeleton,
    measured: np.ndarray,
    q: np.ndarray,
    moving_at: np.ndarray,
    still_at: np.ndarray,
    prior_pull: np.ndarray,
    deviation: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """One Gauss-Newton step of the static unknowns (k,) and of every frame's coordinates (n, c)."""
    pose = skeleton.pose(q)
    residual = (measured - skeleton.marker_positions(pose)) / MARKER_NOISE_M
    jacobian = marker_jacobian(skeleton, pose) / MARKER_NOISE_M
    seen = np.isfinite(residual)
    residual = np.where(seen, residual, 0.0).reshape(len(q), -1)
    jacobian = jacobian * seen[..., None]
    local = np.zeros((len(q), len(skeleton.markers), 3, len(skeleton.markers), 3))
    each = np.arange(len(skeleton.markers))
    turned = pose.rotation[:, skeleton.marker_segments] / MARKER_NOISE_M * seen[..., None]
    local[:, each, :, each, :] = turned.transpose(1, 0, 2, 3)
    jacobian = jacobian.reshape(len(q), residual.shape[1], -1)
    by_static = np.concatenate([jacobian[..., still_at], local.reshape(len(q), residual.shape[1], -1)], axis=-1)
    by_moving = jacobian[..., moving_at]
    transposed = by_moving.transpose(0, 2, 1)
    normal = transposed @ by_moving + 1e-6 * np.eye(len(moving_at))
    across = transposed @ by_static
    gradient = (transposed @ residual[..., None])[..., 0]
    solved = np.linalg.solve(normal, np.concatenate([across, gradient[..., None]], axis=-1))
    # sum over frames of S^T S - (M^T S)^T (M^T M)^-1 (M^T S)
    stacked = by_static.reshape(-1, by_static.shape[-1])
    reduced = stacked.T @ stacked - np.einsum("nij,nik->jk", across, solved[..., :-1])
    right = stacked.T @ residual.ravel() - np.einsum("nij,ni->j", across, solved[..., -1])
    reduced[np.diag_indices_from(reduced)] += 1.0 / deviation**2
    step = np.linalg.solve(reduced, right + prior_pull)
    return step, solved[..., -1] - solved[..., :-1] @ step


def marker_jacobian(skeleton: Skeleton, pose: Pose) -> np.ndarray:
    """(n, m, 3, c): velocity of every marker for each coordinate at unit rate."""
    positions = skeleton.marker_positions(pose)
    linear, angular = pose.jacobian[:, None, :3], pose.jacobian[:, None, 3:]
    turning = np.cross(angular, positions[..., None], axis=2)
    by_axes = (linear + turning) * skeleton.support[skeleton.marker_segments][:, None, :]
    return skeleton.map.to_coordinates(by_axes, pose.slopes)
