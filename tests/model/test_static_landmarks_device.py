"""Knee markers of a knee alignment device."""

import numpy as np
import pytest

from kinertia.io.c3d.reader import read_c3d
from kinertia.io.marker_set_file import read_marker_set
from kinertia.model.static_landmarks import device_labels, with_alignment_device, with_knees_of_device
from kinertia.trial.data import Markers, Recording
from recordings import here
from refusals import codes

STALK_M = 0.095
KNEES = {"R": np.array([0.0, 0.5, 0.15]), "L": np.array([0.0, 0.5, -0.15])}
PLUG_IN = read_marker_set("plug-in-gait-lower-body")
STATICS = here(["field/fmc/MH0222_BP01_static.c3d", "field/mh/MH_Cal 01.c3d", "field/sydney/S4 AM Cal 01.c3d"])


def with_devices(order=("kax", "kd1", "kd2"), stretch=1.0):
    """A recording of pelvis, ankles and devices: stalks to the outer side, and up and down in front of the knee."""
    places = {"LASI": (0.1, 0.95, -0.12), "RASI": (0.1, 0.95, 0.12), "LANK": (-0.05, 0.08, -0.12),
              "RANK": (-0.05, 0.08, 0.12)}  # fmt: skip
    half = np.sqrt(0.5)
    for side, knee in KNEES.items():
        out = 1.0 if side == "R" else -1.0
        stalks = ((0.0, 0.0, out * stretch), (half, half, 0.0), (half, -half, 0.0))
        for name, stalk in zip(order, stalks, strict=True):
            places[(side + name).upper()] = knee + STALK_M * np.array(stalk)
    positions = np.tile(np.array(list(places.values())), (5, 1, 1))
    return Recording("static", Markers(np.arange(5) / 100, tuple(places), positions))


@pytest.mark.parametrize("order", [("kax", "kd1", "kd2"), ("kax", "kd2", "kd1")])
def test_the_corner_of_the_stalks_is_the_knee_marker(order):
    found = with_knees_of_device(with_devices(order), "static.c3d")
    assert codes(found.findings) == ["F166"]
    for side, knee in KNEES.items():
        assert np.allclose(found.markers.select([f"{side}KNE"]).positions, knee, atol=1e-9)


def test_markers_at_unequal_distances_are_no_device():
    assert with_knees_of_device(with_devices(stretch=1.6), "static.c3d").markers.labels == with_devices().markers.labels


def test_a_knee_marker_of_the_file_stays():
    with_knee = with_knees_of_device(with_devices(), "static.c3d")
    assert with_knees_of_device(with_knee, "static.c3d") is with_knee


def test_labels_of_a_device_have_any_prefix_and_case():
    assert device_labels(["Anna:rkax", "RKD1", "LKNE", "KAX"]) == ("Anna:rkax", "RKD1")


def test_the_device_gives_the_axis_of_the_knee_and_brings_malleoli():
    found = with_alignment_device(PLUG_IN, [*PLUG_IN.labels, "LKAX", "LKD1", "LKD2", "LMED", "RMED"])
    assert found.landmarks["thigh_wand_l"] == ("LKAX",)
    assert found.landmarks["ankle_medial_l"] == ("LMED",)
    assert found.landmarks["thigh_wand_r"] == PLUG_IN.landmarks["thigh_wand_r"]
    assert "ankle_medial_r" not in found.landmarks
    assert found.segments == PLUG_IN.segments


@pytest.mark.parametrize("name", STATICS)
def test_vicon_puts_the_knee_marker_into_the_corner(file_of, name):
    recording = read_c3d(file_of(name))
    modelled = recording.markers.select(["LKNE", "RKNE"])
    assert "F166" in codes(recording.findings)
    others = [label for label in recording.markers.labels if label not in modelled.labels]
    placed = with_knees_of_device(Recording("static", recording.markers.select(others)), name).markers
    off = np.linalg.norm(placed.select(["LKNE", "RKNE"]).positions - modelled.positions, axis=2)
    assert np.nanmax(off) < 0.002
