"""A model of another person, or with other labels, is told by its markers; the person's own never is."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.model.model_on_person import model_on_person_doubts, model_on_person_trouble, moved_doubts
from kinertia.io.osim.reader import read_osim
from kinertia.model.model_markers import markers_of_model
from kinertia.trial.data import Markers
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


@pytest.fixture(params=SOUND, ids=[walk for _, walk in SOUND])
def person(request, file_of, recording_of):
    """Places of a model's markers, a trial's, and which are on which segment."""
    model, trial = request.param
    marker_set = markers_of_model(read_osim(file_of(model)))
    markers = recording_of(trial).without_empty_markers().markers
    return marker_set.in_model, markers.select([x for x in marker_set.labels if x in markers.labels]), marker_set


def relabelled(markers, exchanged):
    return Markers(markers.time, tuple(exchanged.get(label, label) for label in markers.labels), markers.positions)


def test_the_own_model(person):
    assert model_on_person_trouble(*person) == ""
    assert model_on_person_doubts(*person) == []


@pytest.mark.parametrize("size", [0.92, 0.95, 1.05, 1.08])
def test_the_model_of_a_person_of_another_size(person, size):
    places, walk, marker_set = person
    other = Markers(places.time, places.labels, size * places.positions)
    told = model_on_person_trouble(other, walk, marker_set) or model_on_person_doubts(other, walk, marker_set)[0]
    assert ("longer" if size < 1 else "shorter") in told
    assert "not scaled" in told
    assert model_on_person_trouble(other, walk, marker_set) or abs(size - 1) < 0.06


@pytest.mark.parametrize("factor", [1000.0, 0.001])
def test_another_unit_of_length(person, factor):
    places, walk, marker_set = person
    other = Markers(places.time, places.labels, factor * places.positions)
    assert "another unit of length" in model_on_person_trouble(other, walk, marker_set)


def test_left_and_right_exchanged_in_all_labels(person):
    """Distances are those of the mirror image, which differ by little."""
    places, walk, marker_set = person
    right = [label for label in places.labels if label[0] in "Rr"]
    pairs = {one: {"R": "L", "r": "L" if f"L{one[1:]}" in places.labels else "l"}[one[0]] + one[1:] for one in right}
    pairs = {one: other for one, other in pairs.items() if other in places.labels}
    exchanged = pairs | {other: one for one, other in pairs.items()}
    trouble = model_on_person_trouble(places, relabelled(walk, exchanged), marker_set)
    assert "pelvis, torso are arranged like a mirror image" in trouble
    assert "left and right labels" in trouble
    legs = marker_set.segments | {"torso": ()}
    assert model_on_person_trouble(places, walk, replace(marker_set, segments=legs)) == ""
    assert "mirror image" in model_on_person_trouble(
        places, relabelled(walk, exchanged), replace(marker_set, segments=legs)
    )


@pytest.mark.parametrize("seed", range(10))
def test_markers_in_one_plane_do_not_tell_left_from_right(person, seed):
    """Such as those of hips and shoulders alone: where they were put decides which of the two fits better."""
    places, walk, marker_set = person
    trunk = [label for name in ("pelvis", "torso") for label in marker_set.segments[name] if label in walk.labels][:5]
    flat = Markers(places.time, places.labels, places.positions * [0.1, 1.0, 1.0])
    elsewhere = np.random.default_rng(seed).normal(0.0, 0.015, (1, len(trunk), 3))
    seen = Markers(np.zeros(1), tuple(trunk), flat.select(trunk).positions + elsewhere)
    segments = {"pelvis": tuple(trunk[:3]), "torso": tuple(trunk[3:])}
    assert "mirror" not in model_on_person_trouble(flat, seen, replace(marker_set, segments=segments))


def test_heel_and_another_marker_of_the_foot_exchanged(person):
    places, walk, marker_set = person
    foot = [label for label in marker_set.segments["foot_r"] if label in walk.labels]
    at = places.positions[0]
    one, other = max(
        ((a, b) for a in foot for b in foot if a < b),
        key=lambda pair: np.linalg.norm(np.subtract(*[at[places.labels.index(label)] for label in pair])),
    )
    trouble = model_on_person_trouble(places, relabelled(walk, {one: other, other: one}), marker_set)
    if len(foot) > 2:
        assert "look swapped, here or in the model" in trouble
        assert one in trouble or other in trouble


def test_markers_that_were_never_placed(person):
    places, walk, marker_set = person
    away = np.random.default_rng(1).normal(0.0, 0.02, places.positions.shape)
    generic = Markers(places.time, places.labels, places.positions + away)
    told = [model_on_person_trouble(generic, walk, marker_set), *model_on_person_doubts(generic, walk, marker_set)]
    assert any("not moved to where" in one or "not placed" in one for one in told)


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
    (doubt,) = moved_doubts(before, after, [trial])
    assert "R.Heel (foot_r, 80 mm)" in doubt
    assert "Toe" not in doubt
    assert "Head" not in doubt
    assert moved_doubts(before, before, [trial]) == []
