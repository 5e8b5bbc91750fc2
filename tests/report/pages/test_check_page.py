"""Pictures of a recording show what `check` found in it."""

from dataclasses import replace

import numpy as np
import plotly.graph_objects as go
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinertia.findings.overview import Overview
from kinertia.io.recording import read_recording
from kinertia.report.figures.marker_figures import marker_scene
from kinertia.report.figures.plots import as_plotly
from kinertia.report.pages.check_page import extremes_kept, force_figure, pressure_figure, render_check
from kinertia.workflow.check import check_recording
from report_page import figures_of, numbers


@pytest.fixture(scope="module")
def walked(c3d_lab):
    recording = read_recording(c3d_lab / "walk.c3d")
    return check_recording(recording, mass_kg=72.6)


def page_of(recording):
    """The page of one recording and what was found in it."""
    check = check_recording(recording)
    return render_check([Overview(check.findings, 61, 1)], [check])


def test_ground_is_blue_or_red_in_contacts_and_grey_where_no_fit_can_use_the_frames(walked):
    figure = force_figure(walked)
    panels = {"y": 0, "y2": 1}
    drawn = [[], []]
    for shape in figure.layout["shapes"]:
        drawn[panels[shape["yref"].removesuffix(" domain")]].append(shape)
    for shapes, plate in zip(drawn, walked.plates, strict=True):
        contacts = [(rectangle["x0"], rectangle["x1"]) for rectangle in shapes if rectangle["opacity"] < 1]
        assert contacts == [(contact.start_s, contact.end_s) for contact in plate.contacts]
        grey = sorted((rectangle["x0"], rectangle["x1"]) for rectangle in shapes if rectangle["opacity"] == 1)
        (window,) = walked.windows
        assert [grey[0][1], grey[1][0]] == list(window)
        assert (grey[0][0], grey[1][1]) == (
            walked.recording.plates.time[0],
            walked.recording.plates.time[-1],
        )
    blue, red = (drawn[k][-1]["fillcolor"] for k in (0, 1))
    assert (blue, red) == ("#0072B2", "#D55E00"), "the right foot is on the first plate, the left on the second"


def test_forces_keep_their_peaks(walked):
    upward = [trace for trace in force_figure(walked).data if trace["name"] == "upward"]
    for trace, plate in zip(upward, walked.plates, strict=True):
        assert float(np.max(trace["y"])) == pytest.approx(plate.peak_n, rel=1e-6)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=400), st.integers(2, 60))
def test_thinned_curves_keep_their_extremes(values, most):
    values = np.array(values)
    kept = extremes_kept(values, most)
    assert len(kept) <= max(most, 2)
    assert (np.diff(kept) > 0).all()
    assert values[kept].max() == values.max()
    assert values[kept].min() == values.min()


def test_centres_of_pressure_lie_between_the_markers_of_the_foot_above_them(walked):
    figure = as_plotly(pressure_figure(walked))
    for side in ("right", "left"):
        (path,) = [trace for trace in figure.data if trace.name == f"centre of pressure, {side}"]
        (foot,) = [trace for trace in figure.data if trace.name == f"markers of the {side} foot"]
        assert set(foot.text) == {f"{side[0].upper()}HEE", f"{side[0].upper()}TOE"}
        assert min(foot.x) - 0.03 < np.median(path.x) < max(foot.x) + 0.03
        middle = 0.5 * (min(foot.y) + max(foot.y))
        assert np.median(path.y) == pytest.approx(middle, abs=0.05)
    plates = [trace for trace in figure.data if trace.name == "plate"]
    assert len(plates) == 2
    corners = walked.recording.plates.corners
    np.testing.assert_allclose(plates[0].x[:4], corners[0, :, 0], atol=1e-6)
    np.testing.assert_allclose(plates[0].y[:4], corners[0, :, 2], atol=1e-6)
    assert figure.layout.yaxis.range[0] > figure.layout.yaxis.range[1], "from above, Z is to the right of X"


def test_a_centre_of_pressure_on_a_raised_plate_is_on_the_plate(walked):
    """A force through a point of a plate 0.2 m above the ground acts there, whatever its shear."""
    plates = walked.recording.plates
    at = np.array([0.3, 0.2, -0.1])
    force = np.zeros_like(plates.force)
    force[:, 0] = np.where(plates.force[:, 0, 1:2] > 0, [80.0, 600.0, -50.0], 0.0)
    raised = replace(
        plates, force=force, moment=np.cross(at, force), corners=plates.corners + np.array([0.0, 0.2, 0.0])
    )
    check = check_recording(replace(walked.recording, plates=raised))
    paths = [trace for trace in pressure_figure(check).data if trace["name"].startswith("centre of pressure")]
    assert paths
    for path in paths:
        np.testing.assert_allclose(path["x"], at[0], atol=1e-6)
        np.testing.assert_allclose(path["y"], at[2], atol=1e-6)


def test_page_draws_gaps_and_what_plotly_knows(walked):
    markers = walked.recording.markers
    positions = markers.positions.copy()
    positions[40:60, markers.labels.index("LKNE")] = np.nan
    gappy = replace(walked.recording, markers=replace(markers, positions=positions))
    figures = figures_of(page_of(gappy))
    assert set(figures) == {f"recording1-{kind}" for kind in ("forces", "pressure", "gaps")}
    for figure in figures.values():
        go.Figure(figure["data"], figure["layout"])
    (bars,) = figures["recording1-gaps"]["data"]
    assert bars["y"] == ["LKNE", "LKNE", None]
    assert numbers(bars["x"])[:2] == pytest.approx([markers.time[40] - 0.005, markers.time[59] + 0.005])


def test_a_recording_without_forces_or_marker_set_still_has_a_page(walked):
    recording = replace(walked.recording, plates=None)
    assert figures_of(page_of(recording)) == {}
    renamed = replace(recording.markers, labels=tuple(f"M{k}" for k in range(len(recording.markers.labels))))
    assert 'href="#explain-L101"' in page_of(replace(recording, markers=renamed))
    single = replace(recording, markers=recording.markers.cut(2.0, 2.0))
    assert "<canvas" in page_of(single)


def test_markers_are_joined_to_the_middle_of_their_segment(walked):
    recording, marker_set = walked.recording, walked.used_set
    shown = marker_scene(recording, marker_set, 50)
    assert len(shown.time) <= 50
    assert set(shown.labels) <= set(marker_set.labels)
    thigh = [shown.labels.index(name) for name in marker_set.segments["thigh_r"]]
    (middle,) = {end for start, end in shown.bones.tolist() if start in thigh}
    np.testing.assert_allclose(shown.points[:, middle], shown.measured[:, thigh].mean(axis=1))
    blue = [k for k, (start, _) in enumerate(shown.bones) if start in thigh]
    assert {shown.sides[k] for k in blue} == {"r"}


def test_the_camera_goes_on_where_the_pelvis_is_not_seen(walked):
    markers = walked.recording.markers
    positions = markers.positions.copy()
    pelvis = [markers.labels.index(name) for name in walked.used_set.segments["pelvis"]]
    positions[100:120, pelvis] = np.nan
    gappy = replace(walked.recording, markers=replace(markers, positions=positions))
    shown = marker_scene(gappy, walked.used_set, 10_000)
    assert np.isfinite(shown.centre).all()
    whole = marker_scene(walked.recording, walked.used_set, 10_000)
    np.testing.assert_allclose(shown.centre, whole.centre, atol=0.02)
    np.testing.assert_array_equal(shown.centre[:100], whole.centre[:100])


def test_legends_of_the_check_have_at_most_four_entries(walked):
    for figure in (force_figure(walked), pressure_figure(walked)):
        assert 1 <= len({trace["name"] for trace in figure.data if trace.get("showlegend", True)}) <= 4
