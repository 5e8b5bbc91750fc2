"""Fits coordinates to the markers of single frames, selects angles that are continuous, and extracts a standing pose.

The sum of squared distances between measured and model markers is minimised frame by frame (`marker_sums` has the
analytic derivatives). A coordinate with a clamped range stays within it, as in OpenSim. Beyond an anatomical range it
is penalised: one standard deviation costs as much as a marker distance of MARKER_M, which prevents impossible joint
angles from compensating for marker errors. Beyond other ranges it can be penalised, too: this decides between two poses
that fit the markers nearly equally well.

A full turn changes nothing. And three rotations a, b, c about successively perpendicular axes give the same orientation
as a + pi, s - b, c + pi: s is pi where the first axis is perpendicular to the third (Cardan angles) and 0 where they
are equal (Euler angles). Frame by frame inverse kinematics may find any of them; here each joint gets values that do
not jump unless the segment does, and among these the ones within the coordinates' ranges.

No frame of a walk has both feet flat on the floor. But each foot is flat once in a stride, while the shank over it is
upright. These two frames, one of each leg, are put on one pelvis: rotated about the vertical and moved until the ASIS
coincide. Its knees are flexed by 10 to 20 degrees, which does not matter to a model built from segment frames.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from kinertia.model.coordinate_range import Bounds
from kinertia.model.marker_set import MarkerSet
from kinertia.model.skeleton import Axis, Joint, Skeleton
from kinertia.motion import marker_sums
from kinertia.motion.marker_sums import damped_steps
from kinertia.trial.data import FloatArray, Markers

_STEP_TOLERANCE = 1e-5
"""Rad or m; a smaller step is still taken and leaves an error several times smaller."""
MARKER_M = 0.01
"""Marker distance that costs as much as one standard deviation of a coordinate beyond its range."""
_SQUARE = 1e-6
_END_RAD = 1e-9
_FLAT_M = 0.02
"""Largest height of heel and forefoot together above their lowest."""
_LOWEST_PERCENT = 5
_NEAR_S = 0.1
"""A marker that is hidden in the frame is taken from one within this time."""
_OF_FOOT = ("heel", "metatarsal", "ankle_lateral", "knee_lateral")
_LEFT_LEG = ("thigh_l", "shank_l", "foot_l")


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
        for old, new in zip(self._arrays, other._arrays, strict=True):
            old[rows[kept]] = new[kept]

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
    last_axis, local = model.carried_markers
    at, slopes = axes.places_and_slopes(q)
    return marker_sums.normal_equations(
        tree, axes.owner, slopes, at, last_axis, local, np.ascontiguousarray(measured), axes.count
    )


@dataclass(frozen=True, eq=False)
class ThreeAngles:
    """Three angles of one joint that have a second, equivalent solution.

    Attributes:
        columns: of the coordinates, in the order of the rotations.
        middles: sum of the middle angles of both solutions, rad.
    """

    columns: tuple[int, ...]
    middles: float

    def equivalent(self, angles: np.ndarray) -> np.ndarray:
        """Return the other three angles (..., 3) for the same orientations."""
        first, middle, last = np.moveaxis(angles, -1, 0)
        return np.stack([first + np.pi, self.middles - middle, last + np.pi], axis=-1)


@dataclass(frozen=True, eq=False)
class EquivalentAngles:
    """Coordinates of a skeleton that have equivalent values.

    Attributes:
        joints: joints that rotate about three axes, the root first.
        single: columns of all other angles with a period of a full turn.
        bounds: of the coordinates.
        neutral: (c,) a typical pose.
    """

    joints: tuple[ThreeAngles, ...]
    single: tuple[int, ...]
    bounds: Bounds
    neutral: np.ndarray

    @classmethod
    def of(cls, model: Skeleton) -> Self:
        """Find the equivalent angles of a skeleton."""
        joints = tuple(angles for joint in model.joints if (angles := _three_angles(model, joint)) is not None)
        taken = {column for joint in joints for column in joint.columns}
        single = tuple(column for column in np.flatnonzero(model.periodic).tolist() if column not in taken)
        neutral = np.array([model.start.get(name, 0.0) for name in model.coordinates])
        return cls(joints, single, model.bounds, neutral)

    def nearest(self, q: np.ndarray, to: np.ndarray) -> np.ndarray:
        """Return the equivalents of poses q (..., c) that are nearest to other poses (..., c)."""
        q = q.copy()
        for joint in self.joints:
            angles, goal = q[..., joint.columns], to[..., joint.columns]
            equals = [goal + within_half_a_turn(turned - goal) for turned in (angles, joint.equivalent(angles))]
            same, twin = (np.abs(equal - goal).sum(axis=-1, keepdims=True) for equal in equals)
            q[..., joint.columns] = np.where(twin < same, equals[1], equals[0])
        goal = to[..., self.single]
        q[..., self.single] = goal + within_half_a_turn(q[..., self.single] - goal)
        return q

    def continuous(self, q: np.ndarray) -> np.ndarray:
        """Return the equivalents of the poses q (n, c) that do not jump; NaN stays.

        Where these would leave a clamped range, a joint keeps its values.
        """
        q = q.copy()
        always = np.isfinite(q).all(axis=0)
        known_together = tuple(column for column in self.single if always[column])
        alone = [((column,), None) for column in self.single if not always[column]]
        for columns, joint in [*((joint.columns, joint) for joint in self.joints), (known_together, None), *alone]:
            known = np.flatnonzero(np.isfinite(q[:, columns]).all(axis=1))
            if known.size and columns:
                some = np.ix_(known, np.array(columns))
                q[some] = self._one_branch(q[some], columns, joint)
        return q

    def _one_branch(self, angles: np.ndarray, columns: Sequence[int], joint: ThreeAngles | None) -> np.ndarray:
        """Return equivalents of angles (n, k) that do not jump and leave their ranges least.

        They are the angles of one joint, or of k joints with one angle each.
        """
        paths = angles[None]
        if joint is not None:
            equivalent = joint.equivalent(angles)
            stay, change = (
                np.abs(within_half_a_turn(branch[1:] - angles[:-1])).sum(axis=1) for branch in (angles, equivalent)
            )
            # changes between second solutions are as large as between the angles themselves
            other = np.concatenate([[False], np.logical_xor.accumulate(change < stay)])[:, None]
            paths = np.stack([np.where(other, equivalent, angles), np.where(other, angles, equivalent)])
        choices = self._whole_turns(np.unwrap(paths, axis=1), columns)
        # the middle angle identifies the solution: the others may differ by full turns
        middle = self._from_neutral(choices, columns)[:, len(columns) // 2]
        best = choices[np.argmin(self._beyond(choices, columns).sum(axis=1) + middle)]
        low, high = self.bounds.least[list(columns)], self.bounds.most[list(columns)]
        leaves = (np.abs(best - np.clip(best, low, high)) > _END_RAD).any(axis=0)
        return np.where(leaves if joint is None else leaves.any(), angles, best)

    def _whole_turns(self, paths: np.ndarray, columns: Sequence[int]) -> np.ndarray:
        """Shift every angle of the paths (p, n, k) by the full turns that make it most plausible."""
        usual = np.round((np.median(paths, axis=1, keepdims=True) - self.neutral[list(columns)]) / (2 * np.pi))
        shifted = np.stack([paths - 2 * np.pi * (usual + turns) for turns in (0, 1, -1)])
        badness = self._beyond(shifted, columns) + self._from_neutral(shifted, columns)
        least: np.ndarray = np.take_along_axis(shifted, np.argmin(badness, axis=0)[None, :, None], axis=0)[0]
        return least

    def _beyond(self, path: np.ndarray, columns: Sequence[int]) -> np.ndarray:
        """Return the mean square excess (..., k) of angles (..., n, k) beyond their ranges."""
        low, high = self.bounds.low[list(columns)], self.bounds.high[list(columns)]
        result: np.ndarray = np.square(path - np.clip(path, low, high)).mean(axis=-2)
        return result

    def _from_neutral(self, path: np.ndarray, columns: Sequence[int]) -> np.ndarray:
        """Return a small penalty (..., k) for the distance from neutral, which decides between values within range."""
        result: np.ndarray = 1e-3 * np.square(path - self.neutral[list(columns)]).mean(axis=-2)
        return result


def within_half_a_turn(angles: np.ndarray) -> np.ndarray:
    """Return the same angles between -pi and pi."""
    return (angles + np.pi) % (2 * np.pi) - np.pi


def _three_angles(model: Skeleton, joint: Joint) -> ThreeAngles | None:
    """Return the joint's angles, if it rotates about three free axes in turn, each perpendicular to the next."""
    turns = [axis for axis in joint.axes if axis.kind == "rotation" and not _still(model, axis)]
    if len(turns) != 3 or len({axis.coordinate for axis in turns}) != 3:
        return None
    first = joint.axes.index(turns[0])
    between = [axis for axis in joint.axes[first : joint.axes.index(turns[2])] if not _still(model, axis)]
    followed = [axis.coordinate for other in model.joints for axis in other.axes]
    free = all(
        axis.function is None and axis.coordinate not in model.locked and followed.count(axis.coordinate) == 1
        for axis in turns
    )
    a, b, c = (np.array(axis.direction) for axis in turns)
    if len(between) != 2 or not free or max(abs(a @ b), abs(b @ c)) > _SQUARE:
        return None
    columns = tuple(model.coordinates.index(axis.coordinate) for axis in turns)
    # half a turn about the third axis and half a turn about the first are one about the second
    return ThreeAngles(columns, 2 * float(np.arctan2(np.cross(c, a) @ b, c @ a)))


def _still(model: Skeleton, axis: Axis) -> bool:
    return axis.function is None and model.locked.get(axis.coordinate) == 0.0


def stance_pose(markers: Markers, marker_set: MarkerSet) -> Markers | None:
    """Return one frame in which the person stands on both feet; None if no frame shows a pelvis over a flat foot.

    Args:
        markers: of a walk, in ground axes.
        marker_set: assignment of labels to landmarks.
    """
    place = {name: _landmark(markers, labels) for name, labels in marker_set.landmarks.items()}
    if not {"asis_r", "asis_l"} <= place.keys():
        return None
    across, middle = place["asis_r"] - place["asis_l"], (place["asis_r"] + place["asis_l"]) / 2
    pelvis = np.asarray(np.isfinite(across[:, 0]))
    frames = {side: _flat_frame(place, pelvis, side) for side in "rl"}
    base = frames["r"]
    if base is None or frames["l"] is None:
        return None
    left = {label for name, labels in marker_set.segments.items() if name.startswith(_LEFT_LEG) for label in labels}
    heading = np.arctan2(across[:, 0], across[:, 2])
    near = round(_NEAR_S * markers.rate_hz)
    pose = np.full((1, len(markers.labels), 3), np.nan)
    for k, label in enumerate(markers.labels):
        reference = frames["l" if label in left else "r"]
        shown = np.flatnonzero(pelvis & np.isfinite(markers.positions[:, k, 0]))
        if reference is None or not shown.size:
            continue
        frame = shown[np.argmin(np.abs(shown - reference))]
        if abs(frame - reference) <= near:
            turn = heading[base] - heading[frame]
            pose[0, k] = middle[base] + _turned(markers.positions[frame, k] - middle[frame], turn)
    return Markers(markers.time[[base]], markers.labels, pose)


def _landmark(markers: Markers, labels: tuple[str, ...]) -> FloatArray:
    """Return the mean position (n, 3) m of those labels that the trial has; NaN without any."""
    known = [label for label in labels if label in markers.labels]
    if not known:
        return np.full((len(markers.time), 3), np.nan)
    middle: FloatArray = markers.select(known).positions.mean(axis=1)
    return middle


def hidden_landmarks(markers: Markers, marker_set: MarkerSet) -> list[str]:
    """List the landmarks that a `stance_pose` needs and no frame shows."""
    names = ["asis_r", "asis_l", *(f"{name}_{side}" for side in "rl" for name in _OF_FOOT)]
    every = {name: _landmark(markers, marker_set.landmarks.get(name, ())) for name in names}
    return [name for name, place in every.items() if not np.isfinite(place[:, 0]).any()]


def _flat_frame(place: Mapping[str, FloatArray], pelvis: np.ndarray, side: str) -> int | None:
    """Return the frame in which this foot is flat and the shank over it most upright."""
    names = [f"{name}_{side}" for name in _OF_FOOT]
    if not set(names) <= place.keys():
        return None
    heel, forefoot, ankle, knee = (place[name] for name in names)
    shown = np.flatnonzero(pelvis & np.isfinite(heel + forefoot + ankle + knee).all(axis=1))
    if not shown.size:
        return None
    lowest = [float(np.percentile(positions[shown, 1], _LOWEST_PERCENT)) for positions in (heel, forefoot)]
    height = heel[shown, 1] + forefoot[shown, 1] - sum(lowest)
    shank = (knee - ankle)[shown]
    lean = np.linalg.norm(shank[:, [0, 2]], axis=1) / np.linalg.norm(shank, axis=1)
    flat = height <= max(_FLAT_M, float(height.min()))
    return int(shown[np.argmin(np.where(flat, lean, np.inf))])


def _turned(vector: FloatArray, angle_rad: float) -> FloatArray:
    """Rotate a vector (3,) about the vertical."""
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    x, y, z = vector
    return np.array([cosine * x + sine * z, y, cosine * z - sine * x])
