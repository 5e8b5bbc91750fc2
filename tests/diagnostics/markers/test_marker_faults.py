"""Markers that spike, jump, freeze or change their labels are named; what bodies do is not."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.markers.marker_faults import (
    exchanged_trouble,
    jump_doubts,
    lost_frames_trouble,
    spikes_trouble,
    straight_doubts,
)
from kinertia.trial.data import Markers

SEGMENTS = {"thigh_r": ("A", "B")}


def _walking(frames=200):
    time = np.arange(frames) / 100
    places = np.stack([np.sin(6 * time) * 0.4, 0.1 + 0.05 * np.cos(12 * time), 0.1 + 0 * time], axis=1)
    return Markers(time, ("A", "B"), np.stack([places, places + 0.3], axis=1))


def test_spikes_are_named_and_a_gap_or_two_bad_frames_are_not():
    markers = _walking()
    assert spikes_trouble(markers) == ""
    spiked = markers.positions.copy()
    spiked[10:30, 0] = np.nan
    spiked[[50, 90], 0, 1] += 0.3
    assert spikes_trouble(replace(markers, positions=spiked)) == ""
    spiked[40::20, 1, 1] += 0.3
    trouble = spikes_trouble(replace(markers, positions=spiked))
    assert "B (8 times); the first at 0.400 s" in trouble
    assert "up to 300 mm" in trouble
    assert "A (" not in trouble


def changed(markers, change):
    places = markers.positions.copy()
    change(places, markers.time)
    return replace(markers, positions=places)


def test_a_sound_motion():
    noise = np.random.default_rng(2).normal(0.0, 3e-4, (200, 2, 3))
    markers = replace(_walking(), positions=_walking().positions + noise)
    assert lost_frames_trouble(markers) == exchanged_trouble(markers) == ""
    assert jump_doubts(markers) == straight_doubts(markers, SEGMENTS) == []


def test_noisy_cameras_lose_no_frames():
    noise = np.random.default_rng(2).normal(0.0, 0.003, (200, 2, 3))
    assert lost_frames_trouble(replace(_walking(), positions=_walking().positions + noise)) == ""


@pytest.mark.parametrize("size_m", [0.05, -0.1])
def test_jumps(size_m):
    def jump(places, time):
        places[time > 1.0, 1, 1] += size_m

    (doubt,) = jump_doubts(changed(_walking(), jump))
    assert f"B by {abs(1e3 * size_m):.0f} mm at 1.010 s" in doubt


@pytest.mark.parametrize("count", [2, 8, 20])
def test_lost_frames(count):
    markers = _walking()
    kept = np.r_[0:60, 60 + count : 200]  # while the markers are fast
    trouble = lost_frames_trouble(Markers(markers.time[: len(kept)], markers.labels, markers.positions[kept]))
    assert "between 0.590 and 0.600 s" in trouble
    lost = int(trouble.partition("(about ")[2].partition(")")[0])
    assert lost == pytest.approx(count, rel=0.3)


def test_lower_rates_are_allowed_larger_steps():
    markers = _walking()
    slow = Markers(markers.time[::4], markers.labels, markers.positions[::4])
    assert lost_frames_trouble(slow) == ""
    assert jump_doubts(slow) == []


def test_labels_exchanged_for_a_while():
    def exchange(places, time):
        rows = (time > 0.7) & (time < 1.1)
        places[rows] = places[rows][:, ::-1]

    trouble = exchanged_trouble(changed(_walking(), exchange))
    assert trouble.startswith(
        "the markers A and B exchange their places from one frame to the next at 0.710 s, 520 mm apart"
    )


@pytest.mark.parametrize(("line", "words"), [(False, "stands still"), (True, "straight line")])
@pytest.mark.parametrize("step_m", [0.0, 1e-4])
def test_invented_stretches(line, words, step_m):
    """Also where a file tells places to a tenth of a millimetre."""

    def invent(places, time):
        rows = np.flatnonzero((time >= 0.5) & (time <= 0.9))
        for axis in range(3):
            ends = places[rows[[0, -1]], 0, axis] if line else places[rows[[0, 0]], 0, axis]
            places[rows, 0, axis] = np.interp(time[rows], time[rows[[0, -1]]], ends)
        if step_m:
            places[:] = np.round(places / step_m) * step_m

    (doubt,) = straight_doubts(changed(_walking(), invent), SEGMENTS)
    assert words in doubt
    start, end = (float(doubt.partition(word)[2].split()[0]) for word in ("A from ", " to "))
    assert (start, end) == pytest.approx((0.5, 0.9), abs=0.03)
