"""Which marker set a recording has, and what of it: one limit for presets and named sets (D21)."""

import numpy as np
import pytest

from kinertia.diagnostics.markers.marker_set import labels_match, landmarks
from kinertia.findings.finding import Severity
from kinertia.io.marker_set_file import choose_marker_set, read_marker_set
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import Markers
from marker_contexts import codes, context_of
from recordings import here

SET = read_marker_set("plug-in-gait").without(["SACR"])


def found(labels, marker_set):
    markers = Markers(np.arange(3) / 100, tuple(labels), np.zeros((3, len(labels), 3)))
    return list(labels_match(context_of(markers, marker_set)))


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize(("share", "code"), [(1.0, None), (0.8, "L102"), (0.7, "L102"), (0.5, "L101")])
def test_missing_labels(share, code, named):
    """Those at the beginning are of the legs."""
    labels = SET.labels[::-1][: round(share * len(SET.labels))]
    findings = found(labels, SET if named else None)
    assert codes(findings) == ([code] if code else [])
    if code == "L102":
        assert (findings[0].severity, findings[0].evidence["missing"].value) == (
            Severity.INFO,
            len(SET.labels) - len(labels),
        )
        assert set(findings[0].where.markers) == set(SET.labels) - set(labels)
    if code == "L101":
        assert findings[0].severity is Severity.ERROR
        assert not named or findings[0].evidence["labels_found"].value == len(labels)


def test_a_sacral_marker_and_the_psis_stand_for_each_other():
    """Neither is missing where a laboratory uses the other."""
    whole = read_marker_set("plug-in-gait").labels
    for unused in (["SACR"], ["RPSI", "LPSI"]):
        assert found([label for label in whole if label not in unused], None) == []
    (finding,) = found([label for label in whole if label not in ("SACR", "LPSI")], None)
    assert finding.where.markers == ("LPSI",)
    (finding,) = found([label for label in whole if label not in ("SACR", "RPSI", "LPSI")], None)
    assert finding.where.markers == ("RPSI", "LPSI")


def test_labels_of_a_model():
    model = MarkerSet("scaled.osim", {}, {"foot_r": ("A", "B", "C"), "foot_l": ("D", "E", "F")}, {})
    assert codes(found(["A"], model)) == ["L102"]
    assert codes(found(["X"], model)) == ["L101"]


def test_other_spellings_are_remarks():
    labels = [label.lower() if label == "RASI" else label for label in SET.labels]
    (finding,) = found(labels, choose_marker_set(labels))
    assert (finding.code, finding.severity) == ("L103", Severity.INFO)
    assert (finding.evidence["written"].value, finding.evidence["label"].value) == ("rasi", "RASI")


@pytest.mark.parametrize("name", here(["synthetic/static.trc", "synthetic/static.c3d", "pig_c3d/subject_a_static.c3d"]))
def test_landmarks_of_static_trials(name, recording_of):
    static = recording_of(name)
    marker_set = choose_marker_set(static.markers.labels)
    assert list(landmarks(context_of(static, marker_set, is_static=True))) == []


def test_a_landmark_that_is_missing(recording_of):
    static = recording_of("synthetic/static.trc")
    marker_set = choose_marker_set(static.markers.labels)
    lateral = marker_set.landmarks["knee_lateral_r"][0]
    without = static.markers.select([label for label in static.markers.labels if label != lateral])
    (finding,) = landmarks(context_of(without, marker_set, is_static=True))
    assert (finding.code, finding.where.trial) == ("L105", "walk")


def test_a_landmark_that_one_can_do_without(recording_of):
    """L107 says what stands in its place; a leg's is a warning."""
    static = recording_of("synthetic/static.trc")
    marker_set = choose_marker_set(static.markers.labels)
    for landmark, part, severity in (("elbow_lateral_r", "arm_r", "INFO"), ("knee_medial_l", "knee_l", "WARNING")):
        (label,) = marker_set.landmarks[landmark]
        without = static.markers.select([kept for kept in static.markers.labels if kept != label])
        (finding,) = landmarks(context_of(without, marker_set, is_static=True))
        assert (finding.code, finding.where.part, finding.severity) == ("L107", part, Severity[severity])
        assert (finding.evidence["lacking"].value, finding.evidence["labels"].value[: len(label)]) == (landmark, label)
