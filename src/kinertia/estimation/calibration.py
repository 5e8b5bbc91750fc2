"""Adapts a static model to the trials: marker positions, and coordinates that are the same in all frames.

A static trial shows where markers are on a standing person, often with raised arms; in gait the skin has moved (the
acromia by up to 10 cm after a T-pose). Over a few frames of the trials, coordinates that move (one set per frame) and
calibration that does not (marker positions, and locked coordinates such as the shoulder centre) are estimated together
by Gauss-Newton; the static trial is the prior, and a coordinate beyond its range is penalised (`motion_terms`). Frames
are eliminated one by one (Schur complement), so the cost grows linearly with their number.

What a model cannot follow recurs in every trial: n of them count as much as one, by n times the prior's information.
Counted as independent, five walks of one person turned the feet under their markers by 7 degrees more than each alone.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kinertia.errors import TrialError
from kinertia.estimation.simultaneous.terms.motion_terms import RangeTerms
from kinertia.findings.quantity import Quantity, Where
from kinertia.model.coordinate_range import Bounds
from kinertia.model.skeleton import Marker, Skeleton
from kinertia.motion.inverse_kinematics import InverseKinematics, solve_ik
from kinertia.motion.marker_sums import marker_jacobian
from kinertia.trial.data import Markers, Trial
from kinertia.trial.sampled_data import span_s

MARKER_NOISE_M = 0.01
"""Standard deviation of one marker coordinate in one frame; the frames used are 0.1 s apart and count as independent.
"""
FRAME_SPACING_S = 0.1
_MAX_FRAMES = 60
_STEPS, _SMALLEST_SHARE = 15, 1e-3
_TOLERANCE_M = 1e-5
_ENOUGH_M2 = 1e-6
"""Square of a millimetre."""
_FEWEST_TO_TURN = 3
"""Fewest markers that determine a rotation of their segment."""


@dataclass(frozen=True, eq=False)
class AdaptationInputs:
    """What a skeleton is adapted to, and how far it may move.

    Attributes:
        trials: the trials it will be used for.
        poses: their `first_poses`; coordinates that have been locked since are ignored.
        marker_sd_m: per segment, prior standard deviation of its markers' positions (m, each axis).
        coordinate_sd: per locked coordinate to adapt, its prior standard deviation (rad or m).
    """

    trials: Sequence[Trial]
    poses: Sequence[InverseKinematics]
    marker_sd_m: Mapping[str, float]
    coordinate_sd: Mapping[str, float]


@dataclass(frozen=True)
class Adaptation:
    """Outcome of `adapt`.

    Attributes:
        skeleton: with adapted markers and locked coordinates.
        moved_m: per marker label, its displacement in its segment.
        coordinates: per adapted locked coordinate, its value (rad or m).
    """

    skeleton: Skeleton
    moved_m: Mapping[str, float]
    coordinates: Mapping[str, float]

    @property
    def by_segment_m(self) -> dict[str, float]:
        """Per segment, RMS of `moved_m` along each axis."""
        squares: dict[str, list[float]] = {}
        for marker in self.skeleton.markers:
            if marker.label in self.moved_m:
                squares.setdefault(marker.segment, []).append(self.moved_m[marker.label] ** 2 / 3.0)
        return {segment: float(np.sqrt(np.mean(squares_m2))) for segment, squares_m2 in squares.items()}


def first_poses(skeleton: Skeleton, trials: Sequence[Trial]) -> list[InverseKinematics]:
    """Solve the `sampled` frames of each trial to a millimetre, as needed by `lock_undetermined` and `adapt`."""
    return [solve_ik(skeleton, sampled(trial.markers), trial.name, gain_tolerance_m2=_ENOUGH_M2) for trial in trials]


def adapt(skeleton: Skeleton, given: AdaptationInputs) -> Adaptation:
    """Adapt marker positions and locked coordinates to trials, with the skeleton of the static trial as the prior.

    Frames whose visible markers do not determine every coordinate are left out.

    Raises:
        TrialError: R102, no frame of any trial remains.
    """
    trials, coordinate_sd = given.trials, given.coordinate_sd
    present = {label for trial in trials for label in trial.markers.labels}
    kept = [marker for marker in skeleton.markers if marker.label in present]
    rest = [marker for marker in skeleton.markers if marker.label not in present]
    base = skeleton.with_markers(kept)
    measured = np.concatenate([sampled(trial.markers).arranged(base.labels) for trial in trials])
    start = np.concatenate([ik.q[:, [ik.coordinates.index(name) for name in base.coordinates]] for ik in given.poses])
    seen = np.isfinite(start).all(axis=1)
    if not seen.any():
        names, whole = ", ".join(trial.name for trial in trials), Where(part="the whole body")
        raise TrialError.found(names, "R102", whole, frames=Quantity(0, "1"))
    measured, moving = measured[seen], start[seen]

    still = list(coordinate_sd)
    freed = base.free(still)
    columns = {name: i for i, name in enumerate(freed.coordinates)}
    sd = [*coordinate_sd.values(), *np.repeat([given.marker_sd_m[marker.segment] for marker in kept], 3)]
    used = sum(bool(part.any()) for part in np.split(seen, np.cumsum([len(ik.q) for ik in given.poses])[:-1]))
    problem = _Problem(
        skeleton=freed,
        measured=measured,
        bounds=base.bounds,
        moving_at=np.array([columns[name] for name in base.coordinates]),
        still_at=np.array([columns[name] for name in still], dtype=int),
        prior=np.concatenate([[base.locked[name] for name in still], base.marker_locals.ravel()]),
        information=used * np.diag(np.square(sd) ** -1.0),
    )
    static = problem.solved(moving)
    markers = _relocated(kept, static[len(still) :])
    moved = {m.label: float(np.linalg.norm(m.position - k.position)) for m, k in zip(markers, kept, strict=True)}
    values = {name: float(value) for name, value in zip(still, static[: len(still)], strict=True)}
    return Adaptation(skeleton.with_markers([*markers, *rest]).lock(values), moved, values)


@dataclass(frozen=True, eq=False)
class _Problem:
    """Cost of static and moving unknowns of some frames, and its minimum.

    Static unknowns (k,) are locked coordinates, then marker positions.

    Attributes:
        skeleton: with all coordinates free.
        measured: (n, m, 3) markers, m.
        bounds: of the moving coordinates.
        moving_at, still_at: columns of moving and of static coordinates.
        prior: (k,) mean of the static unknowns.
        information: (k, k) of the prior, times the number of trials.
    """

    skeleton: Skeleton
    measured: np.ndarray
    bounds: Bounds
    moving_at: np.ndarray
    still_at: np.ndarray
    prior: np.ndarray
    information: np.ndarray

    def solved(self, moving: np.ndarray) -> np.ndarray:
        """Return the static unknowns (k,) by Gauss-Newton, from the prior and moving coordinates (n, c).

        Steps that would raise the cost are halved: arms that swing and rotate make it far from quadratic.
        """
        here = self._at(self.prior, moving)
        for _ in range(_STEPS):
            pull = self.information @ (self.prior - here.static)
            step, moving_step = _step(
                here.residual,
                here.jacobian[..., self.moving_at],
                here.jacobian[..., self.still_at],
                pull,
                self.information,
                here.ranges,
            )
            share, there = 1.0, self._at(here.static + step, here.moving + moving_step)
            while there.cost > here.cost and share > _SMALLEST_SHARE:
                share *= 0.5
                there = self._at(here.static + share * step, here.moving + share * moving_step)
            if there.cost > here.cost:
                break
            here = there
            if share * np.abs(step).max() < _TOLERANCE_M:
                break
        return here.static

    def _at(self, static: np.ndarray, moving: np.ndarray) -> "_Point":
        """Evaluate the cost at static unknowns (k,) and moving coordinates (n, c)."""
        q, count = np.empty((len(moving), len(self.skeleton.coordinates))), len(self.still_at)
        q[:, self.moving_at], q[:, self.still_at] = moving, static[:count]
        residual, jacobian = _in_segments(self.skeleton, self.measured, q, static[count:].reshape(-1, 3))
        ranges, away = RangeTerms.of(self.bounds, moving, frames_per_interval=1.0), static - self.prior
        cost = 0.5 * float(np.nansum(np.square(residual)) + away @ self.information @ away) + ranges.cost
        return _Point(static, moving, residual, jacobian, ranges, cost)


class _Point(NamedTuple):
    """Static unknowns (k,) and moving coordinates (n, c), with marker errors and range penalty there."""

    static: np.ndarray
    moving: np.ndarray
    residual: np.ndarray
    jacobian: np.ndarray
    ranges: RangeTerms
    cost: float


def lock_undetermined(
    skeleton: Skeleton, trials: Sequence[Trial], poses: Sequence[InverseKinematics], may_lock: Mapping[str, float]
) -> tuple[Skeleton, tuple[str, ...]]:
    """Lock the coordinates that no marker determines; return the skeleton and their names.

    Args:
        skeleton: from the static trial.
        trials: the trials it will be used for.
        poses: their `first_poses`.
        may_lock: the coordinates that may be undetermined, and the values at which they are locked.

    Raises:
        TrialError: R103, a trial never determines another coordinate, or one that another trial determines.
    """
    never = []
    for ik in poses:
        shown = np.isfinite(ik.q).any(axis=0)
        never.append([name for name, known in zip(ik.coordinates, shown, strict=True) if not known])
    held = [name for name in skeleton.coordinates if all(name in names for names in never) and name in may_lock]
    for trial, names in zip(trials, never, strict=True):
        lost = [name for name in names if name not in held]
        if lost:
            moved = [joint.child for joint in skeleton.joints if {axis.coordinate for axis in joint.axes} & set(lost)]
            worn = tuple(marker.label for marker in skeleton.markers if marker.segment in moved)
            raise TrialError.found(trial.name, "R103", Where(part=", ".join(lost), markers=worn))
    return skeleton.lock({name: may_lock[name] for name in held}), tuple(held)


def without_partly_shown(skeleton: Skeleton, poses: Sequence[InverseKinematics], names: Collection[str]) -> Skeleton:
    """Remove the markers beyond joints that some of the trials determine and others never do.

    A coordinate that one trial cannot determine is then locked in all of them, and no marker contradicts it.

    Args:
        skeleton: from the static trial.
        poses: `first_poses` of the trials it will be used for.
        names: coordinates that may be locked.
    """
    shown = [{name for name, q in zip(ik.coordinates, ik.q.T, strict=True) if np.isfinite(q).any()} for ik in poses]
    partly = {name for name in names if any(name in seen for seen in shown) and not all(name in seen for seen in shown)}
    beyond: set[str] = set()
    for joint in skeleton.joints:  # parents come first
        if joint.parent in beyond or partly & {axis.coordinate for axis in joint.axes}:
            beyond.add(joint.child)
    return skeleton.with_markers([marker for marker in skeleton.markers if marker.segment not in beyond])


def sampled(markers: Markers) -> Markers:
    """Select a few frames, FRAME_SPACING_S apart, from the whole trial (at most sixty)."""
    count = min(_MAX_FRAMES, len(markers.time), 1 + int(span_s(markers.time) / FRAME_SPACING_S * (1.0 + 1e-9)))
    every = -(-len(markers.time) // count)
    return Markers(markers.time[::every], markers.labels, markers.positions[::every])


def _relocated(markers: Sequence[Marker], positions: np.ndarray) -> list[Marker]:
    return [
        Marker(marker.label, marker.segment, position)
        for marker, position in zip(markers, positions.reshape(-1, 3), strict=True)
    ]


def _in_segments(
    skeleton: Skeleton, measured: np.ndarray, q: np.ndarray, places: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return marker errors (n, m, 3) and their derivatives (n, m, 3, c) by the coordinates, in noise SDs.

    Both are in the axes of the markers' segments, so that a marker's position in its segment (m, 3) affects only its
    own error. Missing markers are NaN in the errors and zero in the derivatives.
    """
    pose = skeleton.pose(q)
    turned = pose.rotation[:, skeleton.marker_segments]
    positions = (turned @ places[..., None])[..., 0] + pose.translation[:, skeleton.marker_segments]
    to_segment = turned.transpose(0, 1, 3, 2) / MARKER_NOISE_M
    errors = (to_segment @ (measured - positions)[..., None])[..., 0]
    seen = np.isfinite(errors)
    return errors, to_segment @ marker_jacobian(skeleton, pose, positions) * seen[..., None]


def _step(
    residual: np.ndarray,
    by_moving: np.ndarray,
    by_still: np.ndarray,
    prior_pull: np.ndarray,
    information: np.ndarray,
    ranges: RangeTerms,
) -> tuple[np.ndarray, np.ndarray]:
    """Compute one Gauss-Newton step of the static unknowns (k,) and of the moving coordinates (n, c).

    Static unknowns are locked coordinates, then marker positions. It takes the output of `_in_segments`, the prior's
    information (k, k), and the range terms of the moving coordinates.
    """
    n = len(residual)
    seen = np.isfinite(residual).reshape(n, -1)
    residual = np.nan_to_num(residual).reshape(n, -1)
    by_moving, by_still = (part.reshape(n, residual.shape[1], -1) for part in (by_moving, by_still))
    transposed = by_moving.transpose(0, 2, 1)
    every = np.arange(by_moving.shape[-1])
    normal = transposed @ by_moving
    normal[:, every, every] += 1e-6 + ranges.curvature
    across = np.concatenate([transposed @ by_still, transposed / MARKER_NOISE_M], axis=-1)
    gradient = transposed @ residual[..., None] + ranges.pull[..., None]
    solved = np.linalg.solve(normal, np.concatenate([across, gradient], axis=-1))
    # S^T S and S^T r summed over frames; a position affects its own marker only
    k = by_still.shape[-1]
    square, rhs = information.copy(), prior_pull.copy()
    square[:k, :k] += np.einsum("nri,nrj->ij", by_still, by_still)
    square[:k, k:] += by_still.sum(axis=0).T / MARKER_NOISE_M
    square[k:, :k] = square[:k, k:].T
    square[range(k, len(square)), range(k, len(square))] += seen.sum(axis=0) / MARKER_NOISE_M**2
    rhs[:k] += np.einsum("nri,nr->i", by_still, residual)
    rhs[k:] += residual.sum(axis=0) / MARKER_NOISE_M
    # (M^T S)^T (M^T M)^-1 (M^T S) is subtracted: the moving coordinates adjust
    followed = across.reshape(-1, len(rhs)).T @ solved.reshape(-1, len(rhs) + 1)
    step = np.linalg.solve(square - followed[:, :-1], rhs - followed[:, -1])
    return step, solved[..., -1] - solved[..., :-1] @ step


def turn_about(segment: str, before: Sequence[Marker], after: Sequence[Marker]) -> float:
    """Compute the angle (rad) of a segment's markers about it, by least squares; 0 with fewer than three markers."""
    moved = {marker.label: marker.position for marker in after}
    worn = [marker for marker in before if marker.segment == segment and marker.label in moved]
    if len(worn) < _FEWEST_TO_TURN:
        return 0.0
    arms = np.array([marker.position for marker in worn])
    arms = arms - arms.mean(axis=0)
    shifts = np.array([moved[marker.label] - marker.position for marker in worn])
    by_moments = np.linalg.pinv(np.sum(arms**2) * np.eye(3) - arms.T @ arms)
    return float(np.linalg.norm(by_moments @ np.cross(arms, shifts).sum(axis=0)))
