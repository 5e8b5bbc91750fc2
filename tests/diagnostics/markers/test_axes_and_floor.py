"""Another unit, another axis up and a vertical that is tilted along the walk are found; in level laboratories never."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinertia.diagnostics.markers.axes_and_floor import floor_slope, unit_and_vertical
from kinertia.findings.finding import Severity
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import Markers, Recording
from kinertia.trial.marker_quality import extent_m
from marker_contexts import codes, context_of
from recordings import here, marker_set_for

LEVEL = here(
    [
        "synthetic/walk.trc",
        "synthetic/long.trc",
        "synthetic/walk.c3d",
        "rajagopal_walk/motion_capture_walk.trc",
        "pig_c3d/subject_a_walk.c3d",
        "pig_c3d/subject_b_walk.c3d",
    ]
)
WALKS = [
    *LEVEL,
    *here(["subject4/walking1.trc", "subject4/walking2.trc", "field/laiarnold6_walk/walking1.trc"]),
]
OTHERS = here(
    [
        "synthetic/squats.trc",
        "synthetic/run.trc",
        "gait2354/subject01_walk1.trc",
        "subject4/squats1.trc",
        "field/laiarnold5_jump/DJ1.trc",
        "field/rajagopal_run/motion_capture_run.trc",
        "field/hamner_run/subject02_running.trc",
    ]
)


def read(recording_of, name, turn=None):
    markers = recording_of(name).markers
    return context_of(markers if turn is None else markers.rotated(turn), marker_set_for(markers.labels))


@pytest.mark.parametrize("name", [*WALKS, *OTHERS])
def test_level_floors(name, recording_of):
    context = read(recording_of, name)
    assert [*floor_slope(context), *unit_and_vertical(context)] == []


@pytest.mark.parametrize("degrees", [1.5, -3.0])
@pytest.mark.parametrize("name", WALKS)
def test_tilted_cameras(name, degrees, recording_of):
    """The sign is that of walking uphill."""
    level = read(recording_of, name)
    along_x = level.axes.fore_aft == 0
    forward = np.cos(np.radians(level.travel.direction_deg)) if along_x else -np.sin(
        np.radians(level.travel.direction_deg)
    )  # fmt: skip
    sign = np.sign(forward) * (1.0 if along_x else -1.0)
    turn = Rotation.from_euler("z" if along_x else "x", sign * degrees, degrees=True).as_matrix()
    (finding,) = floor_slope(read(recording_of, name, turn))
    assert (finding.code, finding.where.axis) == ("M144", "fore-aft")
    assert np.degrees(finding.evidence["slope_rad"].value) == pytest.approx(degrees, abs=0.3)


@pytest.mark.parametrize("name", LEVEL)
def test_a_level_floor_that_is_rotated(name, recording_of):
    turn = Rotation.from_euler("y", 40, degrees=True).as_matrix()
    assert list(floor_slope(read(recording_of, name, turn))) == []


BODY_M = np.array([[0.1, 0.05, 0.1], [0.0, 0.9, -0.1], [0.0, 1.6, 0.0]])
"""Heel, pelvis and head."""


def walking(turn):
    share = np.linspace(0, 1, 100)[:, None, None]
    positions = (BODY_M + share * np.array([2.0, 0.0, 0.0])) @ np.transpose(turn)
    return Markers(np.arange(100) / 50.0, ("HEEL", "ASIS", "HEAD"), positions)


@pytest.mark.parametrize(
    ("turn", "vertical", "expected", "up"),
    [
        (np.eye(3), "+Y", [], None),
        (np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), "+Y", ["M142"], "Z"),
        (np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]), "+Y", ["M142"], "X"),
        (np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), "+Z", ["M142"], "-Y"),
        (1000 * np.eye(3), "+Y", ["M141"], None),
        (0.001 * np.eye(3), "+Y", ["M141"], None),
    ],
)
def test_axes_and_unit(turn, vertical, expected, up):
    """Axes are called as the file calls them."""
    found = list(unit_and_vertical(context_of(Recording("walk", walking(turn), None, vertical=vertical))))
    assert codes(found) == expected
    assert {finding.severity for finding in found} <= {Severity.ERROR}
    assert [finding.evidence["up"].value for finding in found if finding.code == "M142"] == ([up] if up else [])


def test_nobody():
    nothing = Markers(np.arange(3.0), ("A",), np.full((3, 1, 3), np.nan))
    assert list(unit_and_vertical(context_of(nothing))) == []


@pytest.mark.parametrize("name", WALKS[:1])
def test_a_few_labels_of_another_persons_model_are_no_other_unit(name, recording_of):
    """Of a model with other labels three matched, 200 mm apart: "the unit of length is wrong", said an ERROR."""
    markers = recording_of(name).markers
    pelvis = marker_set_for(markers.labels).segments["pelvis"]
    few = MarkerSet("few", {}, {"pelvis": pelvis}, {})
    assert extent_m(markers.select(pelvis)).max() < 0.3
    assert [*unit_and_vertical(context_of(markers, few))] == []
    small = replace(markers, positions=markers.positions / 10)
    assert codes(unit_and_vertical(context_of(small, few))) == ["M141"]
