"""Ties the motion: root equations of a body whose trunk may bend, ranges of coordinates, and the start.

Where markers hardly determine a coordinate, the rotation of a forearm above all, the estimate would take it through
impossible poses, in long steps that do not end. The penalty is one-sided: the square of the excess, over a standard
deviation, once per knot interval. The standard deviation comes from anatomy (`range_of_motion`); where the model clamps
a range it is so small that the coordinate stays at the limit.

Limits are rounded off over a third of a degree: an excess x counts as s log(1 + exp(x / s)). At a sharp limit the
curvature of the cost would jump, and with it the standard deviations of everything near a range limit; a search that
meets such limits oscillates between them.

The outermost splines hardly affect the data, and markers may be missing for a while. A spline coefficient that nothing
else determines follows its neighbours: its change from the start may vary from one coefficient to the next by
CHANGE_SD. The change itself is nearly free, AWAY_SD. Otherwise each of the thousands of coefficients of a long trial
would fix a constant offset of a joint angle, which misplaced markers have put into the start, and count it as known.

Markers on chest and shoulders lean with the upper trunk. Head, abdomen and spine follow them only in part, so that some
mass is nearer to the vertical through the trunk's lowest joint than in a rigid trunk. A mass m at the height h over
that joint is displaced by s h (y - u): s is the share that stays upright, y points up, and u along the trunk. The sum
of s m h is one unknown per trial, kappa (kg m), since the amount of bending depends on the task.

To first order in kappa the root load changes by the effect of a first moment of -kappa along u in a rigid trunk, with
the corresponding inertia, and by the moment of a displacement that always points up: kappa y x f, where f is the
specific force at the trunk (acceleration less gravity). It is taken from the ground reactions: f = F / mass.
"""

from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from scipy.special import expit

from kinertia.estimation.simultaneous.inputs import BSP, FreedModel, Given, Unknowns
from kinertia.estimation.simultaneous.instruments.instrument_errors import BENDING, CalibrationEntry
from kinertia.estimation.simultaneous.linear_algebra.frame_blocks import TimeBlock
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import Gradient, NormalEquations
from kinertia.estimation.simultaneous.mixture_prior import ErrorPriors, FaultMixture
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm, InTrial, Solution
from kinertia.estimation.simultaneous.terms.root_terms import OfSegment, RootFrames, add_root, columns_of
from kinertia.model.anatomy import segment_of
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.coordinate_range import Bounds
from kinertia.motion.dynamics import Motion
from kinertia.motion.workload import pieces

_ROUNDED = 0.005
"""Angle or length (rad or m) over which a limit is rounded off, s above."""
_NOTHING = 8.0
"""Distance within the range, in units of the rounding, beyond which the penalty is zero: it would be a millionth."""
CHANGE_SD, AWAY_SD = 1.0, 30.0
"""Standard deviations (rad or m): of the difference from one coefficient to the next, and of each by itself."""
BENDING_PRIOR_M = FaultMixture(0.001, 0.02, 0.1)
"""Prior of kappa over the body's mass: a trunk that is rigid, and one that bends. Under a prior of 0.015 m, a person of
63 kg had 0.4 to 0.8 kg m in walks, 1.0 swaying, 1.4 to 2.3 in jumps and 2.5 in squats: 0.006 to 0.04 m. Walks hardly
determine it, and if it is zero, a wide prior makes the trunk's centre of mass less certain: so it needs evidence."""
_MIDDLE = 1.5
"""Mean height of the displaced mass over that of the trunk's centre of mass: deflections of a uniform rod that is
clamped at its lower end grow with the square of the height, which puts their mean at three quarters of its length."""
_MOST_OF_TRUNK = 0.7
"""Least share of the trunk's mass in one body; a model with less already has a trunk that bends."""


class RangeTerms(NamedTuple):
    """Penalty of coordinates (n, c) beyond their ranges.

    Attributes:
        curvature: (n, c) second derivatives of the cost; zero well within the range.
        pull: (n, c) back into the range: minus the first derivatives.
        cost: half the sum of squares.
    """

    curvature: np.ndarray
    pull: np.ndarray
    cost: float

    @classmethod
    def of(cls, bounds: Bounds, q: np.ndarray, frames_per_interval: float) -> Self:
        """Compute the penalty of coordinates q (n, c), rad and m.

        >>> import numpy as np
        >>> from kinertia.model.coordinate_range import Range
        >>> bounds = Bounds.of(("elbow",), {"elbow": Range(0.0, 2.6, clamped=True)})
        >>> terms = RangeTerms.of(bounds, np.array([[1.0], [2.65]]), frames_per_interval=1.0)
        >>> terms.curvature.ravel().round(), terms.pull.ravel().round(), round(terms.cost, 2)
        (array([    0., 10000.]), array([  -0., -500.]), 12.5)
        """
        curvature, pull, cost = np.zeros_like(q), np.zeros_like(q), 0.0
        for side, end, sd in bounds.ends:
            beyond = np.where(np.isfinite(end), side * (q - end), -np.inf) / _ROUNDED
            rows, columns = np.nonzero(beyond > -_NOTHING)
            x = beyond[rows, columns]
            weight = sd[columns] ** -2.0 / frames_per_interval
            paid, slope = _ROUNDED * np.logaddexp(0.0, x), expit(x)
            cost += 0.5 * float((weight * np.square(paid)).sum())
            pull[rows, columns] -= side * weight * paid * slope
            curvature[rows, columns] += weight * slope * (slope + paid * (1.0 - slope) / _ROUNDED)
        return cls(curvature, pull, cost)


class JointRanges(CostTerm):
    """Penalty of the coordinates of all trials beyond their ranges."""

    def add(self, into: Gradient, here: InTrial) -> None:
        """Add the penalty in a time block."""
        frames = here.time_block.frames
        first = frames.start - here.time_block.with_neighbours.start
        q = here.near_q[first : first + frames.stop - frames.start, self.given.moving]
        add_ranges(into, self.given.bases[here.k], here.time_block, self.given.skeleton.bounds, q)


def add_ranges(into: Gradient, basis: MotionBasis, time_block: TimeBlock, bounds: Bounds, q: np.ndarray) -> None:
    """Add the penalty of the coordinates q (f, c) in the frames of a time block.

    Args:
        into: zero, or with other terms.
        basis: of the motion.
        time_block: of the trial.
        bounds: of the coordinates that move.
        q: rad and m.
    """
    terms = RangeTerms.of(bounds, q, len(basis.first) / basis.size)
    into.cost += terms.cost
    paying = np.flatnonzero(terms.curvature.any(axis=1))
    values = basis.values[0, time_block.frames][paying]
    at = basis.first[time_block.frames][paying] - time_block.splines.start
    columns = np.arange(q.shape[1])
    for i in range(values.shape[1]):
        np.add.at(into.rhs, at + i, values[:, i, None] * terms.pull[paying])
        if isinstance(into, NormalEquations):
            for j in range(i, values.shape[1]):
                square = (values[:, i] * values[:, j])[:, None] * terms.curvature[paying]
                np.add.at(into.band[:, j - i], (at[:, None] + i, columns, columns), square)


class Start(CostTerm):
    """Cost that ties the motion of every trial to its start."""

    def add(self, into: Gradient, here: InTrial) -> None:
        """Add the cost in a time block."""
        add_start(into, here.time_block, here.coefficients - self.given.start[here.k])


def add_start(into: Gradient, time_block: TimeBlock, moved: np.ndarray) -> None:
    """Add the terms of a time block's own splines.

    Args:
        into: zero, or with other terms.
        time_block: of the trial.
        moved: (splines, c) distance of all coefficients of the trial from their start.
    """
    inside, following = moved[time_block.splines], moved[time_block.splines.start + 1 : time_block.splines.stop + 1]
    count, pairs = len(inside), min(len(following), time_block.size - 1)
    change = following[:pairs] - inside[:pairs]
    into.rhs[:count] -= inside / AWAY_SD**2
    into.rhs[:pairs] += change / CHANGE_SD**2
    into.rhs[1 : pairs + 1] -= change / CHANGE_SD**2
    into.cost += 0.5 * float(np.square(inside / AWAY_SD).sum() + np.square(change / CHANGE_SD).sum())
    if isinstance(into, NormalEquations):
        coordinates = np.arange(moved.shape[1])
        into.band[:count, 0, coordinates, coordinates] += 1.0 / AWAY_SD**2
        into.band[:pairs, 0, coordinates, coordinates] += 1.0 / CHANGE_SD**2
        into.band[1 : pairs + 1, 0, coordinates, coordinates] += 1.0 / CHANGE_SD**2
        into.band[:pairs, 1, coordinates, coordinates] -= 1.0 / CHANGE_SD**2


class RootLoads(CostTerm):
    """The root equations at the dynamic frames of all trials; they add no unknowns, and depend on other terms'."""

    order: ClassVar[int] = 100

    def __init__(self, model: FreedModel) -> None:
        super().__init__(model)
        given = self.given
        self._columns = columns_of(given.free, model.segments, given.moving, given.still, self.layout)

    def add(self, into: Gradient, here: InTrial) -> None:
        """Add the squares of the residuals, each over its standard deviation."""
        basis, frames, start = self.given.bases[here.k], here.time_block.frames, here.time_block.splines.start
        dynamic = frames.start + np.flatnonzero(self.given.trials[here.k].dynamic[frames])
        for piece in pieces(len(dynamic)):
            root = self._at(here, dynamic[piece])
            if not isinstance(into, NormalEquations):
                root.add_gradient(into, self._columns, basis, start)
            elif into.bordered:
                add_root(into, self.layout.in_root, basis, start, root.terms(self._columns))
            else:
                add_root(into, slice(0, 0), basis, start, root.of_motion.terms(self._columns.of_motion))

    def _at(self, here: InTrial, frames: np.ndarray) -> RootFrames:
        """Return the equations at some frames, with the changes by other terms."""
        k, static = here.k, here.static
        motion = self.model.full(self.given.bases[k].evaluate(here.coefficients, frames), static)
        wrench, by_errors = here.loads.root(k, static, frames)
        root = RootFrames(
            skeleton=self.given.free,
            bsp=self.model.bsp(static),
            theta=static[self.layout[BSP]],
            motion=Motion(*motion),
            wrench=wrench,
            by_errors=by_errors,
            by_single=here.loads.on_feet(k, static, 1, frames).sum(axis=1)[..., None],
            at=(here.loads.delay_unknowns(k),),
            sd=self.given.trials[k].root_sd(frames),
            frames=frames,
            static=self.layout.in_root.stop,
        )
        for term in here.terms:
            root = term.in_root(root, k, static)
        return root


@dataclass(frozen=True, eq=False)
class BendingTrunk:
    """The trunk of a model, and the effect of one unit of kappa (kg m).

    Attributes:
        row: index of the trunk among the segments.
        parameters: (10,) change of its dynamic parameters.
        mass_kg: of the whole body.
    """

    row: int
    parameters: np.ndarray
    mass_kg: float

    @classmethod
    def of(cls, bsp: BodySegmentParameters, mass_kg: float) -> Self | None:
        """Find the trunk of these segments, for a body of this mass; None if none extends from its origin."""
        trunk = [k for k, name in enumerate(bsp.segments) if segment_of(name) == "torso"]
        if not trunk:
            return None
        row = max(trunk, key=lambda k: bsp.mass_kg[k])
        height_m = float(bsp.com_m[row, 1])
        if height_m <= 0.0 or bsp.mass_kg[row] < _MOST_OF_TRUNK * bsp.mass_kg[trunk].sum():
            return None
        parameters = np.zeros(10)
        parameters[2] = -1.0
        parameters[[4, 9]] = -2.0 * _MIDDLE * height_m  # displaced, and its distance from the joint changed
        return cls(row, parameters, mass_kg)

    @property
    def prior(self) -> FaultMixture:
        """Prior of kappa, kg m."""
        known = BENDING_PRIOR_M
        return FaultMixture(self.mass_kg * known.nominal_sd, self.mass_kg * known.faulty_sd, known.fault_probability)

    def bent(self, bsp: BodySegmentParameters, kappa: float) -> BodySegmentParameters:
        """Return parameters with the effect of a bending trunk on motion; they need not be physically possible."""
        if not kappa:
            return bsp
        parameters = bsp.dynamic_parameters().reshape(-1, 10)
        parameters[self.row] += kappa * self.parameters
        return BodySegmentParameters.from_dynamic_parameters(bsp.segments, parameters.ravel())


class TrunkBending(CostTerm):
    """Bending of the trunk in each trial; without effect in models without a trunk."""

    order: ClassVar[int] = 35

    @classmethod
    def unknowns(cls, given: Given) -> tuple[Unknowns, ...]:
        """Return kappa of each trial. The prior does not depend on the person."""
        trunk = BendingTrunk.of(given.prior.mean, given.prior.mass_kg)
        priors = ErrorPriors((trunk.prior,) * len(given.trials) if trunk else ())
        return (Unknowns.errors(BENDING, "kg m", priors, in_models=False),)

    def __init__(self, model: FreedModel) -> None:
        super().__init__(model)
        self.trunk = BendingTrunk.of(self.given.prior.mean, self.given.prior.mass_kg)

    def in_root(self, root: RootFrames, k: int, static: np.ndarray) -> RootFrames:
        """Subtract the moment kappa y x F / mass of the ground reactions, and include a trunk that bends."""
        if self.trunk is None:
            return root
        place = self.layout[BENDING].start + k
        kappa = static[place]
        by_kappa = _upright(root.wrench / self.trunk.mass_kg, 1.0)
        share = kappa / self.trunk.mass_kg
        by_single = root.by_single + _upright(root.by_single, share)
        return replace(
            root,
            bsp=self.trunk.bent(root.bsp, kappa),
            wrench=root.wrench + _upright(root.wrench, share),
            by_errors=tuple((by + _upright(by, share), add) for by, add in root.by_errors),
            by_single=np.concatenate([by_single, by_kappa[..., None]], axis=2),
            at=(*root.at, [place]),
            of_segments=(*root.of_segments, OfSegment(place, self.trunk.row, self.trunk.parameters)),
        )

    def read(self, solution: Solution) -> dict[str, Any]:
        """Return kappa of each trial with its standard deviation, kg m."""
        found = solution.pairs(self.layout[BENDING])
        entries = [
            CalibrationEntry(
                kind="trunk",
                trial=trial.name,
                quantity=BENDING,
                value=kappa,
                prior_sd=self.given.prior.mass_kg * BENDING_PRIOR_M.sd,
                sd=sd,
                unit="kg m",
            )
            for trial, (kappa, sd) in zip(self.given.trials, found, strict=False)
            if trial.ground.plates  # other trials do not determine it
        ]
        return {"calibration": tuple(entries)}


def _upright(loads: np.ndarray, share_m: float) -> np.ndarray:
    """Return the moment -share y x F of ground reactions (d, 6), or of their derivatives (d, 6, ...)."""
    result = np.zeros_like(loads)
    result[:, 3], result[:, 5] = -share_m * loads[:, 2], share_m * loads[:, 0]
    return result
