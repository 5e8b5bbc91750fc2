"""Adds uncertainty that no unknown has: geometry of the knee, skin that moves as a body, errors that look like motion.

Markers that are centimetres from where the static trial has them were adapted to the trials, and fixed axes are as the
static trial has them. Both turn the axes of segments throughout a trial: angles are less certain by that, and so are
generalised forces, which are moments about these axes.

A knee that is a hinge in the model transmits adduction and rotation moments by constraint. They depend on where its
centre is and where its axis points, which no equation of motion of the estimate can show: a centre that is displaced
sideways by 5 mm changes the adduction moment by 5 mm times the force along the shank, and an axis that points 4 degrees
too far forward takes 7 % of the flexion moment for adduction.

Both also define the axes of the segments. The long axes of thigh and shank pass through the knee's centre: where it is
displaced sideways, 1 % of the flexion moments of hip and ankle is taken for rotation. The thigh's axis to the right is
the knee's.

Measured over the bone of a walking person (Cereatti et al. 2017, J Biomech, doi 10.1016/j.jbiomech.2017.02.004), the
thigh's skin moves fore and aft by some 6 mm in the first 12 % of the stride, with twice the acceleration that it has
elsewhere. Markers that move together look like a thigh that swings: it leaves no residuals, from which the motion's
errors are derived (`motion_noise`). The error bars of hip flexion moments are longer there, by the effect of that
person's skin. Draws of the posterior are not wider,
and have axes as in the estimate.

The process that represents the errors (`marker_errors`) matches their slowest part, which carries most information on
what does not move, and their innovation from frame to frame. In between, where the body's accelerations are, it may
have many times the power of skin motion: ten to thirty times on synthetic skin, up to ten times on measured walks. The
estimate hardly depends on it, but standard deviations of joint moments do. So these are computed from the residuals of
the markers at the estimate, within the band of the motion.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from kinertia.estimation.simultaneous.linear_algebra.motion_basis import STEADY_INTERVALS, MotionBasis
from kinertia.estimation.simultaneous.search.problem import MapProblem
from kinertia.model.kinematic_tree import in_segments
from kinertia.model.skeleton import Skeleton
from kinertia.motion.joint_moments import BodyJoint, JointMoments, component_signs
from kinertia.motion.marker_sums import marker_jacobian
from kinertia.trial.sampled_data import all_around

CENTRE_SD_M = 0.005
"""Standard deviation of the knee's centre to the side, chosen here; from day to day also of the ankle's."""
AXIS_SD_RAD = float(np.radians(4.0))
"""Standard deviation of its axis' direction about the thigh, chosen here."""
_SHOWN = 1e-6
"""Added to the diagonal of the normal equations, relative to its largest: markers may not show all angles."""
_FRAMES_AT_ONCE = 100
_NEXT = {"Hip": "Knee", "Knee": "Ankle"}
GROWTH = 2.0
"""Of what the markers' errors make of the moment of hip flexion. With it 95 % intervals cover after heel strike, where
skin moves as measured, nearly as often as elsewhere."""
LASTS_S = 0.14
"""From landing on: 12 % of the stride of an unhurried walk."""
_UNSEEN = 3.0
"""Power of all errors over that of the observable ones: skin that moves as a block moves the segment, and leaves no
residual. Chosen here; with it, intervals have their nominal coverage in a laboratory whose skin moves as blocks."""
_LEAST_FREE = 0.1
END_GROWTH = 0.75
"""Accelerations at the very end of a motion are this much less certain than where they become steady. Chosen here: in
walks by OpenSim, cut at both ends, the last 20 ms of knee flexion would be covered in 88 % without it."""
_ENDS = 3
"""Knot intervals beside gaps and ends, where a fitted spline oscillates more than elsewhere."""
_MOST_FRAMES = 6000
"""Number of frames at once: a minute."""
_FREQUENCIES = 400


def placement(
    skeleton: Skeleton, q: np.ndarray, seen: np.ndarray, misplaced_m: np.ndarray, tilts: Mapping[str, float]
) -> np.ndarray:
    """Return what misplaced markers and tilted axes add to the variances (d, c) of angles, by inverse kinematics.

    Args:
        skeleton: with these axes locked.
        q: (d, c) coordinates.
        seen: (d, m) which markers are.
        misplaced_m: (m,) SD of each marker's position in its segment, along each axis.
        tilts: static coordinate that tilts an axis -> its SD, rad.
    """
    names = [name for name in tilts if name in skeleton.locked]
    of_markers, of_axes = np.repeat(misplaced_m, 3), np.array([tilts[name] for name in names])
    result = np.zeros(q.shape)
    if not (of_markers.any() or of_axes.any()):
        return result
    free = skeleton.free(names)
    at = np.array([free.coordinates.index(name) for name in (*skeleton.coordinates, *names)])
    whole = np.empty((len(q), len(at)))
    whole[:, at] = np.hstack([q, np.tile([skeleton.locked[name] for name in names], (len(q), 1))])
    for start in range(0, len(q), _FRAMES_AT_ONCE):
        some = slice(start, start + _FRAMES_AT_ONCE)
        pose = free.pose(whole[some])
        by = (marker_jacobian(free, pose, free.marker_positions(pose)) * seen[some, :, None, None])[..., at]
        moving, still = np.split(by.reshape(len(by), -1, len(at)), [q.shape[1]], axis=2)
        follow = _following(moving)
        changes = np.concatenate([follow * of_markers, follow @ still * of_axes], axis=2)
        result[some] = np.square(changes).sum(axis=2)
    return np.where(skeleton.rotational, result, 0.0)


def _following(by: np.ndarray) -> np.ndarray:
    """Return the changes (d, c, r) of coordinates that follow r marker coordinates, from the derivatives (d, r, c).

    Coordinates that no marker shows in a frame follow nothing.
    """
    transposed, every = by.transpose(0, 2, 1), np.arange(by.shape[2])
    normal = transposed @ by
    largest = normal[:, every, every].max(axis=1, keepdims=True)
    normal[:, every, every] += _SHOWN * np.where(largest > 0.0, largest, 1.0)
    result: np.ndarray = np.linalg.solve(normal, transposed)
    return result


def knee_geometry(skeleton: Skeleton, joints: Sequence[BodyJoint], loads: np.ndarray) -> np.ndarray:
    """Return what it adds to the variances (d, 6 j) of the loads of j joints.

    Args:
        skeleton: of these joints.
        joints: the joints.
        loads: (d, 6 j) per joint its moments, then its forces, as in `MomentDerivatives`.
    """
    by_centre, by_axis = _derivatives(skeleton, joints, loads)
    result: np.ndarray = np.square(CENTRE_SD_M * by_centre) + np.square(AXIS_SD_RAD * by_axis)
    return result


def fixed_axes(
    skeleton: Skeleton,
    joints: Sequence[BodyJoint],
    loads: np.ndarray,
    moments: np.ndarray,
    tilts: Mapping[str, float],
) -> np.ndarray:
    """Return what fixed axes that may be tilted add to the variances (d, c) of moments about them.

    An axis that is off by a small angle takes its share of the joint's moment about the axes perpendicular to it. The
    subtalar axis, which has no tilt of its own, is off by as much as the ankle's.

    Args:
        skeleton: with c coordinates.
        joints: of it.
        loads: (d, 6 j) as in `knee_geometry`.
        moments: (d, c) about the axes of the coordinates.
        tilts: static coordinate that tilts an axis, in two directions each -> its SD, rad.
    """
    result = np.zeros(moments.shape)
    for k, joint in enumerate(joints):
        sd_rad = tilts.get(f"{joint.name.lower()}_tilt_1_{joint.side}", 0.0)
        whole = np.square(loads[:, 6 * k : 6 * k + 3]).sum(axis=1)
        for column in joint.columns(skeleton) if sd_rad else ():
            across = np.maximum(whole - np.square(moments[:, column]), 0.0)
            result[:, column] = np.square(sd_rad) * across
    return result


def with_drawn_knees(
    skeleton: Skeleton, joints: Sequence[BodyJoint], loads: JointMoments, random: np.random.Generator
) -> JointMoments:
    """Return the loads with centre and axis of each knee displaced at random, once for all frames."""
    signs = np.array([component_signs(joint) for joint in joints]).reshape(-1, 3)
    both = np.stack([signs * loads.moments, loads.forces], axis=2)
    changes = np.zeros(both.shape)
    drawn = {joint.side: random.normal(0.0, (CENTRE_SD_M, AXIS_SD_RAD)) for joint in joints if joint.name == "Knee"}
    for by, scale in zip(_derivatives(skeleton, joints, both.reshape(len(both), -1)), range(2), strict=True):
        displaced = np.array([drawn[joint.side][scale] if joint.side in drawn else 0.0 for joint in joints])
        changes += displaced[:, None, None] * by.reshape(both.shape)
    return replace(loads, moments=loads.moments + signs * changes[:, :, 0], forces=loads.forces + changes[:, :, 1])


def with_drawn_ankles(joints: Sequence[BodyJoint], loads: JointMoments, random: np.random.Generator) -> JointMoments:
    """Return the loads with the centre of each ankle displaced to the side by CENTRE_SD_M, once for all frames.

    Of its moments alone: axes of shanks and feet stay.
    """
    changes, signs = np.zeros(loads.moments.shape), np.array([component_signs(joint) for joint in joints])
    for k, joint in enumerate(joints):
        if joint.name == "Ankle":
            forward, up, _ = loads.forces[:, k].T
            right_m = random.normal(0.0, CENTRE_SD_M)
            changes[:, k] = signs[k] * np.stack([np.zeros(len(up)), right_m * up, -right_m * forward], axis=1)
    return replace(loads, moments=loads.moments + changes)


def _derivatives(skeleton: Skeleton, joints: Sequence[BodyJoint], loads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return derivatives (d, 6 j) of loads by displacement of the knee to the right, m, and turn about the thigh, rad.

    The moments are about axes right, forward and up, the forces along axes forward, up and right, which are taken for
    perpendicular to each other.
    """
    lengths_m = _lengths_m(skeleton, joints)
    by_centre, by_axis = np.zeros((2, len(loads), len(joints), 6))
    for k, joint in enumerate(joints):
        about_right, about_forward, about_up, forward, up, right = loads[:, 6 * k : 6 * k + 6].T
        thigh, shank = (1.0 / lengths_m.get((name, joint.side), np.inf) for name in ("Hip", "Knee"))
        zero = np.zeros(len(loads))
        if joint.name == "Hip":
            by_centre[:, k] = np.stack([zero, zero, -thigh * about_right, zero, -thigh * right, thigh * up], axis=1)
            by_axis[:, k, 3:] = np.stack([-right, zero, forward], axis=1)
        elif joint.name == "Knee":
            turning = [thigh * about_up, up, shank * about_right - forward]
            by_centre[:, k] = np.stack([*turning, zero, shank * right, -shank * up], axis=1)
            by_axis[:, k, :2] = np.stack([about_forward, -about_right], axis=1)
        elif joint.name == "Ankle":
            by_centre[:, k, :3] = np.stack([-shank * about_up, zero, shank * about_right], axis=1)
    return by_centre.reshape(loads.shape), by_axis.reshape(loads.shape)


def _lengths_m(skeleton: Skeleton, joints: Sequence[BodyJoint]) -> dict[tuple[str, str], float]:
    """Return the distances of hips to knees and of knees to ankles, by the former and side."""
    pose = skeleton.neutral
    centres = {(joint.name, joint.side): joint.centre(skeleton, pose)[0] for joint in joints}
    return {
        (name, side): float(np.linalg.norm(place - centres[_NEXT[name], side]))
        for (name, side), place in centres.items()
        if (_NEXT.get(name), side) in centres
    }


def block_growth(
    problem: MapProblem, k: int, static: np.ndarray, time: np.ndarray, joints: Sequence[BodyJoint] = ()
) -> np.ndarray:
    """Return factors (n, r) on what the markers' errors make of each moment at these times of trial k.

    The rows r are those of `MomentDerivatives`.

    Args:
        problem: of the estimate.
        k: the trial.
        static: the static unknowns as they are in it.
        time: (n,) s.
        joints: those of the moments after those of coordinates.
    """
    trial = problem.trials[k]
    rows = [*problem.skeleton.coordinates, *(f"{joint.label} {axis}" for joint in joints for axis in range(6))]
    ground = problem.loads.reactions(k, static).loaded_at(trial.time) > 0.0
    if trial.on_ground is not None:
        ground |= trial.on_ground
    landed = np.zeros_like(ground)
    landed[1:] = ground[1:] & ~ground[:-1]
    result = np.ones((len(time), len(rows)))
    for side, at in zip("rl", landed.T, strict=True):
        landings = np.append(-np.inf, trial.time[at])
        after = time - landings[np.searchsorted(landings, time, side="right") - 1] < LASTS_S
        result[np.ix_(after, [row in (f"hip_flexion_{side}", f"hip_{side} 0") for row in rows])] = GROWTH
    return result


def end_growth(basis: MotionBasis, frames_s: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return factors (n,) on what the markers' errors make of moments at times (s) at the ends of the frames (s)."""
    away_s = np.minimum(time - frames_s[0], frames_s[-1] - time)
    outwards = 1.0 - away_s / (STEADY_INTERVALS * (basis.knots[1] - basis.knots[0]))
    result: np.ndarray = 1.0 + END_GROWTH * np.clip(outwards, 0.0, 1.0)
    return result


def motion_noise(problem: MapProblem, k: int, coefficients: np.ndarray, static: np.ndarray) -> np.ndarray:
    """Return the power (3,) of the errors of trial k, their rates and accelerations, relative to what is expected.

    It is at most 1: a single marker that jumps would widen all intervals.

    Args:
        problem: of the estimate.
        k: the trial.
        coefficients: of its motion.
        static: the static unknowns as they are in it.
    """
    trial, basis = problem.trials[k], problem.bases[k]
    spacing_s = float(basis.knots[1] - basis.knots[0])
    squares, counts = np.zeros((3, len(trial.marker_sd))), np.zeros(len(trial.marker_sd))
    counted = trial.dynamic if trial.dynamic.any() or trial.reported is None else trial.reported
    parts = np.linspace(0, len(trial.time), 1 + -(-len(trial.time) // _MOST_FRAMES)).astype(int)
    for frames in (slice(start, stop) for start, stop in pairwise(parts)):
        left = _left(problem, k, coefficients, static, frames)
        n, m, _ = left.shape
        splines = MotionBasis(trial.time[frames], spacing_s)
        around = 1 + 2 * int(np.ceil(_ENDS * n / (splines.first[-1] + 1)))
        inside = all_around(np.isfinite(left).all(axis=-1), around)
        rows = inside & counted[frames][:, None]
        for square, part in zip(squares, splines.evaluate(splines.fit(left.reshape(n, -1))), strict=True):
            square += np.where(rows, np.square(part).reshape(n, m, 3).sum(axis=-1), 0.0).sum(axis=0)
        counts += 3 * rows.sum(axis=0)
    seen = counts > 0
    if not seen.any():
        return np.ones(3)
    expected = _expected(problem, k, 0.5 / spacing_s)[:, None] * np.square(trial.marker_process[0][seen])
    found = (squares[:, seen] / counts[seen] / expected).mean(axis=1) / _free(problem, k, counts)
    result: np.ndarray = np.minimum(_UNSEEN * found, 1.0)
    return result


def _left(problem: MapProblem, k: int, coefficients: np.ndarray, static: np.ndarray, frames: slice) -> np.ndarray:
    """Return the residuals (n, m, 3) m of markers and skin, in the axes of the segments; NaN where not seen."""
    q = problem.model.full(problem.bases[k].evaluate(coefficients, frames), static)[0]
    skeleton, trial = problem.model.placed(static), problem.trials[k]
    at = np.ascontiguousarray(skeleton.map.axes(q))
    local = in_segments(skeleton.tree, at, skeleton.marker_segments, np.ascontiguousarray(trial.markers[frames]))
    patterns, along = problem.model.skin(k, static, frames)
    result: np.ndarray = local - skeleton.marker_locals - patterns.displaced(along)
    return result


def _expected(problem: MapProblem, k: int, band_hz: float) -> np.ndarray:
    """Return mean squares (3,) of errors of unit SD, their rates and accelerations, up to this frequency."""
    trial = problem.trials[k]
    step_s = float(np.median(np.diff(trial.time)))
    hz = np.linspace(0.0, band_hz, _FREQUENCIES)
    process = trial.marker_process[1]
    lag1, lag2 = process.of_before
    turn = np.exp(-2j * np.pi * step_s * hz)
    power = 2.0 * step_s * process.new / np.square(np.abs(1.0 - lag1 * turn - lag2 * turn**2)) / trial.repeats
    return np.array([np.trapezoid(power * (2.0 * np.pi * hz) ** (2 * order), hz) for order in range(3)])


def _free(problem: MapProblem, k: int, counts: np.ndarray) -> float:
    """Return the share of the errors within the band that motion and skin have not absorbed, by counting unknowns."""
    basis = problem.bases[k]
    shown = counts.sum() * basis.size / len(basis.first)
    splines = basis.size * problem.trials[k].dynamic.mean() * len(problem.moving)
    return max(1.0 - float(splines + problem.given.skin[k].size) / float(shown), _LEAST_FREE)
