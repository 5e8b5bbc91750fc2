"""The report's figures show the numbers of the fit, and gait events are where the loads say."""

import itertools
import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import plotly.graph_objects as go
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinertia.model.skeleton import by_side
from kinertia.report.figures.body_figure import body_figure
from kinertia.report.figures.bsp_figures import change_figure, departure_figure, information_figure
from kinertia.report.figures.coordinate_titles import panels_of, title_of
from kinertia.report.figures.figure import BLUE, SIDES, Figure, Panel, between, compact, faded, small_multiples
from kinertia.report.figures.marker_figures import fit_gap_figure, marker_figure
from kinertia.report.figures.plots import as_plotly
from kinertia.report.figures.time_figures import (
    BAND_EVERY,
    coordinate_figure,
    joint_moment_figure,
    moment_figure,
    residual_figure,
    stage_name,
)
from kinertia.report.pages.page import render
from kinertia.report.wording import LITERATURE
from kinertia.trial.data import FootLoads, Markers, Trial
from kinertia.trial.sampled_data import rms_by_marker
from kinertia.trial.stances import gait_events
from report_page import TRACE_TYPES, figures_of, numbers


@pytest.mark.parametrize("which", ["fit", "two_level"])
def test_plotly_accepts_every_name_and_value_of_every_figure(which, request):
    """Reports are written without plotly's checks; here is where they are made, on what the page carries."""
    figures = figures_of(render(request.getfixturevalue(which)))
    assert len(figures) >= 5
    for figure in figures.values():
        checked = go.Figure(figure["data"], figure["layout"])
        assert len(checked.data) == len(figure["data"])
        assert {trace.type for trace in checked.data} <= set(TRACE_TYPES)
    with pytest.raises(ValueError, match="lien"):
        go.Figure([{**figure["data"][0], "lien": {"width": 2}}])


def test_names_of_bodies_are_shown_as_they_are(fit):
    """plotly would take `<b>` for bold, and `<a href>` for a link."""
    name = '<b>=cmd|</b><a href="http://x.y">'
    named = tuple(name if segment == "pelvis" else segment for segment in fit.estimate.segments)
    bodies = {kind: replace(getattr(fit, kind), segments=named) for kind in ("literature", "estimate")}
    joints = [
        replace(joint, **{end: name for end in ("parent", "child") if getattr(joint, end) == "pelvis"})
        for joint in fit.skeleton.joints
    ]
    worn = [replace(marker, segment=name) if marker.segment == "pelvis" else marker for marker in fit.skeleton.markers]
    evil = replace(fit, **bodies, skeleton=replace(fit.skeleton, joints=tuple(joints), markers=tuple(worn)))
    figures = [change_figure(evil), departure_figure(evil), information_figure(evil), body_figure(evil)]
    for figure in figures:
        text = Figure(figure.data, {**figure.layout, "meta": {}}).to_json()  # plotly shows nothing of meta
        assert "&lt;b&gt;" in text
        assert "<b>=cmd" not in text
        assert "<a href" not in text


def test_a_figure_is_written_with_its_gaps_and_nothing_else_that_json_does_not_know():
    values = compact(np.array([1.5, np.nan, -0.25]))
    (trace,) = json.loads(Figure([{"y": values, "name": "a"}], {}).to_json())["data"]
    np.testing.assert_array_equal(numbers(trace["y"]), [1.5, np.nan, -0.25])
    np.testing.assert_array_equal(go.Scatter(y=values).to_plotly_json()["y"], values)
    with pytest.raises(ValueError):
        Figure([{"x0": np.nan}], {}).to_json()
    with pytest.raises(TypeError, match="float32"):
        Figure([{"y": np.zeros(3)}], {}).to_json()


def test_coordinates_are_drawn_in_degrees_by_side(fit):
    trial, figure = fit.trials[0], figures_of(render(fit))["trial1-coordinates"]
    titles = [note["text"] for note in figure["layout"]["annotations"]]
    knee = titles.index("<b>Knee flexion + (degrees)</b>")
    panel = [trace for trace in figure["data"] if trace["xaxis"] == f"x{knee + 1}"]
    drawn = {trace["name"]: numbers(trace["y"]) for trace in panel}
    for side, word in (("r", "right"), ("l", "left")):
        column = fit.skeleton.coordinates.index(f"knee_angle_{side}")
        width = drawn[f"{word} 95 % band"] - drawn[f"{word} 95 % band, lower edge"]
        sd = trial.coordinate_sd[f"knee_angle_{side}"][::BAND_EVERY]
        np.testing.assert_allclose(width, 2 * 1.96 * np.degrees(sd), rtol=1e-3)
        np.testing.assert_allclose(drawn[f"{word}, estimate"], np.degrees(trial.motion.q[:, column]), atol=1e-4)
        ik = np.degrees(trial.kinematics.ik.q[:, column])
        measured = drawn[f"{word}, inverse kinematics"]
        assert len(measured) >= len(trial.time)
        assert np.isin(measured.astype(np.float32), ik.astype(np.float32)).all()
    assert len(titles) == 18
    assert sum("(m)" in title for title in titles) == 3


def test_curves_are_thinned_but_not_moved(fit):
    trial = fit.trials[0]
    figure = as_plotly(residual_figure(trial, most_frames=20))
    name = stage_name("estimate", LITERATURE, trial.motion_hz)
    trace = next(t for t in figure.data if t.name == name and t.yaxis == "y")
    assert len(trace.y) <= 20
    step = -(-len(trial.time) // 20)
    np.testing.assert_allclose(trace.x0 + trace.dx * np.arange(len(trace.y)), trial.time[::step], atol=1e-6)
    np.testing.assert_allclose(trace.y, trial.residuals["estimate"][::step, 0], rtol=1e-6)


def test_curves_break_between_intervals(fit):
    (trial,) = fit.trials
    first, last = trial.time[[0, -1]]
    windows = ((first, trial.time[40]), (trial.time[61], last))
    kept = np.r_[0:41, 61 : len(trial.time)]
    parted = replace(
        trial,
        kinematics=replace(trial.kinematics, windows_s=windows),
        residuals={stage: values[kept] for stage, values in trial.residuals.items()},
        full_residuals={stage: values[kept] for stage, values in trial.full_residuals.items()},
    )
    figure = as_plotly(residual_figure(parted))
    for trace in figure.data:
        x, y = np.asarray(trace.x, float), np.asarray(trace.y, float)
        (gap,) = np.flatnonzero(np.isnan(y))
        np.testing.assert_allclose(np.delete(x, gap), trial.time[kept], atol=1e-6)
        assert gap == 41
    shaded = {(shape.x0, shape.x1) for shape in figure.layout.shapes if shape.type == "rect"}
    assert (trial.time[40], trial.time[61]) in shaded


def test_residuals_are_drawn_at_both_bandwidths(fit):
    trial = fit.trials[0]
    drawn = {t.name: t.y for t in as_plotly(residual_figure(trial)).data if t.yaxis == "y"}
    before, after = (f"({hz:.3g} Hz)" for hz in (trial.kinematics.cutoff_hz, trial.motion_hz))
    assert list(drawn) == [
        "estimate, forces at full bandwidth",
        f"literature values {before}",
        f"literature values, pelvis corrected {before}",
        f"estimate {after}",
    ]
    full = drawn["estimate, forces at full bandwidth"]
    np.testing.assert_allclose(full, trial.full_residuals["estimate"][: len(full), 0], rtol=1e-5, atol=1e-5)


def test_moments_are_per_body_mass_and_have_bands_where_there_are_deviations(fit):
    trial = fit.trials[0]
    mass = fit.literature.total_mass_kg
    assert trial.moment_sd is not None
    curves, hip = trial.joint_curves, fit.skeleton.coordinates.index("hip_flexion_r")
    without = replace(trial, deviations=None, joint_curves=replace(curves, deviations=None))
    plain = as_plotly(moment_figure(without, fit.skeleton, mass))
    trace = next(t for t in plain.data if t.name == "right, estimate")
    np.testing.assert_allclose(trace.y, curves.forces["estimate"][:, hip] / mass, rtol=1e-5)
    assert not any("band" in (t.name or "") for t in plain.data)
    banded = as_plotly(moment_figure(trial, fit.skeleton, mass))
    upper = next(k for k, t in enumerate(banded.data) if t.name == "right 95 % band")
    width = banded.data[upper].y - banded.data[upper - 1].y
    assert banded.data[upper].xaxis == banded.data[upper - 1].xaxis
    sd = curves.deviations.moments[::BAND_EVERY, hip]
    np.testing.assert_allclose(width, 2 * 1.96 * sd / mass, rtol=1e-3)


def test_without_joint_curves_moments_are_those_of_the_measured_windows(fit):
    trial, mass = fit.trials[0], fit.literature.total_mass_kg
    without = replace(trial, joint_curves=None)
    drawn = as_plotly(moment_figure(without, fit.skeleton, mass))
    trace = next(t for t in drawn.data if t.name == "right, estimate")
    np.testing.assert_allclose(trace.y, trial.moments["estimate"]["hip_flexion_r"] / mass, rtol=1e-5)
    assert joint_moment_figure(without, mass, "isb") is None


def test_joint_moments_over_time_are_shaded_where_a_side_is_not_known(fit):
    trial, mass = fit.trials[0], fit.literature.total_mass_kg
    curves = trial.joint_curves
    figure = as_plotly(joint_moment_figure(trial, mass, "isb"))
    titles = [annotation.text for annotation in figure.layout.annotations]
    panel = next(k for k, title in enumerate(titles) if "Knee adduction" in title)
    axis = f"x{panel + 1}" if panel else "x"
    row = curves.joints["estimate"].joints.index("knee_r")
    values = curves.joints["estimate"].moments[:, row, 1]
    line = next(t for t in figure.data if t.name == "right, estimate" and (t.xaxis or "x") == axis)
    np.testing.assert_allclose(line.y, values / mass, rtol=1e-5)
    faint = faded(SIDES["r"][1], 0.1)
    spans = [(s.x0, s.x1) for s in figure.layout.shapes if s.xref == axis and s.fillcolor == faint]
    inside = np.array([any(a < t < b for a, b in spans) for t in curves.time])
    assert (inside & ~np.isfinite(values)).any()
    assert not (inside & np.isfinite(values)).any()


def test_frames_outside_the_window_are_shaded(fit):
    kinematics = fit.trials[0].kinematics
    start, end = kinematics.window_s
    figure = as_plotly(residual_figure(fit.trials[0]))
    spans = {(round(s.x0, 3), round(s.x1, 3)) for s in figure.layout.shapes if s.type == "rect"}
    assert all(last <= start + 1e-3 or first >= end - 1e-3 for first, last in spans)
    assert any(abs(last - start) < 1e-3 for _, last in spans)
    assert any(abs(first - end) < 1e-3 for first, _ in spans)


def estimates(figure):
    """Dots and halves of their bars by panel ("x", "x2", ...) and row."""
    return {
        (trace.xaxis, int(row)): (x, half)
        for trace in figure.data
        if (trace.name or "").startswith("estimate")
        for x, row, half in zip(trace.x, trace.y, trace.error_x.array, strict=True)
    }


def test_intervals_are_those_of_the_posterior(fit):
    figure = as_plotly(departure_figure(fit, range(10)))
    away, posterior = fit.departures, fit.posterior
    intervals = estimates(figure)
    assert len(intervals) == away.size
    np.testing.assert_allclose(
        intervals["x", 3], (away[3, 0], 1.96 * posterior.sd[3, 0] / posterior.prior_sd[3, 0]), rtol=1e-5
    )
    lowest, highest = figure.layout.xaxis.range
    assert all(lowest < x - half and x + half < highest for x, half in intervals.values())


def test_changes_are_in_kg_mm_and_kg_m2(fit, two_level):
    figure = as_plotly(change_figure(fit))
    assert [note.text for note in figure.layout.annotations][:5] == [
        "<b>mass (kg)</b>",
        *(f"<b>CoM {way} (mm)</b>" for way in ("forward", "upward", "to the right")),
        "<b>Ixx (kg m2)</b>",
    ]
    change, sd, shown = fit.estimate.table() - fit.literature.table(), fit.posterior.sd, estimates(figure)
    assert len(shown) == 12 * 7
    for place, k, factor in (("x", 0, 1.0), ("x3", 2, 1e3), ("x7", 6, 1.0)):
        for row in range(12):
            expected = np.array([change[row, k], 1.96 * sd[row, k]]) * factor
            np.testing.assert_allclose(shown[place, row], expected, rtol=1e-5)
    prior = next(trace for trace in figure.data if trace.xaxis == "x2" and trace.name == "literature, 95 %")
    np.testing.assert_allclose(prior.error_x.array, 1960 * fit.posterior.prior_sd[:, 1], rtol=1e-5)
    plain = as_plotly(change_figure(two_level))
    assert len(plain.data) == 7
    change = two_level.estimate.table() - two_level.literature.table()
    np.testing.assert_allclose(plain.data[1].x, 1e3 * change[:, 1], rtol=1e-5, atol=1e-9)


def test_a_parameter_that_was_held_has_no_dot(fit):
    posterior = fit.posterior
    prior_sd, sd = posterior.prior_sd.copy(), posterior.sd.copy()
    prior_sd[2, 1] = sd[2, 1] = 0.0
    held = replace(fit, posterior=replace(posterior, prior_sd=prior_sd, sd=sd))
    for figure in (change_figure(held), departure_figure(held)):
        rows = {row for place, row in estimates(as_plotly(figure)) if place == "x2"}
        assert rows == set(range(12)) - {2}


def test_information_map_is_in_percent(fit, two_level):
    (tiles,) = as_plotly(information_figure(fit)).data
    expected = 100 * np.clip(fit.posterior.information, 0, 1)
    shown = np.full(expected.shape, np.nan)
    for row, left, colour, text in zip(tiles.y, tiles.base, tiles.marker.color, tiles.text, strict=True):
        shown[row, round(left + 0.5)] = float(text)
        assert colour == between("#FFFFFF", BLUE, expected[row, round(left + 0.5)] / 100)
    np.testing.assert_allclose(shown, expected, atol=0.5)
    assert information_figure(two_level) is None
    assert departure_figure(two_level) is None
    assert not any(trace.error_x.array is not None for trace in as_plotly(change_figure(two_level)).data)


def test_markers_are_sorted_and_gaps_drawn(fit):
    trial = fit.trials[0]
    figure = as_plotly(marker_figure(trial, drifting=(trial.kinematics.ik.labels[0],)))
    final = next(t for t in figure.data if t.name == "estimate")
    assert (np.diff(final.x) <= 1e-6).all()
    assert sum("down-weighted" in label for label in final.y) == 1
    np.testing.assert_allclose(sorted(final.x), sorted(1e3 * rms_by_marker(trial.marker_errors_m["final"])), rtol=1e-5)

    kinematics = trial.kinematics
    markers = kinematics.trial.markers
    positions = markers.positions.copy()
    label = kinematics.ik.labels[2]
    column = markers.labels.index(label)
    positions[:, :, 0] = np.where(np.isfinite(positions[:, :, 0]), positions[:, :, 0], 0.0)
    positions = np.where(np.isfinite(positions), positions, 0.0)
    assert fit_gap_figure(_with_positions(trial, positions)) is None
    positions[10:15, column, 1] = np.nan
    gaps = as_plotly(fit_gap_figure(_with_positions(trial, positions)))
    assert gaps.data[0].y == (label, label, None)
    first, last, _ = gaps.data[0].x
    half = 0.5 / markers.rate_hz
    assert (first, last) == pytest.approx((markers.time[10] - half, markers.time[14] + half), abs=1e-3)


def _with_positions(trial, positions):
    kinematics = trial.kinematics
    markers = replace(kinematics.trial.markers, positions=positions)
    return replace(trial, kinematics=replace(kinematics, trial=replace(kinematics.trial, markers=markers)))


def test_marker_never_seen_has_no_distance():
    errors = np.array([[0.003, np.nan], [0.004, np.nan], [np.nan, np.nan]])
    np.testing.assert_allclose(rms_by_marker(errors), [np.sqrt(12.5e-6), np.nan])


@settings(max_examples=25)
@given(count=st.integers(1, 20), legend=st.integers(0, 6), compact_px=st.sampled_from([0, 108]))
def test_panels_never_overlap(count, legend, compact_px):
    traces = [{"type": "scatter", "y": [1.0], "name": f"line {k}"} for k in range(legend)]
    panels = [Panel(f"panel {k}", traces) for k in range(count)]
    figure = small_multiples(panels, "alt", {"title": {"text": "time"}}, compact_px=compact_px)
    for flat in figure.layout["meta"]["arrangements"].values():
        boxes = []
        for k in range(count):
            suffix = "" if k == 0 else str(k + 1)
            boxes.append((*flat[f"xaxis{suffix}.domain"], *flat[f"yaxis{suffix}.domain"]))
        for i, (left, right, low, high) in enumerate(boxes):
            assert 0 <= left < right <= 1
            assert 0 <= low < high <= 1
            for other_left, other_right, other_low, other_high in boxes[:i]:
                assert right < other_left or other_right < left or high < other_low or other_high < low


def test_compact_panels_share_the_labels_below_them():
    """The lowest panel of each column has them; titles are on two lines, and whole on paper and in what is saved."""
    titles = ["Hip power, generation + (W/kg)", "Knee flexion + (deg)", "Ankle internal rotation + (deg)"]
    figure = small_multiples([Panel(title, []) for title in titles], "alt", {"title": {"text": "%"}}, compact_px=108)
    ways = figure.layout["meta"]["arrangements"]
    labelled = {name: [way[f"xaxis{k}.showticklabels"] for k in ("", 2, 3)] for name, way in ways.items()}
    assert labelled == {"1": [False, True, True], **dict.fromkeys(("2", "3", "print"), [True] * 3)}
    assert [note["text"] for note in figure.layout["annotations"]] == [f"<b>{title}</b>" for title in titles]
    assert [ways["print"][f"annotations[{k}].text"] for k in range(3)] == [f"<b>{title}</b>" for title in titles]
    lines = [re.sub("<[^>]+>", "", ways["1"][f"annotations[{k}].text"].replace("<br>", "|")) for k in range(3)]
    assert lines == ["Hip power|generation + (W/kg)", "Knee flexion +|(deg)", "Ankle int. rotation +|(deg)"]


def test_coordinates_without_a_partner_keep_their_names():
    names = ("tilt", "hip_r", "hip_l", "knee_r")
    skeleton = SimpleNamespace(name="mine", coordinates=names, sides=by_side(names), rotational=np.array([True] * 4))
    assert [(coordinate.title, coordinate.columns) for coordinate in panels_of(skeleton)] == [
        ("tilt", {"": 0}),
        ("hip", {"r": 1, "l": 2}),
        ("knee r", {"": 3}),
    ]
    assert title_of(skeleton, 2) == "hip, left"


def test_change_of_motion_matches_the_curves(fit):
    trial = fit.trials[0]
    figure = coordinate_figure(trial, fit.skeleton)
    change = np.degrees(trial.motion_change[:, np.asarray(fit.skeleton.rotational)])
    assert f"{np.sqrt(np.nanmean(change**2)):.1f} degrees RMS" in figure.alt


def walked(loaded, measured=True):
    """A trial at 100 Hz whose right foot is loaded at these samples of 1000."""
    time = np.arange(1000) / 1000
    force = np.zeros((1000, 2, 3))
    force[:, 0, 1] = np.where(loaded(time), 700.0, 0.0)
    frames = np.arange(100) / 100
    seen = np.full(100, measured) if isinstance(measured, bool) else measured(frames)
    return Trial(
        "t", Markers(frames, ("a",), np.zeros((100, 1, 3))), FootLoads(time, force, np.zeros_like(force)), seen
    )


def test_events_are_where_the_load_begins_and_ends():
    trial = walked(lambda t: (t > 0.2) & (t < 0.7) & ~((t > 0.4) & (t < 0.41)))
    assert [(event.kind, event.side) for event in gait_events(trial)] == [("heel strike", "r"), ("toe off", "r")]
    assert [event.time_s for event in gait_events(trial)] == pytest.approx([0.2, 0.7], abs=0.002)


def test_ends_of_the_record_and_of_the_plates_are_no_events():
    assert gait_events(walked(lambda t: t < 0.6))[0].kind == "toe off"
    assert len(gait_events(walked(lambda t: t < 0.6))) == 1
    assert gait_events(walked(lambda t: (t > 0.2) & (t < 0.7), measured=False)) == []
    only = gait_events(walked(lambda t: (t > 0.2) & (t < 0.7), measured=lambda t: t < 0.5))
    assert [event.kind for event in only] == ["heel strike"]
    assert gait_events(walked(lambda t: (t > 0.3) & (t < 0.32))) == []


def test_events_of_the_demo_alternate(fit):
    for side in "rl":
        kinds = [event.kind for event in gait_events(fit.trials[0].kinematics.trial) if event.side == side]
        assert kinds
        assert all(kind != other for kind, other in itertools.pairwise(kinds))


def test_departures_are_from_the_prior_where_more_is_known_than_the_literature(fit):
    told = replace(fit, posterior=replace(fit.posterior, prior_mean=fit.estimate))
    assert not fit.more_known
    assert told.more_known
    np.testing.assert_array_equal(told.departures, np.zeros_like(fit.departures))
    assert "Change against the prior by the estimate" in change_figure(told).alt
