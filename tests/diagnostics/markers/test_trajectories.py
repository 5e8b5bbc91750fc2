"""Markers that spike, jump, freeze or swap labels, and frames that are missing, are found; what bodies do is not."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.evidence.trajectory_faults import without_frames_beside_gaps
from kinertia.diagnostics.markers.swapped_markers import label_swaps
from kinertia.diagnostics.markers.trajectories import trajectories
from kinertia.diagnostics.markers.unmeasured_data import frames
from kinertia.findings.finding import Severity
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import Markers
from marker_contexts import changed, codes, context_of

THIGH = MarkerSet("two", {}, {"thigh_r": ("A", "B")}, {})


def walking(count=200, rate_hz=100.0):
    time = np.arange(count) / rate_hz
    places = np.stack([np.sin(6 * time) * 0.4, 0.1 + 0.05 * np.cos(12 * time), 0.1 + 0 * time], axis=1)
    return Markers(time, ("A", "B"), np.stack([places, places + 0.3], axis=1))


def found(question, markers, **options):
    return list(question(context_of(markers, THIGH, **options)))


def everything(markers):
    return [answer for question in (trajectories, frames, label_swaps) for answer in found(question, markers)]


def noisy(sd_m):
    markers = walking()
    return replace(markers, positions=markers.positions + np.random.default_rng(102).normal(0.0, sd_m, (200, 2, 3)))


def test_a_fault_free_motion():
    assert everything(noisy(3e-4)) == []


def test_noisy_cameras_lose_no_frames():
    assert found(frames, noisy(0.003)) == []


@pytest.mark.parametrize("is_static", [False, True])
def test_spikes_are_errors_where_a_marker_has_several(is_static):
    def spike(places, time):
        places[10:30, 0] = np.nan
        places[[50, 90], 0, 1] += 0.3
        places[40::20, 1, 1] += 0.3

    *few, often = found(trajectories, changed(walking(), spike), is_static=is_static)
    assert {finding.code for finding in few} <= {"M111"}
    assert (often.code, often.severity, often.where.markers) == ("M111", Severity.ERROR, ("B",))
    assert often.evidence["frames"].value == 8
    assert often.evidence["first_s"].value == pytest.approx(0.4)
    assert often.evidence["distance_m"].value == pytest.approx(0.3, abs=0.01)
    assert [(finding.severity, finding.where.markers, finding.evidence["frames"].value) for finding in few] == (
        [] if is_static else [(Severity.WARNING, ("A",), 2.0)]
    )


@pytest.mark.parametrize(("rate_hz", "size_m", "severity"), [(100, 0.1, 3), (30, 0.13, 2), (30, 0.16, 3)])
def test_at_lower_rates_spikes_may_be_larger(rate_hz, size_m, severity):
    """Of an ERROR more than 80 mm at 60 Hz, 140 mm at 30 Hz, since accelerations account for more there (D16)."""

    def spike(places, time):
        places[20::20, 0, 2] += size_m

    (finding,) = found(trajectories, changed(walking(rate_hz=rate_hz), spike))
    assert (finding.code, finding.severity) == ("M111", severity)


def test_the_marker_of_a_sprinter_at_25_frames_a_second_is_no_spike():
    """130 m/s2 for single frames, which is 104 mm off the middle of their neighbours."""
    time = np.arange(60) / 25
    knees = np.convolve(np.where(np.arange(60) % 6 == 3, 130.0 / 25**2, 0.0), np.maximum(np.arange(60), 0.0))[:60]
    places = np.stack([8.0 * time, knees - np.polyval(np.polyfit(time, knees, 3), time), 0 * time], axis=1)
    markers = Markers(time, ("A", "B"), np.stack([places, places + 0.3], axis=1))
    assert found(trajectories, markers) == []


@pytest.mark.parametrize("size_m", [0.05, -0.1])
def test_jumps(size_m):
    def jump(places, time):
        places[time > 1.0, 1, 1] += size_m
        places[time > 1.5, 1, 0] += size_m

    first, second = found(trajectories, changed(walking(), jump))
    assert (first.code, first.where.markers, first.severity) == ("M112", ("B",), Severity.WARNING)
    assert first.evidence["step_m"].value == pytest.approx(abs(size_m), abs=0.002)
    assert [finding.evidence["time_s"].value for finding in (first, second)] == pytest.approx([1.01, 1.51])


@pytest.mark.parametrize("rate_hz", [60.0, 100.0, 250.0])
@pytest.mark.parametrize("shape", ["step there, step back", "drifts away, step back", "step there, drifts back"])
def test_a_marker_that_comes_back_at_once_does_not_jump(rate_hz, shape):
    off = {"step there, step back": [1, 1, 1], "drifts away, step back": [1 / 3, 2 / 3, 1]}.get(
        shape, [1, 2 / 3, 1 / 3]
    )

    def leave(places, time):
        places[100:103, 1, 2] += 0.1 * np.array(off)

    (spikes,) = found(trajectories, changed(walking(rate_hz=rate_hz), leave))
    assert (spikes.code, spikes.where.markers) == ("M111", ("B",))
    assert 1 <= spikes.evidence["frames"].value <= 3
    assert 0.05 < spikes.evidence["distance_m"].value < 0.11


@pytest.mark.parametrize("count", [2, 8, 20])
def test_missing_frames(count):
    markers = walking()
    kept = np.r_[0:60, 60 + count : 200]  # while the markers are fast
    (finding,) = found(frames, Markers(markers.time[: len(kept)], markers.labels, markers.positions[kept]))
    assert (finding.code, finding.severity) == ("M121", Severity.ERROR)
    assert finding.where.span_s == pytest.approx((0.59, 0.6))
    assert finding.evidence["frames"].value == pytest.approx(count, rel=0.3)


def test_every_cut_is_found():
    markers = walking()
    kept = np.r_[0:60, 70:120, 130:200]
    cuts = found(frames, Markers(markers.time[: len(kept)], markers.labels, markers.positions[kept]))
    assert [finding.evidence["time_s"].value for finding in cuts] == pytest.approx([0.6, 1.1])


def test_lower_rates_are_allowed_larger_steps():
    markers = walking()
    assert codes(everything(Markers(markers.time[::4], markers.labels, markers.positions[::4]))) == ["M124"]


def test_every_swap_of_labels_is_found():
    """At the beginning and the end (D22)."""

    def swap(places, time):
        rows = (time > 0.7) & (time < 1.1)
        places[rows] = places[rows][:, ::-1]

    swaps = found(label_swaps, changed(walking(), swap))
    assert codes(swaps) == ["L211", "L211"]
    assert {finding.where.markers for finding in swaps} == {("A", "B")}
    assert [finding.evidence["time_s"].value for finding in swaps] == pytest.approx([0.71, 1.1])
    assert swaps[0].evidence["distance_m"].value == pytest.approx(0.52, abs=0.01)


@pytest.mark.parametrize(("line", "code"), [(False, "M113"), (True, "M114")])
@pytest.mark.parametrize("step_m", [0.0, 1e-4])
def test_every_filled_interval_is_found(line, code, step_m):
    """All of them (D22), also where a file has positions to a tenth of a millimetre."""

    def fill(places, time):
        for start_s, end_s in ((0.5, 0.9), (1.1, 1.5)):
            rows = np.flatnonzero((time >= start_s) & (time <= end_s))
            for axis in range(3):
                ends = places[rows[[0, -1]], 0, axis] if line else places[rows[[0, 0]], 0, axis]
                places[rows, 0, axis] = np.interp(time[rows], time[rows[[0, -1]]], ends)
        if step_m:
            places[:] = np.round(places / step_m) * step_m

    markers = changed(walking(), fill)
    intervals = [finding for finding in found(trajectories, markers) if finding.code == code]
    assert [finding.where.markers for finding in intervals] == [("A",), ("A",)]
    spans = np.array([finding.where.span_s for finding in intervals])
    assert spans == pytest.approx(np.array([(0.5, 0.9), (1.1, 1.5)]), abs=0.03)
    assert found(trajectories, markers, is_static=True) == []


@pytest.mark.parametrize(("frames", "severity"), [(5, None), (15, Severity.WARNING), (150, Severity.ERROR)])
def test_two_labels_of_one_marker(frames, severity):
    def merge(places, time):
        places[20 : 20 + frames, 1] = places[20 : 20 + frames, 0] + [0.0, 0.001, 0.0]

    same = [finding for finding in found(trajectories, changed(walking(), merge)) if finding.code == "M115"]
    assert [(finding.severity, finding.where.markers) for finding in same] == (
        [] if severity is None else [(severity, ("A", "B"))]
    )
    for finding in same:
        assert finding.where.span_s == pytest.approx((0.2, 0.19 + frames / 100))
        assert finding.evidence["distance_m"].value == pytest.approx(0.001)


def test_a_single_frame_is_no_while():
    assert found(trajectories, walking(1)) == []


@pytest.mark.parametrize("frame", [30, 69])
def test_frames_beside_a_gap_in_which_another_marker_has_the_label_are_left_out(frame):
    def mislabel(places, time):
        places[[*range(20, 30), *range(70, 80)], 1] = np.nan
        places[frame, 1] = places[frame, 0]

    markers = changed(walking(), mislabel)
    (finding,) = found(trajectories, markers)
    assert (finding.code, finding.where.markers, finding.evidence["frames"].value) == ("M116", ("B",), 1.0)
    assert finding.evidence["first_s"].value == pytest.approx(frame / 100)
    mended = without_frames_beside_gaps(markers)
    assert np.isnan(mended.positions[frame, 1]).all()
    assert np.isfinite(mended.positions[30:70, 1]).all(axis=1).sum() == 39
    assert without_frames_beside_gaps(mended) is mended
