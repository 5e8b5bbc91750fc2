"""What markers do long before and after the loads on plates is nobody's fault: people come and go."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.markers.trajectories import trajectories, visible
from kinertia.diagnostics.markers.unmeasured_data import frames
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import Markers
from kinertia.trial.plate_assignment import build_trial
from marker_contexts import changed, codes, context_of
from walk_on_plates import FEET, walk

FEET_ONLY = MarkerSet("feet", {}, {f"foot_{side}": tuple(labels) for side, labels in FEET.items()}, {})
STEPS = [("r", 1), ("l", 1)]
"""Loads from 1.2 to 2.3 s of 4 s."""
BEFORE, DURING, AFTER = 0.45, 1.45, 3.45
"""One foot swings."""


def recording(change=None):
    whole = walk(STEPS, duration_s=4.0)
    return whole if change is None else replace(whole, markers=changed(whole.markers, change))


def found(read, **options):
    context = context_of(read, FEET_ONLY, **options)
    return [*visible(context), *trajectories(context), *frames(context)]


def test_the_part_that_is_measured():
    assert context_of(recording(), FEET_ONLY).contact_span_s == pytest.approx((0.95, 2.549), abs=0.002)
    stated = context_of(recording(), FEET_ONLY, window_s=(0.5, 2.0))
    assert stated.contact_span_s == pytest.approx((0.5, 2.549), abs=0.002)
    assert context_of(recording(), FEET_ONLY, is_static=True).contact_span_s is None
    assert context_of(replace(recording(), plates=None), FEET_ONLY).contact_span_s is None
    empty = replace(recording().plates, force=0.0 * recording().plates.force)
    assert context_of(replace(recording(), plates=empty), FEET_ONLY).contact_span_s is None


@pytest.mark.parametrize(("at_s", "expected"), [(BEFORE, set()), (DURING, {"M111", "M112"}), (AFTER, set())])
def test_spikes_and_jumps(at_s, expected):
    def change(places, time):
        places[np.argmin(np.abs(time - at_s)), 2, 1] += 0.3
        places[time > at_s + 0.05, 3, 1] += 0.1

    assert {"M111", "M112"} & set(codes(found(recording(change)))) == expected


@pytest.mark.parametrize(("at_s", "expected"), [(BEFORE, True), (DURING, True), (AFTER, False)])
def test_missing_frames_make_late_what_comes_after_them(at_s, expected):
    whole = recording()
    time = whole.markers.time
    kept = np.abs(time - at_s - 0.05) > 0.05
    cut = Markers(time[: kept.sum()], whole.markers.labels, whole.markers.positions[kept])
    assert ("M121" in codes(found(replace(whole, markers=cut)))) == expected


def test_feet_that_are_seen_around_the_plates_only():
    def change(places, time):
        places[(time < 1.0) | (time > 2.5)] = np.nan

    seen = recording(change)
    assert found(seen) == []
    assert build_trial(seen, FEET).windows()


def test_a_foot_that_is_seen_elsewhere_only():
    def change(places, time):
        places[(time > 0.9) & (time < 2.6), :2] = np.nan

    assert codes(found(recording(change))) == ["M104"]
