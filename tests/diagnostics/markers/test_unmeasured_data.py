"""Joint centres that programs computed from other markers are found; markers on skin never are."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinertia.diagnostics.markers.unmeasured_data import computed_markers
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.trial.data import Markers
from marker_contexts import codes, context_of
from recordings import WALKS, here, marker_set_for

ELBOWS = {
    "synthetic/clusters_walk.trc": ("R.Elbow", "R.MElbow"),
    "subject4/walking1.trc": ("R_elbow_lat", "R_elbow_med"),
}
"""Walks with markers on both sides of the elbow, and these."""


def computed(markers, marker_set):
    return list(computed_markers(context_of(markers, marker_set)))


def with_point(markers, marker_set, segment, place, label="centre"):
    """The recording with one more point, listed on this segment."""
    more = Markers(markers.time, (*markers.labels, label), np.concatenate([markers.positions, place[:, None]], axis=1))
    segments = {**marker_set.segments, segment: (*marker_set.segments[segment], label)}
    return more, replace(marker_set, segments=segments)


@pytest.fixture(params=WALKS)
def walk(request, recording_of):
    markers = recording_of(*WALKS[request.param]).markers
    return markers, choose_marker_set(markers.labels)


def test_measured_markers_are_not_computed(walk):
    assert computed(*walk) == []


@pytest.mark.parametrize("name", here(ELBOWS))
def test_a_point_between_two_markers_of_a_joint(recording_of, name):
    markers, elbow = recording_of(name).markers, ELBOWS[name]
    marker_set = marker_set_for(markers.labels)
    middle = markers.select(elbow).positions.mean(axis=1)
    (finding,) = computed(*with_point(markers, marker_set, "upper_arm_r", middle))
    assert (finding.code, finding.where.markers, finding.evidence["sources"].value) == (
        "M151",
        ("centre",),
        ", ".join(elbow),
    )
    noisy = middle + np.random.default_rng(100).normal(0.0, 5e-4, middle.shape)
    assert computed(*with_point(markers, marker_set, "upper_arm_r", noisy)) == []


@pytest.mark.parametrize("name", here(["synthetic/walk.c3d", "pig_c3d/subject_a_walk.c3d"]))
def test_a_point_in_axes_through_three_pelvis_markers(recording_of, name):
    markers = recording_of(name).markers
    marker_set = choose_marker_set(markers.labels)
    right, left, back_r, back_l = np.moveaxis(markers.select(["RASI", "LASI", "RPSI", "LPSI"]).positions, 1, 0)
    origin, z = (right + left) / 2, right - left
    z /= np.linalg.norm(z, axis=1, keepdims=True)
    y = np.cross(z, origin - (back_r + back_l) / 2)
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    hip = origin - 0.05 * np.cross(y, z) - 0.08 * y + 0.09 * z
    (finding,) = computed(*with_point(markers, marker_set, "thigh_r", hip))
    assert (finding.code, finding.where.markers) == ("M151", ("centre",))
    assert finding.evidence["sources"].value.startswith("RASI, LASI, ")
    on_skin = hip + np.random.default_rng(100).normal(0.0, 5e-4, hip.shape)
    assert computed(*with_point(markers, marker_set, "thigh_r", on_skin)) == []


HIPS_M = ((0.05, -0.08, 0.09), (0.05, -0.08, -0.09))
"""In front of the middle of the pelvis markers, below it, and to the right or left."""


@pytest.mark.parametrize("noise_m", [0.0, 5e-4])
def test_hip_centres_by_a_rigid_fit_of_the_pelvis(noise_m, recording_of):
    """As the laboratory of the next test computed them: places in a standing pelvis, fitted to all its markers."""
    markers = recording_of("synthetic/clusters_walk.trc").markers
    marker_set = choose_marker_set(markers.labels)
    pelvis = markers.select(marker_set.segments["pelvis"]).positions
    standing = recording_of("synthetic/clusters_static.trc").markers
    shape = standing.select(marker_set.segments["pelvis"]).positions.mean(axis=0)
    turns = [Rotation.align_vectors(points - points.mean(axis=0), shape - shape.mean(axis=0))[0] for points in pelvis]
    for k, hip in enumerate(HIPS_M):
        place = pelvis.mean(axis=1) + np.array([turn.apply(hip) for turn in turns])
        place += np.random.default_rng(100 + k).normal(0.0, noise_m, place.shape)
        markers, marker_set = with_point(markers, marker_set, "thigh_r", place, f"hip {k}")
    found = [finding.where.markers for finding in computed(markers, marker_set)]
    assert found == ([("hip 0",), ("hip 1",)] if noise_m == 0.0 else [])


@pytest.mark.parametrize("trial", ["walking1", "squats1"])
@pytest.mark.measured
def test_hip_centres_that_another_laboratory_computed(trial, recording_of):
    """By a rigid fit of all pelvis markers; regressions of the same study go with knees and hips, and are not seen."""
    markers = recording_of(f"subject4/{trial}.trc").markers
    marker_set = marker_set_for(markers.labels)
    assert computed(markers, marker_set) == []
    thigh = (*marker_set.segments["thigh_r"], "R_HJC", "L_HJC")
    found = computed(markers, replace(marker_set, segments={**marker_set.segments, "thigh_r": thigh}))
    assert codes(found) == ["M151", "M151"]
    assert [finding.where.markers for finding in found] == [("L_HJC",), ("R_HJC",)]


def test_too_short_or_too_few_markers_say_nothing(walk):
    markers, marker_set = walk
    assert computed(replace(markers, time=markers.time[:5], positions=markers.positions[:5]), marker_set) == []
    pelvis = marker_set.segments["pelvis"][:2]
    few = replace(marker_set, segments={**marker_set.segments, "pelvis": pelvis})
    assert computed(markers, few) == []
