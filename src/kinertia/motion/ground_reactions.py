"""Prepares the ground reactions for joint moments: at full rate, without forces that the motion cannot follow.

Below the hip, joint moments are forces times lever arms, and forces change within milliseconds where a foot lands or
leaves; filtered like the motion they are wrong there by several N m. But not every fast force belongs in a joint
moment. The load transferred from one foot to the other does not appear in the motion, since it cancels in the sum. An
impact does not cancel: it decelerates foot and shank, faster than markers can show, and in equations of motion that
lack this acceleration it appears as a spike at knee and hip (Bisseling and Hof 2006, J Biomech 39:2438; Kristianslund
et al. 2012, J Biomech 45:666).

So forces keep the bandwidth of the plates, and only the part of their sum that is faster than the motion is subtracted,
from the foot that causes it, where it exceeds the usual error of rigid segments. If forces and motion have one
bandwidth (the two-level estimate of the study), nothing is faster.

Forces that were low-pass filtered before lack what their plates measured, and spread each contact in time. That cannot
be undone, but its size can be told from what the same filter would take away again, and joint moments are as uncertain.

What a spline of 22 Hz leaves of the vertical force within a contact is 0.2 to 1.3 % of its peak (RMS) in 37 recordings
as plates gave them, and falls with the third power of the cutoff of a filter: 0.016 % after a zero-phase Butterworth
filter with its cutoff (-3 dB) at 10 Hz, within a factor of 2 in 80 % of recordings. So the cutoff is known within a
fifth or so. Less is left of somebody who lands softly.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from scipy.interpolate import make_lsq_spline

from kinertia.model.compiled import Float1, Float3, Int1, compiled, part
from kinertia.motion.kinematics import Kinematics
from kinertia.motion.smoothing import smooth
from kinertia.motion.workload import pieces
from kinertia.settings import ForceCutoff
from kinertia.trial.data import LOAD_THRESHOLD_N, FloatArray
from kinertia.trial.ground_contact import held_centre_of_pressure
from kinertia.trial.sampled_data import gaussian_mean, nearest_samples, rms_length, runs

IMPACT_SHARE_OF_WEIGHT = 0.01
"""Forces faster than the motion that stay below this (RMS over about one period, share of the mean vertical force) are
not an impact: twice the error of rigid segments (`observation.FORCE_SD_OF_WEIGHT`)."""
FIRM_SHARE_OF_PEAK = 0.1
"""Share of the largest vertical force below which a centre of pressure is too uncertain for an impact to act there."""
NOISE_LEFT_N = 1.0
"""Standard deviation of the noise that may remain in the vertical force."""
BLURRED_HZ, _BLURRED_TWICE = 12.5, 0.5
"""Forces were filtered if their bandwidth is below the first. With this share of what the filter would take away again,
moments of knees and ankles of four OpenSim truths, filtered at 10 Hz, are covered in 98 % (without it: 93 and 84)."""
_FORGOTTEN = 40
"""Number of samples beyond which a sample does not affect a natural cubic spline: each divides its weight by 3.7, so
that after this many it is below rounding."""
_EACH = 9
"""Columns of a foot: force, centre of pressure, and torque about it."""
_SPLINE_HZ, _DEGREE = 22.0, 5
_USUAL_HZ, _USUAL_SHARE, _POWER = 10.0, 1.6e-4, 3.0
"""A filter with its cutoff at the first leaves the second."""
_SHORTEST_S, _LONGEST_S, _LEAST_PEAK_N = 0.2, 1.5, 200.0
_BESIDE_S, _TRIMMED_S = 0.05, 0.008
"""A contact counts if the recording extends this far beyond it; its ends, where a reader may have set small forces to
zero, do not."""
_SAMPLES_PER_COEFFICIENT = 1.25
_LEAST_HZ = 5.0
"""Less than this is somebody who lands softly, or filters one after another."""


@dataclass(frozen=True, eq=False)
class GroundReactions:
    """Loads on both feet at the plates' samples.

    Attributes:
        time: (k,) s.
        wrench: (k, 2, 6) on right and left foot: force (N), moment about the ground origin (N m), ground axes.
        plate_index: (k, 2) index of the plate that each foot stands on, among those of the trial's `FootLoads`.
        impact: (k, 2, 6) part that motion cannot follow, whether it was subtracted or not: joint moments are uncertain
            by its effect, since the corresponding acceleration is missing.
        cutoff_hz: low-pass cutoff of the forces; None: as the plates gave them.
        noise_n: standard deviation of the plates' noise that remains in the forces.
        without_impact: whether the impact was subtracted from `wrench`.
        blurred: (k, 2, 6) part that a filter may have taken away before the file was written, standard deviation; zero
            where the forces were not filtered.
    """

    time: np.ndarray
    wrench: np.ndarray
    plate_index: np.ndarray
    impact: np.ndarray
    cutoff_hz: float | None
    noise_n: float = 0.0
    without_impact: bool = False
    blurred: np.ndarray | float = 0.0

    @property
    def whole(self) -> Self:
        """The ground reactions with the impact: the whole load on each foot, even if the motion cannot follow it."""
        if not self.without_impact:
            return self
        return replace(self, wrench=self.wrench + self.impact, without_impact=False)

    @property
    def impact_n(self) -> float:
        """RMS magnitude of the impact's force, N."""
        return rms_length(self.impact[..., :3].sum(axis=1))

    @property
    def loaded(self) -> np.ndarray:
        """Indicator (k, 2): 1 where the foot is loaded, else 0."""
        return (self.wrench[..., 1] > LOAD_THRESHOLD_N).astype(float)

    @cached_property
    def point(self) -> np.ndarray:
        """Centres of pressure (k, 2, 3) m, constant where there is almost no load."""
        return _points(self.wrench)

    @property
    def torque(self) -> np.ndarray:
        """Moment (k, 2, 3) N m about `point`: the free moment, and almost nothing about the horizontal axes."""
        return self.wrench[..., 3:] - np.cross(self.point, self.wrench[..., :3])

    def at(self, time: np.ndarray) -> np.ndarray:
        """Interpolate the loads (n, 2, 6) at these times by natural cubic splines of force, point and torque.

        OpenSim's tools interpolate the columns of the exported file in the same way.
        """
        return self.with_rate(time)[0]

    def with_rate(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Interpolate the loads as `at` does, and their time derivatives (n, 2, 6), N/s and N m/s."""
        parts = [np.empty((2, 0, 2, 6)), *(self._with_rate(time[some]) for some in pieces(len(time)))]
        loads, rates = zip(*parts, strict=True)
        return np.concatenate(loads), np.concatenate(rates)

    def _with_rate(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Interpolate from the samples around these times, as far as they have any effect."""
        first, last = np.searchsorted(self.time, (time.min(), time.max()))
        near = slice(max(int(first) - _FORGOTTEN, 0), int(last) + _FORGOTTEN)
        samples = self.time[near]
        interval = np.clip(np.searchsorted(samples, time, side="right") - 1, 0, len(samples) - 2)
        return loads_and_rates(samples, self.wrench[near], self.point[near], np.ascontiguousarray(time), interval)

    @property
    def uncertain(self) -> np.ndarray:
        """The part (k, 2, 6) of which one share, of mean 0 and standard deviation 1, may have to be added."""
        return self.impact + self.blurred

    def uncertain_at(self, time: np.ndarray) -> np.ndarray:
        """Return `uncertain` (n, 2, 6) at the samples nearest to these times."""
        return self.uncertain[nearest_samples(self.time, time)]

    def loaded_at(self, time: np.ndarray) -> np.ndarray:
        """Return `loaded` (n, 2) at the samples nearest to these times."""
        return self.loaded[nearest_samples(self.time, time)]


def measured_reactions(kinematics: Kinematics) -> GroundReactions:
    """Return the loads as the plates gave them, low-pass filtered only if the plates are noisy when unloaded."""
    loads, near = kinematics.trial.loads, kinematics.near_window
    time, wrench = loads.time[near], loads.wrench[near]
    rate_hz = (len(time) - 1) / (time[-1] - time[0])
    cutoff_hz = None
    if loads.noise_n > NOISE_LEFT_N:
        cutoff_hz = float(max(rate_hz / 2.0 * (NOISE_LEFT_N / loads.noise_n) ** 2, kinematics.cutoff_hz))
        wrench = _low_passed(time, wrench, cutoff_hz)
    noise_n = _noise_left(loads.noise_n, rate_hz, cutoff_hz)
    blurred = _blurred(time, wrench, load_bandwidth_hz(loads.time, loads.wrench[..., 1]))
    return GroundReactions(
        time, wrench, loads.plate_index[near], np.zeros(wrench.shape), cutoff_hz, noise_n, blurred=blurred
    )


def _blurred(time: np.ndarray, wrench: np.ndarray, bandwidth_hz: float | None) -> np.ndarray | float:
    """Estimate what a filter has taken from loads (k, 2, 6) of this bandwidth."""
    if bandwidth_hz is None or bandwidth_hz >= BLURRED_HZ:
        return 0.0
    result: np.ndarray = _BLURRED_TWICE * (wrench - _low_passed(time, wrench, bandwidth_hz))
    return result


def _noise_left(noise_n: float, rate_hz: float, cutoff_hz: float | None) -> float:
    """Return the standard deviation after filtering: white noise of SD s, cut off at f, keeps s sqrt(2 f / rate)."""
    return noise_n if cutoff_hz is None else noise_n * float(np.sqrt(min(2.0 * cutoff_hz / rate_hz, 1.0)))


def ground_reactions(kinematics: Kinematics, motion_hz: float, wanted: ForceCutoff = "auto") -> GroundReactions:
    """Prepare the ground reactions for joint moments of a motion with this bandwidth.

    Args:
        kinematics: of the trial.
        motion_hz: bandwidth of the motion.
        wanted: "auto" as described in this module; "none", as the plates gave them; or a low-pass cutoff, Hz.
    """
    measured = measured_reactions(kinematics)
    if not isinstance(wanted, str):
        loads, near = kinematics.trial.loads, kinematics.near_window
        wrench, time = _low_passed(measured.time, loads.wrench[near], wanted), measured.time
        noise_n = _noise_left(loads.noise_n, (len(time) - 1) / (time[-1] - time[0]), wanted)
        return replace(measured, wrench=wrench, cutoff_hz=wanted, noise_n=noise_n)
    impact = _impact(measured, motion_hz, kinematics.inside(measured.time))
    if wanted == "none":
        return replace(measured, impact=impact)
    return replace(measured, wrench=measured.wrench - impact, impact=impact, without_impact=True)


def _low_passed(time: np.ndarray, wrench: np.ndarray, cutoff_hz: float) -> np.ndarray:
    return smooth(time, wrench.reshape(len(time), -1), cutoff_hz)(time).reshape(wrench.shape)


def _impact(measured: GroundReactions, motion_hz: float, inside: np.ndarray) -> np.ndarray:
    """Compute the impact (k, 2, 6): summed force of both feet faster than the motion, beyond rigid segments' error.

    It is shared between the feet in proportion to the power of their own fast forces, and acts at each one's centre of
    pressure; while a foot lands or leaves, at that of its nearest reliable load, since an impact can be many times such
    a load. The mean vertical force is that of the samples (k,) in which all ground contact is measured.
    """
    force = measured.wrench[..., :3]
    fast = force - _low_passed(measured.time, force, motion_hz)
    step = float(np.median(np.diff(measured.time)))
    power = _around(np.square(fast).sum(axis=-1), step, motion_hz)
    both = fast.sum(axis=1)
    limit = (IMPACT_SHARE_OF_WEIGHT * force[inside, :, 1].sum(axis=1).mean()) ** 2
    of_both = _around(np.square(both).sum(axis=-1, keepdims=True), step, motion_hz)
    impact = np.maximum(1.0 - limit / np.maximum(of_both, 1e-12), 0.0) * both
    shares = power / np.maximum(power.sum(axis=1, keepdims=True), 1e-12)
    parts = shares[..., None] * impact[:, None]
    firm_n = max(FIRM_SHARE_OF_PEAK * measured.wrench[..., 1].max(), LOAD_THRESHOLD_N)
    return np.concatenate([parts, np.cross(_points(measured.wrench, firm_n), parts)], axis=-1)


def _points(wrench: np.ndarray, least_n: float = LOAD_THRESHOLD_N) -> np.ndarray:
    return np.stack([held_centre_of_pressure(wrench[:, foot], least_n) for foot in range(2)], axis=1)


def _around(values: np.ndarray, step_s: float, motion_hz: float) -> np.ndarray:
    """Return the mean over about half a period of the motion's cutoff."""
    return gaussian_mean(values, 0.25 / motion_hz / step_s)


@compiled
def loads_and_rates(
    time: Float1, wrench: Float3, point: Float3, at: Float1, interval: Int1
) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate loads (n, 2, 6) between samples, N and N m about the ground origin, with their time derivatives.

    Splines interpolate force, centre of pressure and torque about it; beyond the ends their cubics continue.

    Args:
        time: (k,) s, of at least two samples.
        wrench, point: (k, 2, 6) loads, and (k, 2, 3) m centres of pressure, at the samples.
        at: (n,) s.
        interval: (n,) index of the sample before each of these times, at most k - 2.
    """
    feet, n = wrench.shape[1], len(at)
    columns = _columns(wrench, point)
    bend = _second_derivatives(time, columns)
    loads, rates = np.empty((n, feet, 6)), np.empty((n, feet, 6))
    value, rate = np.empty(_EACH), np.empty(_EACH)
    for i in range(n):
        k = interval[i]
        step, s = time[k + 1] - time[k], at[i] - time[k]
        for foot in range(feet):
            for c in range(_EACH):
                j = _EACH * foot + c
                here, there = bend[k, j], bend[k + 1, j]
                slope = (columns[k + 1, j] - columns[k, j]) / step - step / 6.0 * (2.0 * here + there)
                turn = (there - here) / step
                value[c] = columns[k, j] + s * (slope + s * (here / 2.0 + s * turn / 6.0))
                rate[c] = slope + s * (here + s * turn / 2.0)
            x, y, z, fx, fy, fz = value[3], value[4], value[5], value[0], value[1], value[2]
            vx, vy, vz, gx, gy, gz = rate[3], rate[4], rate[5], rate[0], rate[1], rate[2]
            for c in range(3):
                loads[i, foot, c], rates[i, foot, c] = value[c], rate[c]
            loads[i, foot, 3] = value[6] + y * fz - z * fy
            loads[i, foot, 4] = value[7] + z * fx - x * fz
            loads[i, foot, 5] = value[8] + x * fy - y * fx
            rates[i, foot, 3] = rate[6] + vy * fz - vz * fy + y * gz - z * gy
            rates[i, foot, 4] = rate[7] + vz * fx - vx * fz + z * gx - x * gz
            rates[i, foot, 5] = rate[8] + vx * fy - vy * fx + x * gy - y * gx
    return loads, rates


@part
def _columns(wrench: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return the columns (k, 18) that are interpolated: for each foot force, centre of pressure and torque about it."""
    result = np.empty((wrench.shape[0], _EACH * wrench.shape[1]))
    for k in range(wrench.shape[0]):
        for foot in range(wrench.shape[1]):
            load, x, y, z = wrench[k, foot], point[k, foot, 0], point[k, foot, 1], point[k, foot, 2]
            columns = result[k, _EACH * foot : _EACH * (foot + 1)]
            for c in range(3):
                columns[c], columns[3 + c] = load[c], point[k, foot, c]
            columns[6] = load[3] - (y * load[2] - z * load[1])
            columns[7] = load[4] - (z * load[0] - x * load[2])
            columns[8] = load[5] - (x * load[1] - y * load[0])
    return result


@part
def _second_derivatives(time: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Compute second derivatives (k, c) at the samples of the natural cubic splines through columns (k, c)."""
    count, wide = columns.shape
    result, above = np.zeros((count, wide)), np.zeros(count)
    for k in range(1, count - 1):
        before, after = time[k] - time[k - 1], time[k + 1] - time[k]
        pivot = 2.0 * (before + after) - before * above[k - 1]
        above[k] = after / pivot
        for c in range(wide):
            change = (columns[k + 1, c] - columns[k, c]) / after - (columns[k, c] - columns[k - 1, c]) / before
            result[k, c] = (6.0 * change - before * result[k - 1, c]) / pivot
    for k in range(count - 2, 0, -1):
        for c in range(wide):
            result[k, c] -= above[k] * result[k + 1, c]
    return result


def load_bandwidth_hz(time: FloatArray, vertical: FloatArray) -> float | None:
    """Return the cutoff (Hz) of the low-pass filter that the loads look filtered with, median over contacts.

    Loads that were not filtered give 20 Hz or more. None where there is no whole contact of a step, or too few samples.

    Args:
        time: (k,) s.
        vertical: (k, p) N, vertical forces of plates or feet.
    """
    shares = [share for column in vertical.T for share in _fast_shares(time, np.nan_to_num(column))]
    if not shares:
        return None
    return max(_LEAST_HZ, float(_USUAL_HZ * (np.median(shares) / _USUAL_SHARE) ** (1.0 / _POWER)))


def _fast_shares(time: FloatArray, vertical: FloatArray) -> list[float]:
    """Return what the spline leaves of each contact (RMS), as share of its peak."""
    found = []
    for first, last in runs(vertical > LOAD_THRESHOLD_N):
        start_s, end_s = float(time[first]), float(time[last])
        whole = start_s - time[0] > _BESIDE_S and time[-1] - end_s > _BESIDE_S
        rows = (time >= start_s + _TRIMMED_S) & (time <= end_s - _TRIMMED_S)
        load = vertical[rows]
        if not whole or not _SHORTEST_S < end_s - start_s < _LONGEST_S or load.max(initial=0.0) < _LEAST_PEAK_N:
            continue
        at = np.linspace(start_s + _TRIMMED_S, end_s - _TRIMMED_S, len(load))  # files round times
        inner = np.linspace(at[0], at[-1], max(round(2.0 * _SPLINE_HZ * float(at[-1] - at[0])), 1) + 1)
        knots = np.r_[[at[0]] * _DEGREE, inner, [at[-1]] * _DEGREE]
        if len(at) < _SAMPLES_PER_COEFFICIENT * (len(knots) - _DEGREE - 1):
            continue
        left = load - make_lsq_spline(at, load, knots, _DEGREE)(at)
        found.append(float(np.sqrt(np.square(left).mean()) / load.max()))
    return found
