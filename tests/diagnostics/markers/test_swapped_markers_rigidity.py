"""Markers that do not move with their segment are found, and with what they go; in fault-free trials none are."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.markers.swapped_markers import rigidity
from kinertia.findings.finding import Severity
from marker_contexts import changed, codes, context_of, relabelled
from recordings import here, marker_set_for

LOW_WANDS = "synthetic/walk.c3d with low wands"
"""On the thighs, 9 cm above the knee as those of subject B; in the file they are twice as far up."""
FAULT_FREE = here(
    [
        "synthetic/walk.trc",
        "synthetic/run.trc",
        "synthetic/squats.trc",
        "synthetic/walk.c3d",
        LOW_WANDS,
        "synthetic/clusters_walk.trc",
        "gait2354/subject01_walk1.trc",
        "rajagopal_walk/motion_capture_walk.trc",
        "pig_c3d/subject_a_walk.c3d",
        "pig_c3d/subject_b_walk.c3d",
        "subject4/walking1.trc",
        "subject4/squats1.trc",
        "field/rajagopal_run/motion_capture_run.trc",
        "field/hamner_run/subject02_running.trc",
        "c3d_variety/subject_prefixed_labels.c3d",
    ]
)
CLUSTERS = here(["synthetic/clusters_walk.trc", "rajagopal_walk/motion_capture_walk.trc"])
SOFT_M = {"synthetic/clusters_walk.trc": 0.11, "rajagopal_walk/motion_capture_walk.trc": 0.09}
"""How far skin takes a thigh's marker along."""
WANDS = here(["synthetic/walk.c3d", "pig_c3d/subject_a_walk.c3d"])
EXCHANGED = [
    *[(name, [(f"R.SH{k}", f"L.SH{k}") for k in (1, 2, 3, 4)], "shank") for name in CLUSTERS],
    *[(name, [(f"R.TH{k}", f"R.SH{k}") for k in (1, 2, 3)], "right shank") for name in CLUSTERS],
    *[(name, [("R.Heel", "L.Heel"), ("R.Toe", "L.Toe"), ("R.MT5", "L.MT5")], "ankle") for name in CLUSTERS],
    *[(name, [("RTIB", "LTIB")], "shank") for name in WANDS],
    *[(name, [("RTHI", "LTHI")], "thigh") for name in [LOW_WANDS, *here(["pig_c3d/subject_b_walk.c3d"])]],
]
"""With what moves by itself then."""
CROSSED = [
    *[(name, "foot") for name in here(["synthetic/walk.trc", "gait2354/subject01_walk1.trc"])],
    *[
        (name, segment)
        for segment in ("thigh", "shank")
        for name in here(
            [
                "synthetic/walk.trc",
                "synthetic/run.trc",
                "gait2354/subject01_walk1.trc",
                "field/rajagopal_run/motion_capture_run.trc",
            ]
        )
    ],
]
"""Walks whose sets have no markers at the joints."""


def read(recording_of, name):
    markers = recording_of(name.removesuffix(" with low wands")).markers
    if name == LOW_WANDS:
        markers = with_low_wands(markers)
    marker_set = marker_set_for(markers.labels)
    return markers.select([label for label in marker_set.labels if label in markers.labels]), marker_set


def with_low_wands(markers):
    places = markers.positions.copy()
    for side in "RL":
        wand, knee = (markers.labels.index(f"{side}{label}") for label in ("THI", "KNE"))
        places[:, wand] = places[:, [wand, knee]].mean(axis=1)
    return replace(markers, positions=places)


def found(markers, marker_set):
    return list(rigidity(context_of(markers, marker_set)))


@pytest.mark.parametrize("name", FAULT_FREE)
def test_fault_free_trials(name, recording_of):
    assert found(*read(recording_of, name)) == []


@pytest.mark.parametrize(("name", "pairs", "where"), EXCHANGED)
def test_swapped_labels(name, pairs, where, recording_of):
    markers, marker_set = read(recording_of, name)
    torn = [finding for finding in found(relabelled(markers, *pairs), marker_set) if finding.code == "L213"]
    assert torn
    swapped = {label for pair in pairs for label in pair}
    assert all(swapped & set(finding.where.markers) for finding in torn)
    assert any(where in finding.evidence["segment"].value for finding in torn)
    assert {finding.severity for finding in torn} == {Severity.ERROR}


@pytest.mark.parametrize("sd_m", [0.004, 0.01, 0.02])
@pytest.mark.parametrize("name", ["synthetic/walk.trc", "synthetic/walk.c3d", "synthetic/clusters_walk.trc"])
def test_noise_tears_no_segment(name, sd_m, recording_of):
    markers, marker_set = read(recording_of, name)
    noise = np.random.default_rng(105).normal(0.0, sd_m, markers.positions.shape)
    assert found(replace(markers, positions=markers.positions + noise), marker_set) == []


@pytest.mark.parametrize("fault", ["jump", "rounded", "noise"])
@pytest.mark.parametrize("name", ["synthetic/walk.c3d"])
def test_a_warning_about_one_marker_hides_no_error_about_others(name, fault, recording_of):
    """Nor does one about all (D2)."""
    markers, marker_set = read(recording_of, name)

    def spoil(places, time):
        if fault == "jump":
            places[len(time) // 2 :, markers.labels.index("LTHI"), 1] += 0.06
        elif fault == "rounded":
            places[:] = np.round(places / 0.005) * 0.005
        else:
            places += np.random.default_rng(106).normal(0.0, 0.004, places.shape)

    spoilt = changed(markers, spoil)
    assert found(spoilt, marker_set) == []
    torn = found(relabelled(spoilt, ("RTIB", "LTIB")), marker_set)
    assert "L213" in codes(torn)
    assert {"RTIB", "LTIB"} <= {label for finding in torn for label in finding.where.markers}


def with_soft_thigh(recording_of, name):
    """A walk with a thigh marker that skin takes along with the hip's angle, so that the distance to the knee's changes
    by more than 60 mm.
    """
    markers, marker_set = read(recording_of, name)
    places = markers.positions.copy()
    thigh, knee, ankle = (markers.labels.index(name) for name in ("R.TH1", "R.Knee", "R.Ankle"))
    along = places[:, knee] - places[:, ankle]
    swing = along[:, 0] / np.linalg.norm(along, axis=1)
    places[:, thigh, 0] += SOFT_M[name] * (swing - swing.mean()) / np.ptp(swing)
    return replace(markers, positions=places), marker_set


@pytest.mark.parametrize("name", CLUSTERS)
def test_soft_thighs_are_no_exchanged_labels(name, recording_of):
    markers, marker_set = with_soft_thigh(recording_of, name)
    place = markers.positions
    apart = [
        np.linalg.norm(place[:, markers.labels.index("R.TH1")] - place[:, markers.labels.index(k)], axis=1)
        for k in ("R.Knee", "R.TH2", "R.TH3")
    ]
    assert max(np.ptp(np.nanquantile(distances, [0.1, 0.9])) for distances in apart) > 0.06
    assert found(markers, marker_set) == []


@pytest.mark.parametrize("name", WANDS)
def test_what_a_marker_goes_with_instead(name, recording_of):
    markers, marker_set = read(recording_of, name)
    torn = found(relabelled(markers, ("RTIB", "LTIB")), marker_set)
    better = {
        finding.where.markers[0]: finding.evidence["better_segment"].value for finding in torn if finding.code == "L213"
    }
    assert better["RTIB"] in ("left thigh", "left shank")
    assert better["LTIB"] in ("right thigh", "right shank")


@pytest.mark.parametrize(("name", "segment"), CROSSED)
def test_whole_segments_of_the_other_leg(name, segment, recording_of):
    markers, marker_set = read(recording_of, name)
    right, left = (sorted(marker_set.segments[f"{segment}_{side}"]) for side in "rl")
    crossed = [
        finding
        for finding in found(relabelled(markers, *zip(right, left, strict=True)), marker_set)
        if finding.code == "L214"
    ]
    assert [finding.evidence["segments"].value for finding in crossed] == [{"foot": "feet"}.get(segment, f"{segment}s")]
    assert {*right, *left} & set(markers.labels) <= set(crossed[0].where.markers)
    assert crossed[0].evidence["crossed_change_m"].value < 0.7 * crossed[0].evidence["own_change_m"].value
