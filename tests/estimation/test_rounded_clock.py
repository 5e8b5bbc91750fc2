"""When a trial began changes nothing: what a clock adds to its times by rounding must not decide anything."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.simultaneous.linear_algebra.motion_basis import MotionBasis
from kinertia.io.opensim.reader import read_osim
from kinertia.settings import Subject
from kinertia.trial.ground_contact import bridged
from kinertia.trial.sampled_data import nearest_samples, span_s
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.check import check_recording
from kinertia.workflow.estimate import estimate_bsp
from kinertia.workflow.person import Person
from recordings import QUICK_WALKS, WALKS, marker_set_for, named_here, slow_beside

SUBJECT4 = ("subject4/walking1.trc", "subject4/walking1_grf.mot")
SEVERAL = WALKS | named_here({"subject4": SUBJECT4})
OF_MODELS = named_here(
    {
        "synthetic": ("synthetic/scaled.osim", *WALKS["synthetic"]),
        "subject4": ("subject4/addbiomechanics_scaled.osim", *SUBJECT4),
    }
)
MASS_KG = {"synthetic": 72.6, "subject4": 60.0}
LATER_S = (5.0, 10.0, 20.0, 1234.567)


def later(recording, by_s):
    """The same, begun later; times as a file tells them, to a microsecond."""
    markers, plates = (
        replace(part, time=np.round(part.time + by_s, 6)) for part in (recording.markers, recording.plates)
    )
    return replace(recording, markers=markers, plates=plates)


def placed(found):
    """What was found and where, whenever it was."""
    return found.code, found.severity, replace(found.where, span_s=None)


@pytest.mark.parametrize("by_s", LATER_S)
def test_as_many_samples_span_as_much_time(by_s):
    time = by_s + np.arange(131) / 100
    assert {span_s(time, k, k + 4) for k in range(120)} == {0.04}
    # 0.02 s between loaded samples: no gap that is bridged, wherever it is
    for k in range(1, 130):
        loaded = np.arange(131) != k
        np.testing.assert_array_equal(bridged(time, loaded), loaded)


@pytest.mark.parametrize("by_s", LATER_S)
def test_of_two_samples_as_near_the_later_counts(by_s):
    fast, slow = by_s + np.arange(101) / 200, by_s + np.arange(51) / 100
    np.testing.assert_array_equal(nearest_samples(slow, fast), (np.arange(101) + 1) // 2)


@pytest.mark.parametrize("spacing_s", [0.07, 0.04, 0.035, 0.02])
def test_as_many_knots(spacing_s):
    time = 0.13 + np.arange(113) / 100
    assert MotionBasis(time, spacing_s).size == round(1.12 / spacing_s) + 5
    for by_s in LATER_S:
        shifted = MotionBasis(np.round(time + by_s, 6), spacing_s)
        assert shifted.size == MotionBasis(time, spacing_s).size
        np.testing.assert_array_equal(shifted.first, MotionBasis(time, spacing_s).first)


@pytest.mark.parametrize("name", slow_beside((*QUICK_WALKS, "subject4"), SEVERAL))
def test_the_same_frames_and_findings(recording_of, name):
    recording = recording_of(*SEVERAL[name])
    marker_set = marker_set_for(recording.markers.labels)

    def found(checked):
        check = check_recording(checked, marker_set)
        return np.flatnonzero(check.context.trial.measured).tolist(), [placed(finding) for finding in check.findings]

    as_read = found(recording)
    assert len(as_read[0]) > 20
    for by_s in LATER_S:
        assert found(later(recording, by_s)) == as_read


@pytest.mark.parametrize("name", slow_beside(list(OF_MODELS)[-1:], OF_MODELS))
def test_the_same_estimate(file_of, recording_of, name):
    """In subject4's walk one knot more than 39 made the forces 4.8 ms late and lumbar moments 4.5 N m larger."""
    model_file, *files = OF_MODELS[name]
    model, walk = read_osim(file_of(model_file)), recording_of(*files)
    first, *others = (
        estimate_bsp(Person(Subject(mass_kg=MASS_KG[name]), [TrialInput(recording)], model=model))
        for recording in (walk, later(walk, 5.0), later(walk, 10.0))
    )
    loads, sd = first.trials[0].joint_loads["estimate"], first.trials[0].deviations.moments
    for other in others:
        change = (other.trials[0].joint_loads["estimate"] - loads) / np.maximum(sd, 1e-6)
        # rounding turns into this much where the search ends, and in single precision
        assert np.abs(change).max() < 1e-3
        assert [placed(finding) for finding in other.findings] == [placed(finding) for finding in first.findings]
