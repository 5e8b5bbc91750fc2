"""Makes a `Fit` whose motion, parameters and calibration are one draw from the posterior of another."""

from dataclasses import replace

import numpy as np
from scipy.interpolate import BSpline

from kinertia.errors import KinertiaError
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.estimation.simultaneous.instruments.plates import GAIN, corrected_loads
from kinertia.estimation.simultaneous.uncertainty.posterior_draws import PosteriorDraws, TrialDraws
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion, inverse_dynamics
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.smoothing import interpolate

_DEGREE = 5
_GEOMETRY_SEED = 5040
"""Of the knees' centres and axes, which are not among the estimate's unknowns: the same in all trials of a draw."""


def kept_draws(fit: Fit) -> PosteriorDraws:
    """Return the posterior draws stored with a fit.

    Raises:
        KinertiaError: the fit has none.
    """
    if fit.posterior is None:
        raise KinertiaError('the two-level method has no error bars to draw from: fit with method "simultaneous"')
    if fit.posterior.draws is None:
        raise KinertiaError("this result was saved by a version that kept no posterior draws; run kinertia fit again")
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
    bsp = _bsp(fit.estimate, draws, number)
    skeleton = _skeleton(fit, fit.skeleton, draws, number)
    rows = zip(fit.trials, draws.trials, strict=True)
    drawn = tuple(_trial(fit, trial, trial_draws, number, (skeleton, bsp), knees) for trial, trial_draws in rows)
    return replace(fit, estimate=bsp, skeleton=skeleton, trials=drawn, posterior=None)


def _bsp(estimate: BodySegmentParameters, draws: PosteriorDraws, number: int) -> BodySegmentParameters:
    """Return the parameters of a draw; segments that were not estimated keep theirs."""
    table = estimate.table().copy()
    table[[estimate.segments.index(name) for name in draws.segments]] = draws.bsp[number]
    return BodySegmentParameters.from_table(estimate.segments, table)


def _skeleton(fit: Fit, skeleton: Skeleton, draws: PosteriorDraws, number: int) -> Skeleton:
    """Move joint centres, axes and markers to those of a draw, except markers that are fixed in the model."""
    values = dict(zip(draws.coordinates, draws.coordinate_values[number].tolist(), strict=True))
    return skeleton.lock(values).with_positions(skeleton.marker_locals + draws.places[number])


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
    time, trajectory = (k.time, trial.motion.q) if trial.trajectory is None else (k.trajectory_time, trial.trajectory)
    trajectory = trajectory + BSpline(draws.knots, draws.coefficients[number].astype(float), _DEGREE)(time)
    spline = interpolate(time, trajectory)
    moved = Motion(*(spline(time, order) for order in range(3)))
    motion = moved if trial.trajectory is None else moved.cut(k.frames - k.trajectory_frames.start)
    reactions = _reactions(trial.reactions, draws, number)
    drawn_skeleton = skeleton.with_positions(skeleton.marker_locals + in_trial)
    curves = trial.joint_curves
    if curves is not None:
        random = np.random.default_rng([_GEOMETRY_SEED, number]) if knees else None
        curves = curves.drawn(k, (drawn_skeleton, bsp, moved, reactions), random)
    loads = inverse_dynamics(drawn_skeleton, bsp, motion, reactions.at(k.time))
    return replace(
        trial,
        skeleton=drawn_skeleton,
        motion=motion,
        trajectory=trajectory,
        reactions=reactions,
        joint_loads={**trial.joint_loads, "estimate": loads},
        deviations=None,
        joint_curves=curves,
    )


def _reactions(estimate: GroundReactions, draws: TrialDraws, number: int) -> GroundReactions:
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
