"""Of one fault in the markers or labels, one finding is left once causes have explained their consequences."""

import numpy as np
import pytest

from kinertia.diagnostics.registry import LABEL_MOTION_CHECKS, MARKER_MOTION_CHECKS
from kinertia.diagnostics.runner import asked, explained
from kinertia.findings.finding import Severity
from kinertia.io.marker_set_file import choose_marker_set
from marker_contexts import changed, context_of

MOTION = (*MARKER_MOTION_CHECKS, *LABEL_MOTION_CHECKS)


def frozen(places, time):
    places[100:140, 5] = places[100, 5]


def one_spike(places, time):
    places[100, 5, 0] += 0.3


def spikes(places, time):
    places[20::20, 5, 0] += 0.3


def swapped_for_a_while(places, time):
    places[100:140, [5, 20]] = places[100:140, [20, 5]]


def few_copies(places, time):
    places[40::40] = places[39:-1:40]


def held(places, time):
    places[:] = places[np.arange(len(time)) // 2 * 2]


def noisy(places, time):
    places += np.random.default_rng(107).normal(0.0, 0.01, places.shape)


def rounded(places, time):
    places[:] = np.round(places / 0.005) * 0.005


def mirrored(places, time):
    places[..., 2] *= -1.0


def in_millimetres(places, time):
    places *= 1000.0


@pytest.mark.parametrize(
    ("fault", "code", "severity"),
    [
        (frozen, "M113", Severity.WARNING),
        (one_spike, "M111", Severity.WARNING),
        (spikes, "M111", Severity.ERROR),
        (swapped_for_a_while, "L211", Severity.ERROR),
        (few_copies, "M122", Severity.WARNING),
        (held, "M123", Severity.ERROR),
        (noisy, "M132", Severity.WARNING),
        (rounded, "M131", Severity.WARNING),
        (mirrored, "L201", Severity.ERROR),
        (in_millimetres, "M141", Severity.ERROR),
    ],
)
def test_one_fault_has_one_cause(fault, code, severity, recording_of):
    walk = recording_of("synthetic/walk.c3d").markers
    context = context_of(changed(walk, fault), choose_marker_set(walk.labels))
    open_findings = [finding for finding in explained(asked(MOTION, context)) if finding.is_open]
    assert {(finding.code, finding.severity) for finding in open_findings} == {(code, severity)}


def test_labels_that_change_sides_are_no_missing_frames(recording_of):
    """Most markers jump at once, to where their counterparts were."""
    walk = recording_of("synthetic/walk.c3d").markers
    twins = [label.translate(str.maketrans("RL", "LR", "")) if label[:1] in "RL" else label for label in walk.labels]
    order = [walk.labels.index(twin) if twin in walk.labels else k for k, twin in enumerate(twins)]
    assert sum(k != own_place for k, own_place in enumerate(order)) > len(order) / 2

    def exchanged(places, time):
        places[180:] = places[180:, order]

    context = context_of(changed(walk, exchanged), choose_marker_set(walk.labels))
    open_findings = [finding for finding in explained(asked(MOTION, context)) if finding.is_open]
    assert {finding.code for finding in open_findings} == {"L211"}
