"""A model of another person, or with other labels, is told by its markers; the person's own never is."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.diagnostics.context import PersonContext, RecordingContext
from kinertia.diagnostics.model.model_on_person import model_and_trials, moved_markers, range_findings
from kinertia.diagnostics.runner import explained
from kinertia.findings.finding import Severity
from kinertia.io.opensim.reader import read_osim
from kinertia.model.coordinate_range import Range
from kinertia.model.imported_model import markers_of_model
from kinertia.settings import Subject
from kinertia.synthetic.walk import walk, walking_subject
from kinertia.trial.data import Markers
from people import codes, only_markers
from recordings import here

LAI_ARNOLD = "LaiArnoldModified2017_poly_withArms_weldHand_scaled.osim"


KNOWN = [
    ("synthetic/scaled.osim", "synthetic/walk.trc"),
    ("synthetic/scaled.osim", "synthetic/run.trc"),
    ("synthetic/scaled.osim", "synthetic/squats.trc"),
    ("gait2354/subject01_scaled.osim", "gait2354/subject01_walk1.trc"),
    ("rajagopal_walk/scaled.osim", "rajagopal_walk/motion_capture_walk.trc"),
    ("subject4/addbiomechanics_scaled.osim", "subject4/walking1.trc"),
    ("subject4/addbiomechanics_scaled.osim", "subject4/squats1.trc"),
    ("field/hamner_run/subject02_registered.osim", "field/hamner_run/subject02_running.trc"),
    ("field/hamner_treadmill_run/final.osim", "field/hamner_treadmill_run/run200.trc"),
    (f"field/laiarnold5_jump/{LAI_ARNOLD}", "field/laiarnold5_jump/DJ1.trc"),
    (f"field/laiarnold6_walk/{LAI_ARNOLD}", "field/laiarnold6_walk/walking1.trc"),
]


SOUND = here(KNOWN)


@pytest.fixture(scope="module", params=SOUND, ids=[walk for _, walk in SOUND])
def someone(request, file_of, recording_of):
    """A model, markers of a trial, and which are on which segment."""
    file, trial = request.param
    model = read_osim(file_of(file))
    marker_set = markers_of_model(model)
    markers = recording_of(trial).without_empty_markers().markers
    return model, markers.select([x for x in marker_set.labels if x in markers.labels]), marker_set


def found(model, walk, marker_set, positions=None):
    """Findings about a model, perhaps with other positions of its markers, that no other one explains."""
    used_set = marker_set if positions is None else replace(marker_set, in_model=positions)
    trial = RecordingContext(only_markers("walk", walk), used_set)
    context = PersonContext(Subject(name="person"), [trial], None, used_set, model)
    return [finding for finding in explained(model_and_trials(context)) if finding.is_open]


def relabelled(markers, exchanged):
    return Markers(markers.time, tuple(exchanged.get(label, label) for label in markers.labels), markers.positions)


def test_the_own_model(someone):
    assert found(*someone) == []


@pytest.mark.parametrize("size", [0.92, 0.95, 1.05, 1.08])
def test_the_model_of_a_person_of_another_size(someone, size):
    places = someone[2].in_model
    (finding,) = found(*someone, Markers(places.time, places.labels, size * places.positions))
    assert finding.code == "O404"
    assert finding.evidence["ratio"].value == pytest.approx(1.0 / size, abs=0.02)
    assert finding.severity is Severity.ERROR or abs(size - 1) < 0.06


@pytest.mark.parametrize("factor", [1000.0, 0.001])
def test_another_unit_of_length(someone, factor):
    places = someone[2].in_model
    (finding,) = found(*someone, Markers(places.time, places.labels, factor * places.positions))
    assert finding.code == "O401"


def test_left_and_right_exchanged_in_all_labels(someone):
    """Distances are those of the mirror image, which differ by little."""
    model, walk, marker_set = someone
    places = marker_set.in_model
    right = [label for label in places.labels if label[0] in "Rr"]
    pairs = {
        label: {"R": "L", "r": "L" if f"L{label[1:]}" in places.labels else "l"}[label[0]] + label[1:]
        for label in right
    }
    pairs = {label: other for label, other in pairs.items() if other in places.labels}
    exchanged = relabelled(walk, pairs | {other: label for label, other in pairs.items()})
    assert "O402" in codes(found(model, exchanged, marker_set))
    legs = replace(marker_set, segments=marker_set.segments | {"torso": ()})
    assert found(model, walk, legs) == []
    assert "O402" in codes(found(model, exchanged, legs))


@pytest.mark.parametrize("seed", range(10))
def test_markers_in_one_plane_do_not_tell_left_from_right(someone, seed):
    """Such as those of hips and shoulders alone: where they were put decides which of the two fits better."""
    model, walk, marker_set = someone
    places = marker_set.in_model
    trunk = [label for name in ("pelvis", "torso") for label in marker_set.segments[name] if label in walk.labels][:5]
    flat = Markers(places.time, places.labels, places.positions * [0.1, 1.0, 1.0])
    elsewhere = np.random.default_rng(seed).normal(0.0, 0.015, (1, len(trunk), 3))
    seen = Markers(np.zeros(1), tuple(trunk), flat.select(trunk).positions + elsewhere)
    few = replace(marker_set, segments={"pelvis": tuple(trunk[:3]), "torso": tuple(trunk[3:])})
    assert "O402" not in codes(found(model, seen, few, flat))


def test_heel_and_another_marker_of_the_foot_exchanged(someone):
    model, walk, marker_set = someone
    foot = [label for label in marker_set.segments["foot_r"] if label in walk.labels]
    at = marker_set.in_model
    heel, other = max(
        ((a, b) for a in foot for b in foot if a < b),
        key=lambda pair: np.linalg.norm(np.subtract(*at.select(pair).positions[0])),
    )
    swapped = [finding for finding in found(model, relabelled(walk, {heel: other, other: heel}), marker_set)]
    if len(foot) > 2:
        (swap,) = swapped
        assert (swap.code, swap.evidence["reference"].value) == ("L212", "model")
        assert {heel, other} & set(swap.where.markers)


def test_markers_that_were_never_placed(someone):
    places = someone[2].in_model
    away = np.random.default_rng(1).normal(0.0, 0.02, places.positions.shape)
    generic = Markers(places.time, places.labels, places.positions + away)
    assert {"O404", "O405"} & set(codes(found(*someone, generic)))


def test_markers_that_calibration_moved_far(file_of):
    before = read_osim(file_of("synthetic/scaled.osim")).skeleton
    trial = Markers(np.zeros(1), before.labels, np.zeros((1, len(before.labels), 3)))
    moved = {"R.Heel": 0.08, "R.Toe.Tip": 0.03, "Top.Head": 0.2}
    after = before.with_markers(
        [
            replace(marker, position=marker.position + np.array([moved.get(marker.label, 0.0), 0, 0]))
            for marker in before.markers
        ]
    )
    (finding,) = moved_markers(before, after, [trial])
    assert (finding.code, finding.where.markers, finding.where.part) == ("O407", ("R.Heel",), "foot_r")
    assert finding.evidence["distance_m"].value == pytest.approx(0.08)
    assert list(moved_markers(before, before, [trial])) == []


@pytest.fixture(scope="module")
def trial():
    return walk(walking_subject())


def clamped(trial, name, low, high):
    """The skeleton with this range (degrees), and what inverse kinematics makes of the walk."""
    bounded = Range(np.radians(low), np.radians(high), clamped=True)
    skeleton = replace(trial.skeleton, ranges={**trial.skeleton.ranges, name: bounded})
    q = skeleton.bounds.clamped(trial.motion.q)
    return skeleton, SimpleNamespace(q=q, coordinates=skeleton.coordinates)


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [("knee_angle_r", 20.0, 120.0), ("subtalar_angle_l", -0.3, 0.3), ("lumbar_rotation", -1.0, 1.0)],
)
def test_legs_and_trunk_that_the_model_holds_back(trial, name, low, high):
    skeleton, ik = clamped(trial, name, low, high)
    found = list(range_findings(skeleton, ik))
    assert [(finding.code, finding.where.part) for finding in found[:2]] == [("O311", name), ("O312", name)]
    assert found[0].evidence["range_rad"].value == pytest.approx(np.radians((low, high)))
    assert found[0].evidence["share"].value > 0.2


def test_sound_ranges_and_arms_are_not_doubted(trial):
    straight = np.degrees(np.quantile(trial.motion.q[:, trial.skeleton.coordinates.index("knee_angle_r")], 0.08))
    for name, low, high in (("knee_angle_r", -10.0, 120.0), ("knee_angle_r", straight, 120.0), ("arm_add_l", 5.0, 6.0)):
        skeleton, ik = clamped(trial, name, low, high)
        assert [finding for finding in range_findings(skeleton, ik) if finding.code == "O311"] == []


def test_a_coordinate_beyond_its_usual_range(trial):
    """Of a joint that nothing clamps."""
    knee = trial.motion.q[:, trial.skeleton.coordinates.index("knee_angle_r")]
    most = float(knee.max() - np.radians(20.0))
    usual = Range(float(knee.min() - 0.1), most, clamped=False, stated=True)
    skeleton = replace(trial.skeleton, ranges={**trial.skeleton.ranges, "knee_angle_r": usual})
    found = [
        reported
        for reported in range_findings(skeleton, SimpleNamespace(q=trial.motion.q, coordinates=skeleton.coordinates))
    ]
    (finding,) = (reported for reported in found if reported.where.part == "knee_angle_r")
    assert finding.code == "O312"
    assert np.degrees(finding.evidence["beyond_rad"].value) == pytest.approx(20.0, abs=0.1)
