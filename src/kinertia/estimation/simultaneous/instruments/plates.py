"""Defines errors of force plates and synchronisation, corrects loads for them, and detects impacts.

Each plate may be displaced from its recorded position in the floor's plane, rotated about the vertical, have a wrong
gain, read a false vertical moment in proportion to the vertical force (crosstalk of its channels), and have a zero
offset of its horizontal forces, which acts at its middle while somebody stands on it. All plates may be displaced or
rotated together relative to the cameras; forces may be delayed, in all trials or in one. The plates belong to the
laboratory: their displacements are in its axes and are shared by all trials; their zero offsets are not.

The zero offsets are subtracted from the load on a plate first; then the load is rotated about the vertical through the
plate's middle, moved to the plate's true position, corrected for crosstalk into the vertical moment, and multiplied by
the gain. The errors of a plate are a row of seven: PLATE_ERRORS, then ZERO_UNKNOWNS, of `plates`.

When a foot lands, soft tissue swings after the bones, and the sum of the forces has a part that splines of the motion's
bandwidth cannot reproduce. Which part they can reproduce depends on where the landing lies between two knots. With full
weight, these frames would distort the motion, and shift the synchronisation delay to where the landing suits the knots:
for a walk whose forces were shifted in steps, the delay followed in jumps of a knot interval, tens of standard
deviations wide, and with the wrong sign as often as not. With less weight for these frames, three of the nine
parameters that contradicted the literature in thirteen measured trials no longer do.

Trials of one person on the same plates disagreed about synchronisation, plates and masses, jumps most of all, as long
as a frame of a jump counted as much as a frame of standing. The error of rigid segments is proportional to the force
that accelerates the body.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.interpolate import make_lsq_spline

from kinertia.model.compiled import Float2, Float3, Int2, compiled, part
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.smoothing import SmoothedSpline
from kinertia.trial.data import LOAD_THRESHOLD_N, FootLoads
from kinertia.trial.ground_contact import centre_of_pressure
from kinertia.trial.sampled_data import even_mean, greatest, runs

PLATE_UNKNOWNS = {"x": "m", "z": "m", "gain": "1", "free moment": "N m/N", "turn": "rad"}
"""Errors of each plate, with units: displacement in the floor's plane, relative error of the gain, missing vertical
moment per vertical force, and rotation about the vertical through its middle."""
FLOOR_UNKNOWNS = {"x": "m", "z": "m", "turn": "rad"}
"""Common errors of all plates: displacement relative to the floor that the cameras were calibrated to, and rotation
relative to its axes about the vertical, each plate about its middle. The cameras' axes are laid out by hand."""
PLATE_ERRORS = {**PLATE_UNKNOWNS, **FLOOR_UNKNOWNS}
"""All errors of a plate in all trials: its own and the common ones."""
ZERO_UNKNOWNS = {"zero x": "N", "zero z": "N"}
"""Errors of each plate in one trial, with units: excess horizontal force while somebody stands on it. Amplifiers drift
and are reset, so that the next trial has other zero offsets."""
_UP = np.array([0.0, 1.0, 0.0])
_FIRM_N = 5 * LOAD_THRESHOLD_N
X, Z, GAIN, FREE_MOMENT, TURN, ZERO_X, ZERO_Z = range(7)
"""Indices of a plate's errors."""
_BESIDE = 2.0
"""Ratio of the difference between a soft body and rigid segments to what is beyond the bandwidth, since the difference
does not end there. Chosen here: with it the estimated delay of two measured walks follows when their forces are
shifted, with 1 it jumps, and with 4 a delay is attributed to a plate."""
_PHASES = 4
"""Number of knot positions over which the residual of the splines is averaged."""
_FEWEST_FRAMES = 8
_LESS_WEIGHT = 2.0
"""Ratio to the standard deviation of other frames above which a frame has at most a quarter of the weight."""
SWING = 0.008
"""Root error per force that accelerates the body. Chosen on one person's trials: jumps, squats and walks agree about
their instruments as well as with 0.03, which costs walks some percent of the hip and back moments, the more the less
certain a plate is."""
_SWING_S = 0.1
"""Duration over which that force is averaged: soft tissue continues to swing for so long."""


def plates_with_floor(count: int) -> np.ndarray:
    """Return the matrix (5 p, 5 p + 3) from the plates' own and common unknowns to PLATE_ERRORS of p plates."""
    on_plate, floor = (
        np.array([[name == unknown for name in names] for unknown in PLATE_ERRORS], dtype=float)
        for names in (PLATE_UNKNOWNS, FLOOR_UNKNOWNS)
    )
    return np.hstack([np.kron(np.eye(count), on_plate), np.tile(floor, (count, 1))])


def plate_middles(loads: FootLoads, used: np.ndarray) -> np.ndarray:
    """Return the mean centre of pressure (p, 3) m on each of these plates of a trial."""
    point, vertical = centre_of_pressure(loads.wrench), loads.force[..., 1]
    firm = np.where(vertical > _FIRM_N, vertical, 0.0)
    result = np.zeros((len(used), 3))
    for k, plate in enumerate(used):
        weight = np.where(loads.plate_index == plate, firm, 0.0)
        if weight.any():
            result[k] = np.average(point[weight > 0.0], axis=0, weights=weight[weight > 0.0])
    return result


def turned_loads(loads: np.ndarray, middle: np.ndarray, angle_rad: np.ndarray | float) -> np.ndarray:
    """Rotate loads (..., 6) about the vertical through points (..., 3) m by angles (...) rad."""
    cosine, sine = (np.asarray(value)[..., None] for value in (np.cos(angle_rad), np.sin(angle_rad)))
    force, moment = loads[..., :3], loads[..., 3:] - np.cross(middle, loads[..., :3])
    force, moment = (
        _UP * vector + cosine * (vector - _UP * vector) + sine * np.cross(_UP, vector) for vector in (force, moment)
    )
    return np.concatenate([force, moment + np.cross(middle, force)], axis=-1)


@dataclass(frozen=True)
class FootPlates:
    """Ground reactions of one trial over time, and the plates that measured them.

    Attributes:
        loads: time -> (12) force and moment about the ground origin under the right foot, then the left, at the
            motion's bandwidth: for the root equations.
        loaded: time -> (2) whether the right foot, then the left, stands on a plate, at the same bandwidth.
        reactions: for joint moments, on the time base of the plates; its `plate_index` refers to the same `plates`.
        plates: names.
        plate_index: (n, 2) index into `plates` of the plate that each foot stands on, at the frames of the trial.
        turn: (3, 3) from the laboratory's axes to the trial's.
        middles: (p, 3) m, points about which the plates are rotated.
    """

    loads: SmoothedSpline
    loaded: SmoothedSpline
    reactions: GroundReactions
    plates: tuple[str, ...]
    plate_index: np.ndarray
    turn: np.ndarray
    middles: np.ndarray

    def among(self, plates: Sequence[str]) -> Self:
        """Return the reactions with these plates (a session's), which include its own."""
        if not self.plates:  # a trial without forces: nobody stands on the first
            return replace(self, plates=tuple(plates), middles=np.zeros((len(plates), 3)))
        column = np.array([plates.index(name) for name in self.plates])
        middles = np.zeros((len(plates), 3))
        middles[column] = self.middles
        reactions = replace(self.reactions, plate_index=column[self.reactions.plate_index])
        return replace(
            self, plates=tuple(plates), plate_index=column[self.plate_index], reactions=reactions, middles=middles
        )

    def by_plate(
        self, loads: np.ndarray, loaded: np.ndarray, plate_index: np.ndarray, plates: np.ndarray
    ) -> np.ndarray:
        """Compute the derivatives (n, 2, 6, p, 7) of corrected loads (n, 2, 6) by the errors of the plates (p, 7).

        `loaded` (n, 2) is 1 where the foot stands.
        """
        return by_plate(*self._as_compiled(loads, loaded, plate_index, plates))

    def corrected_loads(
        self, loads: np.ndarray, loaded: np.ndarray, plate_index: np.ndarray, plates: np.ndarray
    ) -> np.ndarray:
        """Correct loads (k, 2, 6) on plates (k, 2) with errors (p, 7), with zero offsets where `loaded` (k, 2)."""
        return corrected_loads(*self._as_compiled(loads, loaded, plate_index, plates))

    def _as_compiled(self, *arrays: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the arguments of the compiled functions: these, the middles and the rotation, all contiguous."""
        return tuple(map(np.ascontiguousarray, (*arrays, self.middles, self.turn)))


@compiled
def corrected_loads(
    loads: Float3,
    loaded: Float2,
    plate_index: Int2,
    plates: Float2,
    middles: Float2,
    turn: Float2,
) -> np.ndarray:
    """Correct loads on the feet (n, 2, 6) for the plates' errors.

    Args:
        loads: (n, 2, 6) as the plates gave them: force (N), moment about the ground origin (N m).
        loaded: (n, 2) 1 where the foot stands, so that zero offsets count.
        plate_index: (n, 2) index of the plate under each foot.
        plates: (p, 7) their errors.
        middles: (p, 3) m, centres of their rotation.
        turn: (3, 3) rotation from the laboratory's axes to the axes of the loads.
    """
    result, load, push = np.empty(loads.shape), np.empty(6), np.empty(6)
    for i in range(loads.shape[0]):
        for foot in range(loads.shape[1]):
            plate = plate_index[i, foot]
            for k in range(6):
                load[k] = loads[i, foot, k]
            for zero, axis in ((ZERO_X, 0), (ZERO_Z, 2)):
                _push(axis, middles[plate], turn, push)
                for k in range(6):
                    load[k] -= loaded[i, foot] * plates[plate, zero] * push[k]
            _correct(load, middles[plate], plates[plate], turn, result[i, foot])
    return result


@compiled
def by_plate(
    loads: Float3,
    loaded: Float2,
    plate_index: Int2,
    plates: Float2,
    middles: Float2,
    turn: Float2,
) -> np.ndarray:
    """Compute the derivatives (n, 2, 6, p, 7) of the output of `corrected_loads` by the plates' errors.

    The arguments are the same, except that `loads` (n, 2, 6) are corrected.
    """
    n, feet, _ = loads.shape
    result = np.zeros((n, feet, 6, len(plates), plates.shape[1]))
    # a zero offset acts as a force at the plate's middle, corrected like any load
    pushed, push = np.empty((len(plates), 2, 6)), np.empty(6)
    for plate in range(len(plates)):
        for k, axis in enumerate((0, 2)):
            _push(axis, middles[plate], turn, push)
            _correct(push, middles[plate], plates[plate], turn, pushed[plate, k])
    place = np.empty(3)
    for i in range(n):
        for foot in range(feet):
            plate = plate_index[i, foot]
            derivatives, load = result[i, foot, :, plate], loads[i, foot]
            for r in range(3):
                place[r] = middles[plate, r] + plates[plate, X] * turn[r, 0] + plates[plate, Z] * turn[r, 2]
            _by_place(load, turn, derivatives)
            _by_turn(load, place, derivatives)
            derivatives[4, FREE_MOMENT] = load[1]
            for k in range(6):
                derivatives[k, GAIN] = load[k] / (1.0 + plates[plate, GAIN])
                derivatives[k, ZERO_X] = -loaded[i, foot] * pushed[plate, 0, k]
                derivatives[k, ZERO_Z] = -loaded[i, foot] * pushed[plate, 1, k]
    return result


@part
def _push(axis: int, middle: np.ndarray, turn: np.ndarray, out: np.ndarray) -> None:
    """Write the load (6,) of 1 N along an axis of the laboratory at the middle of a plate into `out`."""
    x, y, z = turn[0, axis], turn[1, axis], turn[2, axis]
    out[0], out[1], out[2] = x, y, z
    out[3] = middle[1] * z - middle[2] * y
    out[4] = middle[2] * x - middle[0] * z
    out[5] = middle[0] * y - middle[1] * x


@part
def _correct(load: np.ndarray, middle: np.ndarray, wrong: np.ndarray, turn: np.ndarray, out: np.ndarray) -> None:
    """Write the plate load (6,), corrected for all errors except zero offsets, into `out`."""
    x, y, z = middle[0], middle[1], middle[2]
    fx, fy, fz = load[0], load[1], load[2]
    # about the middle
    mx, my, mz = load[3] - (y * fz - z * fy), load[4] - (z * fx - x * fz), load[5] - (x * fy - y * fx)
    cosine, sine = np.cos(wrong[TURN]), -np.sin(wrong[TURN])
    fx, fz = cosine * fx + sine * fz, cosine * fz - sine * fx
    mx, mz = cosine * mx + sine * mz, cosine * mz - sine * mx
    x += wrong[X] * turn[0, 0] + wrong[Z] * turn[0, 2]
    y += wrong[X] * turn[1, 0] + wrong[Z] * turn[1, 2]
    z += wrong[X] * turn[2, 0] + wrong[Z] * turn[2, 2]
    gain = 1.0 + wrong[GAIN]
    out[0], out[1], out[2] = gain * fx, gain * fy, gain * fz
    out[3] = gain * (mx + y * fz - z * fy)
    out[4] = gain * (my + z * fx - x * fz + wrong[FREE_MOMENT] * fy)
    out[5] = gain * (mz + x * fy - y * fx)


@part
def _by_place(load: np.ndarray, turn: np.ndarray, out: np.ndarray) -> None:
    """Write the derivatives of a corrected load (6,) by the plate's position to their columns of out (6, 7)."""
    for place, axis in ((X, 0), (Z, 2)):
        x, y, z = turn[0, axis], turn[1, axis], turn[2, axis]
        out[3, place] = y * load[2] - z * load[1]
        out[4, place] = z * load[0] - x * load[2]
        out[5, place] = x * load[1] - y * load[0]


@part
def _by_turn(load: np.ndarray, place: np.ndarray, out: np.ndarray) -> None:
    """Write the derivative of a corrected load (6,) by its plate's rotation, at this position (3,), to out (6, 7)."""
    x, y, z = place[0], place[1], place[2]
    mx, mz = load[3] - (y * load[2] - z * load[1]), load[5] - (x * load[1] - y * load[0])
    # the loads are rotated backwards: v becomes (-v_z, 0, v_x)
    fx, fz = -load[2], load[0]
    out[0, TURN], out[2, TURN] = fx, fz
    out[3, TURN] = y * fz - mz
    out[4, TURN] = z * fx - x * fz
    out[5, TURN] = mx - y * fx


def impact_factors(
    time: np.ndarray, force: np.ndarray, dynamic: np.ndarray, spacing_s: float, force_sd: float
) -> np.ndarray:
    """Return the factors (n,) by which the SD of the root residual is larger because of forces that the motion cannot
    follow.

    The acceleration of a quintic spline is a cubic spline with the same knots: what such splines leave of the force
    counts as its error, in the frames within half a knot interval.

    Args:
        time: (n,) s, of the frames.
        force: (n, 3) N, sum of the ground reactions, at the motion's bandwidth.
        dynamic: (n,) frames whose root residual counts.
        spacing_s: of the motion's knots.
        force_sd: standard deviation of the root residual elsewhere, N.

    >>> time = np.arange(100) / 100
    >>> push = 700.0 + 300.0 * np.exp(-(((time - 0.5) / 0.01) ** 2))
    >>> factors = impact_factors(time, np.outer(push, [0.0, 1.0, 0.0]), np.ones(100, bool), 1 / 30, 4.0)
    >>> bool(factors[50] > 10.0), float(factors[:20].max().round(2))
    (True, 1.0)
    """
    result = np.ones(len(time))
    for first, last in runs(dynamic):
        if last - first + 1 < _FEWEST_FRAMES:
            continue
        contact = slice(first, last + 1)
        step_s = (time[last] - time[first]) / (last - first)
        spacing = max(spacing_s, 2.0 * step_s)
        left = _left(time[contact], force[contact], spacing)
        near = greatest(left, 1 + 2 * round(0.5 * spacing / step_s))
        result[contact] = np.sqrt(1.0 + np.square(_BESIDE * near / force_sd))
    return result


def down_weighted(factors: np.ndarray) -> float:
    """Return the share of the frames (n,) that have at most a quarter of the weight with these factors."""
    return float((factors >= _LESS_WEIGHT).mean()) if len(factors) else 0.0


def _left(time: np.ndarray, force: np.ndarray, spacing_s: float) -> np.ndarray:
    """Return the RMS (n,) N, over axes and knot positions, of the residual of the force from cubic splines."""
    square = np.zeros(len(time))
    for phase in (np.arange(_PHASES) + 0.5) / _PHASES:
        inner = np.arange(time[0] + phase * spacing_s, time[-1], spacing_s)
        knots = np.concatenate([[time[0]] * 4, inner[inner < time[-1]], [time[-1]] * 4])
        # knots this even keep normal equations well conditioned; the time of scipy's QR grows with the square
        spline = make_lsq_spline(time, force, knots, k=3, method="norm-eq")
        square += np.square(force - spline(time)).mean(axis=1) / _PHASES
    return np.sqrt(square)


def swing_factors(
    time: np.ndarray, force: np.ndarray, dynamic: np.ndarray, weight_n: float, usual_n: float
) -> np.ndarray:
    """Return the factors (n,) by which the SD of the root residual is larger because the body is accelerated.

    Args:
        time: (n,) s, of the frames.
        force: (n, 3) N, sum of the ground reactions, of the motion's bandwidth.
        dynamic: (n,) frames whose root residual counts.
        weight_n: of the body.
        usual_n: standard deviation of the root residual of one frame within the band, without acceleration.

    >>> time, standing = np.arange(100) / 100, np.full(100, 700.0)
    >>> flight = np.where(time < 0.5, standing, 0.0)
    >>> factors = swing_factors(time, np.outer(flight, [0.0, 1.0, 0.0]), np.ones(100, bool), 700.0, 3.5)
    >>> factors[[20, 80]].round(2)
    array([1.  , 1.89])
    """
    accelerating = np.where(dynamic[:, None], force - [0.0, weight_n, 0.0], 0.0)
    frames = 1 + 2 * round(0.5 * _SWING_S * (len(time) - 1) / (time[-1] - time[0]))
    square = np.maximum(even_mean(np.square(accelerating).sum(axis=1), frames), 0.0)
    return np.sqrt(1.0 + square * (SWING / usual_n) ** 2)
