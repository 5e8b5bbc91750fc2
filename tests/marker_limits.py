"""Cases of limits of findings about markers and labels.

A case is a function of one quantity that returns findings; a value just within the limit and one just beyond it, and
the severities found of each. Where the quantity is not the limit's own, a function gives its value at the limit.
"""

import numpy as np

from kinertia.diagnostics.markers.axes_and_floor import unit_and_vertical
from kinertia.diagnostics.markers.swapped_markers import rigidity
from kinertia.diagnostics.markers.trajectories import precision, trajectories, visible
from kinertia.diagnostics.markers.unmeasured_data import frames
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import Markers
from marker_contexts import context_of

THIGH = MarkerSet("two", {}, {"thigh_r": ("A", "B")}, {})


def moving(change=lambda places, time: None, rate_hz=100.0, count=200, marker_set=THIGH):
    """Two markers of a thigh that swing, after a change in place."""
    time = np.arange(count) / rate_hz
    swing = np.stack([np.sin(6 * time) * 0.4, 0.1 + 0.05 * np.cos(12 * time), 0.1 + 0 * time], axis=1)
    places = np.stack([swing, swing + 0.3], axis=1)
    change(places, time)
    return context_of(Markers(time, ("A", "B"), places), marker_set)


def shown(share):
    def hide(places, time):
        places[round(1000 * share) :, 1] = np.nan

    return visible(moving(hide, count=1000))


def hidden(seconds):
    def hide(places, time):
        places[500 : 500 + round(1000 * seconds), 1] = np.nan

    return visible(moving(hide, 1000.0, 2000))


def spiked(size_m, frames_off=(40, 80, 120)):
    def spike(places, time):
        places[list(frames_off), 1, 2] += size_m

    return trajectories(moving(spike))


def displaced_for(seconds, size_m=0.06):
    def jump(places, time):
        places[80 : 80 + round(100 * seconds), 1, 2] += size_m

    return trajectories(moving(jump))


def jumped(size_m):
    return displaced_for(9.0, size_m)


def after_a_gap(size_m):
    def hide(places, time):
        places[70:80, 1] = np.nan
        places[80, 1, 2] += size_m

    return trajectories(moving(hide))


def frozen(seconds):
    def freeze(places, time):
        places[500 : 500 + round(1000 * seconds), 1] = places[500, 1]

    return trajectories(moving(freeze, 1000.0, 2000))


def drawn(seconds):
    def straight(places, time):
        places[:, 1] = places[:, 0] + [0.3, 0.0, 0.0]
        span = slice(200, 200 + round(1000 * seconds))
        share = np.linspace(0.0, 1.0, len(time[span]))[:, None]
        places[span, 1] = (1 - share) * places[span, 1][0] + share * places[span, 1][-1]

    return trajectories(moving(straight, 1000.0, 2000))


def nearly_straight(off_m):
    def straight(places, time):
        span = slice(500, 800)
        share = np.linspace(0.0, 1.0, 300)[:, None]
        places[span, 1] = (1 - share) * places[span, 1][0] + share * places[span, 1][-1]
        places[span, 1, 2] += off_m * (np.arange(300) % 2)

    return trajectories(moving(straight, 1000.0, 2000))


def beside(distance_m, seconds=0.5):
    def approach(places, time):
        span = slice(500, 500 + round(1000 * seconds))
        places[span, 1] = places[span, 0] + [0.0, 0.0, distance_m]

    return trajectories(moving(approach, 1000.0, 2000))


def cut(step_m):
    def lose(places, time):
        places[100:, :, 2] += step_m

    return frames(moving(lose))


def copied(count):
    def repeat(places, time):
        for frame in range(30, 30 + 3 * round(count), 3):
            places[frame] = places[frame - 1]

    return frames(moving(repeat))


def rounded(step_m):
    def to_steps(places, time):
        places[:] = np.round(places / step_m) * step_m

    return precision(moving(to_steps))


def noisy(sd_m):
    def shake(places, time):
        places += np.random.default_rng(100).normal(0.0, sd_m, places.shape)

    return precision(moving(shake, count=2000))


def as_large(extent_m):
    places = np.zeros((20, 2, 3))
    places[:, 1, 1] = extent_m
    return unit_and_vertical(context_of(Markers(np.arange(20) / 100, ("A", "B"), places)))


def bending(change_m):
    def apart(places, time):
        places[:, 1] = places[:, 0]
        places[:, 1, 2] += 0.3 + change_m / 0.8 * np.linspace(0.0, 1.0, len(time))  # its 10th to 90th percentile

    return rigidity(moving(apart))


MARKER_LIMITS = {
    "M102 rare": (shown, 0.505, 0.495, [], ["INFO"]),
    "M103 gap": (hidden, 0.097, 0.103, [], ["INFO"]),
    "M111 spike": (spiked, 0.078, 0.082, ["WARNING"], ["ERROR"]),
    "M111 frames": (lambda n: spiked(0.2, (40, 80, 120)[: round(n)]), 2, 3, ["WARNING"], ["ERROR"]),
    "M111 brief": (displaced_for, 0.07, 0.06, [], ["WARNING"]),
    "M112 step": (jumped, 0.0385, 0.0415, [], ["WARNING"]),
    "M112 brief": (displaced_for, 0.06, 0.07, [], ["WARNING"] * 2),
    "M113 straight_for": (frozen, 0.148, 0.152, [], ["WARNING"]),
    "M114 straight_for": (drawn, 0.148, 0.152, [], ["WARNING"]),
    "M114 straight": (nearly_straight, 0.00017, 0.00013, [], ["WARNING"]),
    "M115 coinciding": (beside, 0.0031, 0.0029, [], ["WARNING"]),
    "M115 coinciding_for": (lambda s: beside(0.001, s), 0.099, 0.102, [], ["WARNING"]),
    "M116 step": (after_a_gap, 0.0385, 0.0415, [], ["CORRECTED"]),
    "M121 step": (cut, 0.0058, 0.0062, [], ["ERROR"]),
    "M122 few": (copied, 9, 10, ["WARNING"], ["ERROR"], lambda share: 199 * share),
    "M122 copied": (copied, 50, 49, [], ["ERROR"], lambda share: 199 * share),
    "M123 copied": (copied, 49, 50, [], ["ERROR"], lambda share: 199 * share),
    "M124 rate": (lambda hz: frames(moving(rate_hz=hz, count=5)), 45.1, 44.9, [], ["WARNING"]),
    "M131 coarse": (rounded, 0.0014, 0.0016, [], ["WARNING"]),
    "M132 noisy": (noisy, 0.0023, 0.0027, [], ["WARNING"]),
    "M141 smallest": (as_large, 0.305, 0.295, [], ["ERROR"]),
    "M141 largest": (as_large, 2.79, 2.81, [], ["ERROR"]),
    "L213 joint": (bending, 0.099, 0.101, [], ["ERROR"]),
}
