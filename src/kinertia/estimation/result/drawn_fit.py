"""Makes a `Fit` whose motion, parameters and calibration are one draw from the posterior of another.

What is equal in all these draws, as motion and forces are where only the body differs, is computed once.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Self, TypeAlias

import numpy as np
from scipy.interpolate import BSpline

from kinertia.errors import KinertiaError
from kinertia.estimation.result.curve_source import Gapped, through_angles, through_loads
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.trial_fit import JointCurves, TrialFit, known_joints
from kinertia.estimation.simultaneous.instruments.plates import GAIN, corrected_loads
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import STEADY_INTERVALS
from kinertia.estimation.simultaneous.uncertainty.model_errors import END_GROWTH, with_drawn_ankles, with_drawn_knees
from kinertia.estimation.simultaneous.uncertainty.posterior_draws import PosteriorDraws, TrialDraws
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion, inverse_dynamics
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.joint_moments import body_joints, joint_loads
from kinertia.motion.kinematics import Kinematics
from kinertia.motion.smoothing import interpolate
from kinertia.motion.workload import pieces

_DEGREE = 5
_GEOMETRY_SEED = 5040
"""Of the knees' centres and axes, which are not among the estimate's unknowns: the same in all trials of a draw."""
Model: TypeAlias = tuple[Skeleton, BodySegmentParameters]
AT_ONCE = 10
"""Draws whose curves are computed together: more take memory."""


def kept_draws(fit: Fit) -> PosteriorDraws:
    """Return the posterior draws stored with a fit.

    Raises:
        KinertiaError: the fit is by the two-level method.
    """
    if fit.posterior is None:
        raise KinertiaError('the two-level method has no error bars to draw from: fit with method "simultaneous"')
    return fit.posterior.draws


def chosen_draws(fit: Fit, count: int, seed: int = 0) -> list[int]:
    """Select `count` different draws of those stored; with seed 0 the first ones.

    Raises:
        KinertiaError: fewer draws are stored.
    """
    kept = kept_draws(fit).count
    if not 1 <= count <= kept:
        raise KinertiaError(f"{count} posterior draws are asked for, and this result keeps {kept}: take 1 to {kept}")
    order = np.arange(kept) if seed == 0 else np.random.default_rng(seed).permutation(kept)
    result: list[int] = order[:count].tolist()
    return result


def drawn_fit(fit: Fit, number: int, knees: bool = True) -> Fit:
    """Make the fit that corresponds to draw `number` (from 0), without uncertainty of its own.

    Body segment parameters, joint centres, marker positions, coordinates, ground reactions and the joint moments that
    follow from them all belong to one draw. Of `Fit` and `TrialFit` only these differ: `estimate`, `skeleton`, and
    each trial's `skeleton`, `motion`, `trajectory`, `reactions`, `joint_loads["estimate"]` and `joint_curves`.

    Args:
        fit: by the simultaneous estimate.
        number: of the draw.
        knees: whether the geometry of the knees, which is not among the estimate's unknowns, is drawn as well.

    Raises:
        KinertiaError: no draws are stored.
    """
    draws = kept_draws(fit)
    bsp = drawn_bodies(fit.estimate, draws, number)
    skeleton = drawn_joints(fit.skeleton, draws, number)
    skeleton = skeleton.with_positions(skeleton.marker_locals + draws.places[number])
    rows = zip(fit.trials, draws.trials, strict=True)
    drawn = tuple(_trial(fit, trial, trial_draws, number, (skeleton, bsp), knees) for trial, trial_draws in rows)
    return replace(fit, estimate=bsp, skeleton=skeleton, trials=drawn, posterior=None)


def drawn_bodies(estimate: BodySegmentParameters, draws: PosteriorDraws, number: int) -> BodySegmentParameters:
    """Return the parameters of a draw; segments that were not estimated keep theirs."""
    table = estimate.table().copy()
    table[[estimate.segments.index(name) for name in draws.segments]] = draws.bsp[number]
    return BodySegmentParameters.from_table(estimate.segments, table)


def drawn_joints(skeleton: Skeleton, draws: PosteriorDraws, number: int) -> Skeleton:
    """Return the skeleton with joint centres and axes as in a draw."""
    return skeleton.lock(dict(zip(draws.coordinates, draws.coordinate_values[number].tolist(), strict=True)))


def _trial(
    fit: Fit,
    trial: TrialFit,
    draws: TrialDraws,
    number: int,
    model: tuple[Skeleton, BodySegmentParameters],
    knees: bool,
) -> TrialFit:
    skeleton, bsp = model
    k, in_trial = trial.kinematics, trial.skeleton.marker_locals - fit.skeleton.marker_locals
    _, (moved,) = drawn_motions(trial, draws, [number])
    motion = moved if trial.trajectory is None else moved.cut(k.frames - k.trajectory_frames.start)
    reactions = drawn_reactions(trial.reactions, draws, number)
    drawn_skeleton = skeleton.with_positions(skeleton.marker_locals + in_trial)
    curves = trial.joint_curves
    if curves is not None:
        curves = curves.drawn(k, (drawn_skeleton, bsp, moved, reactions), drawn_knees(number) if knees else None)
    loads = inverse_dynamics(drawn_skeleton, bsp, motion, reactions.at(k.time))
    return replace(
        trial,
        skeleton=drawn_skeleton,
        motion=motion,
        trajectory=moved.q,
        reactions=reactions,
        joint_loads={**trial.joint_loads, "estimate": loads},
        deviations=None,
        joint_curves=curves,
    )


def drawn_motions(trial: TrialFit, draws: TrialDraws, numbers: Sequence[int]) -> tuple[np.ndarray, list[Motion]]:
    """Return the times (f,) s of `TrialFit.trajectory`, and the motion there in the draws with these numbers."""
    k = trial.kinematics
    time, trajectory = (k.time, trial.motion.q) if trial.trajectory is None else (k.trajectory_time, trial.trajectory)
    departures = draws.coefficients[numbers]
    some = departures if departures.any() else departures[:1]  # that are all the same
    moved = _steady_at_ends(BSpline(draws.knots, some.transpose(1, 0, 2).astype(float), _DEGREE), time, k)
    spline = interpolate(time, trajectory[:, None] + moved)
    orders = [np.ascontiguousarray(spline(time, order).swapaxes(0, 1)) for order in range(3)]
    motions = [Motion(*orders_of_draw) for orders_of_draw in zip(*orders, strict=True)]
    return time, motions if len(some) == len(numbers) else motions * len(numbers)


def _steady_at_ends(spline: BSpline, time: np.ndarray, k: Kinematics) -> np.ndarray:
    """Evaluate a spline at times (f,), with steady accelerations at the ends of the record, as in error bars."""
    result: np.ndarray = spline(time)
    steady_s = STEADY_INTERVALS * (spline.t[1] - spline.t[0])
    for end, innermost in zip(k.spline.time[[0, -1]], (-1, 0), strict=True):
        near = np.flatnonzero(np.abs(time - end) < steady_s)
        if near.size:
            at = time[near[innermost]]
            after = (time[near] - at)[:, None, None]
            growing = 1.0 + END_GROWTH * np.abs(after) / (3.0 * steady_s)
            result[near] = spline(at) + after * spline(at, 1) + 0.5 * after**2 * growing * spline(at, 2)
    return result


def drawn_knees(number: int) -> np.random.Generator:
    """Return the generator for the geometry of the knees in a draw: the same in all its trials."""
    return np.random.default_rng([_GEOMETRY_SEED, number])


def drawn_reactions(estimate: GroundReactions, draws: TrialDraws, number: int) -> GroundReactions:
    """Return the ground reactions with plate errors and delay as drawn.

    The estimate's errors are corrected already, so only the differences from them are applied: small ones add up.
    """
    departures = draws.plates[number].copy()
    departures[:, GAIN] /= 1.0 + draws.plate_gain
    standing = np.ascontiguousarray(estimate.loaded)
    shared = estimate.plate_index, departures, np.ascontiguousarray(draws.middles), np.ascontiguousarray(draws.turn)
    impact = corrected_loads(estimate.impact, np.zeros_like(standing), *shared)
    wrench = corrected_loads(estimate.wrench, standing, *shared) + draws.impact[number] * (impact + estimate.blurred)
    return replace(estimate, time=estimate.time - draws.delay_s[number], wrench=wrench, impact=impact)


@dataclass(frozen=True, eq=False)
class DrawnCurves:
    """Curves of d draws, as `CurveSource` has them of one trial.

    Attributes:
        angle: (n, c, d) coordinates at n times, rad and m.
        joint_moment: (n, j, 3, d) N m.
    """

    angle: Gapped
    joint_moment: Gapped

    @classmethod
    def of(
        cls,
        trial: TrialFit,
        draws: TrialDraws,
        numbers: Sequence[int],
        models: Sequence[Model],
        knees: bool,
        ankles: bool = False,
    ) -> Self:
        """Make the curves of the draws with these numbers, each with a model; with drawn knees and ankles if wanted.

        Of the models' markers no curve depends.
        """
        curves = trial.joint_curves
        time, motions = drawn_motions(trial, draws, numbers)
        angles = np.stack([drawn_motion.q for drawn_motion in motions], axis=2)
        through = partial(through_angles, derivative=0)
        if curves is None:
            nothing = np.empty((len(time), 0, 3, len(numbers)))
            return cls(Gapped.of(time, angles, through), Gapped.of(time, nothing, through_loads))
        joints, same = body_joints(trial.skeleton), _same_loads(draws, numbers)
        moments = np.empty((len(time), len(joints), 3, len(numbers)))
        for place, (number, motion, (skeleton, bsp)) in enumerate(zip(numbers, motions, models, strict=True)):
            if place == 0 or not same:
                foot_loads = drawn_reactions(trial.reactions, draws, number).at(time)
            moments_and_forces = joint_loads(skeleton, bsp, motion, foot_loads, joints)
            loads = replace(curves.joints["estimate"], moments=moments_and_forces[0], forces=moments_and_forces[1])
            if knees:
                random = drawn_knees(number)
                loads = with_drawn_knees(skeleton, joints, loads, random)
                loads = with_drawn_ankles(joints, loads, random) if ankles else loads
            moments[..., place] = loads.moments
        moments[~known_joints(trial.skeleton, curves.known)] = np.nan
        return cls(
            Gapped.of(time, np.where(_shown(curves)[..., None], angles, np.nan), through),
            Gapped.of(time, moments, through_loads),
        )


def drawn_forces(
    fit: Fit, trial: TrialFit, draws: TrialDraws, numbers: Sequence[int]
) -> Iterator[tuple[Motion, np.ndarray]]:
    """Yield motion and generalised forces (f, c) of the draws with these numbers, as `JointCurves` has them.

    Without joint curves they are those of the measured windows.
    """
    kept, known = kept_draws(fit), True if trial.joint_curves is None else trial.joint_curves.known
    for some in pieces(len(numbers), AT_ONCE):
        time, motions = drawn_motions(trial, draws, numbers[some])
        for number, motion in zip(numbers[some], motions, strict=True):
            skeleton, bsp = drawn_joints(fit.skeleton, kept, number), drawn_bodies(fit.estimate, kept, number)
            foot_loads = drawn_reactions(trial.reactions, draws, number).at(time)
            yield motion, np.where(known, inverse_dynamics(skeleton, bsp, motion, foot_loads), np.nan)


def _shown(curves: JointCurves) -> np.ndarray:
    """Return the mask (f, 1) of frames in which any joint's load is known."""
    result: np.ndarray = np.logical_or.reduce(curves.known, axis=1, keepdims=True)
    return result


def _same_loads(draws: TrialDraws, numbers: Sequence[int]) -> bool:
    """Return whether ground reactions are the same in all these draws."""
    departures = (draws.plates, draws.delay_s, draws.impact)
    return not any(departure[list(numbers)].any() for departure in departures)
