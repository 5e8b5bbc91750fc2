"""Tests whether body segment parameters from some trials explain another one better than the literature's.

Small residuals prove nothing on the trials for which they were minimised. Here each trial is held out in turn; the
parameters come from the rest and are fixed, and on the held-out trial only motion and calibration are estimated. The
remaining objective (half the sum of squares of markers, root residuals and calibration over their standard deviations)
is compared with that of the literature's parameters, fixed in the same way.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from kinertia.errors import KinertiaError
from kinertia.estimation.free_moment_sign import with_likelier_sign
from kinertia.estimation.prepared import Prepared, Progress
from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.fit import SimultaneousFit, fit_simultaneous
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import Bandwidth
from kinertia.model.bsp import BodySegmentParameters
from kinertia.motion.dynamics import residual
from kinertia.motion.kinematics import Kinematics
from kinertia.motion.workload import one_blas_thread
from kinertia.trial.sampled_data import rms_length

_FROZEN = 1e-3
"""Standard deviation of fixed parameters, as a share of the prior's."""


@dataclass(frozen=True)
class Explained:
    """Fit of a trial with fixed parameters.

    Attributes:
        objective: half the remaining sum of squares.
        force_rms_n, moment_rms_nm: RMS magnitude of the root residual.
        marker_rms_m: RMS distance of the markers.
    """

    objective: float
    force_rms_n: float
    moment_rms_nm: float
    marker_rms_m: float


@dataclass(frozen=True)
class HeldOut:
    """One trial, explained by the literature's parameters and by those from the other trials.

    Examples:
        >>> try:
        ...     kinertia.cross_validate(kinertia.prepare_subject("lab/subject.toml"))
        ... except kinertia.KinertiaError as error:
        ...     print(str(error).split(",")[0])
        cross-validation needs at least two trials
    """

    trial: str
    others: tuple[str, ...]
    literature: Explained
    estimate: Explained


@one_blas_thread
def cross_validate(
    ready: Prepared,
    cutoff_hz: float | Literal["gcv"] = "gcv",
    progress: Progress = lambda stage, share: None,
) -> tuple[HeldOut, ...]:
    """Hold out every trial in turn.

    The skeleton is calibrated on all trials at once, and the sign of free moments determined from all of them, for both
    sets of parameters.

    Args:
        ready: the person, with two trials or more.
        cutoff_hz: as in `Settings`.
        progress: called with the stage and the share done.

    Raises:
        KinertiaError: there are fewer than two trials.
    """
    trials = ready.kinematics
    if len(trials) < 2:
        raise KinertiaError(
            f"cross-validation needs at least two trials, one to hold out; the subject has {len(trials)}; add a "
            "[[trial]], or list a long one twice with a `name` and a `window_s` for each half"
        )
    used = Bandwidth.of(trials, cutoff_hz)

    def fit(trained: Prepared, otherwise: Sequence[Kinematics]) -> SimultaneousFit:
        return fit_simultaneous(
            trained.skeleton, trained.prior, trained.kinematics, used, trained.uncertainty, otherwise=otherwise
        )

    ready = with_likelier_sign(ready, fit).ready
    trials = ready.kinematics
    bandwidths = dict(zip(trials, used, strict=True))
    held_out = []
    for k, held in enumerate(trials):
        progress("held out", k / len(trials))
        others = [other for other in trials if other is not held]
        bandwidths_used = [bandwidths[other] for other in others]
        estimate = fit_simultaneous(ready.skeleton, ready.prior, others, bandwidths_used, ready.uncertainty).result.bsp
        explained = (_explained(ready, bsp, held, bandwidths[held]) for bsp in (ready.prior.mean, estimate))
        held_out.append(HeldOut(held.trial.name, tuple(other.trial.name for other in others), *explained))
    return tuple(held_out)


def frozen(prior: BspPrior, bsp: BodySegmentParameters) -> BspPrior:
    """Return a prior that fixes these parameters."""
    return replace(prior, mean=bsp, covariance=_FROZEN**2 * prior.covariance, mass_kg=bsp.total_mass_kg)


def _explained(ready: Prepared, bsp: BodySegmentParameters, held: Kinematics, bandwidth: Bandwidth) -> Explained:
    fitted = fit_simultaneous(ready.skeleton, frozen(ready.prior, bsp), [held], [bandwidth], ready.uncertainty)
    (motion,), (loads,) = fitted.motions, fitted.foot_loads
    model = fitted.skeleton
    left = residual(model, fitted.bsp, motion, loads.sum(axis=1))
    modelled = model.marker_positions(model.pose(motion.q))
    away = held.trial.markers.arranged(model.labels)[held.frames] - modelled
    return Explained(fitted.result.cost[1], rms_length(left[:, :3]), rms_length(left[:, 3:]), rms_length(away))
