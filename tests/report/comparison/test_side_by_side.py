"""What differs between results: found where it was put, and nowhere else."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from command_line import run
from found import FAULT_FREE, FAULTY, UNUSABLE
from kinertia.model.bsp import BodySegmentParameters
from kinertia.report.comparison.side_by_side import (
    comparison_columns,
    differences,
    moments_figure,
    remarks,
    render_comparison,
)
from kinertia.report.figures.coordinate_titles import same_segment, same_sign
from report_page import Elements


def moved(fit, segment, column, sds):
    table = fit.estimate.table().copy()
    row = fit.estimate.segments.index(segment)
    table[row, column] += sds * np.sqrt(2) * fit.posterior.sd[row, column]
    return replace(fit, estimate=BodySegmentParameters.from_table(fit.estimate.segments, table))


def test_what_changed_beyond_its_error_bars_is_found(fit):
    other = moved(moved(fit, "thigh_r", 0, 2.1), "shank_l", 3, -1.8)
    compared = {(difference.segment, difference.parameter): difference for difference in differences(fit, other)}
    assert len(compared) == 120
    assert [key for key, difference in compared.items() if difference.changed] == [("thigh_r", "mass")]
    centre = compared["shank_l", "com_z"]
    assert centre.change / centre.sd == pytest.approx(-1.8)
    columns = pd.DataFrame(comparison_columns({"before": fit, "after": other}))
    assert columns[columns.changed].segment.tolist() == ["thigh_r"]
    shown = Elements(render_comparison({"before": fit, "after": other})).text
    assert "1 of 120 body segment parameters changed beyond their error bars" in shown
    assert "None of 120" in Elements(render_comparison({"before": fit, "again": fit})).text


def test_without_error_bars_nothing_is_called_changed(fit, two_level):
    assert {difference.changed for difference in differences(fit, two_level)} == {None}
    assert set(comparison_columns({"a": fit, "b": two_level})["changed"]) == {None}
    page = render_comparison({"a": fit, "b": two_level})
    assert '<p class="headline">No error bars, differences only.</p>' in page, "of no severity"
    assert "<td>no</td>" not in page
    assert "<td>no</td>" in render_comparison({"a": fit, "again": fit})


def test_error_bars_are_explained_where_there_are_any(fit, two_level):
    explained = ("beyond 1.96 times its SD", "which of them exceed the error bars", "± sd")
    without = Elements(render_comparison({"a": fit, "b": two_level})).text
    assert not [words for words in explained if words in without]
    assert "the two-level method gives no error bars, so a change cannot be distinguished from chance: b" in without
    both = Elements(render_comparison({"a": fit, "b": two_level, "c": fit})).text
    assert all(words in both for words in explained)
    (said,) = remarks({"a": two_level, "b": fit})
    assert said.endswith("so a change cannot be distinguished from chance: a, the reference of the comparison")


@pytest.mark.parametrize("findings", [FAULT_FREE, FAULTY, UNUSABLE])
def test_a_fit_has_the_verdict_that_its_report_has(fit, findings):
    judged = replace(fit, findings=findings)
    page = render_comparison({"one": judged, "two": judged})
    assert re.findall(r'<td class="level">(.*?)</td>', page) == [judged.overview.verdict] * 2


@pytest.mark.slow
@pytest.mark.measured
def test_two_persons_and_two_models_are_pointed_out(fit, fit_with_model):
    from kinertia.report.exports.saved_fit import load_fit

    heavy = replace(fit, subject=fit.subject.model_copy(update={"mass_kg": 90.0}))
    (said,) = remarks({"a": fit, "b": heavy})
    assert said == "a has 72.6 kg, b 90.0 kg: is it the same person?"
    on_model = load_fit(fit_with_model("gait2354", True))
    said = " ".join(remarks({"a": fit, "b": on_model}))
    assert "different models" in said
    assert "do not share these segments" in said
    assert "knee_angle of b has the opposite sign: its moments are drawn with the sign of a" in said
    compared = differences(fit, on_model)  # of those that both have
    assert {(difference.segment, difference.same, difference.changed) for difference in compared} == {
        ("pelvis", False, None),
        ("torso", False, None),
    }
    assert (
        "No segment is the same in both models, differences only."
        in Elements(render_comparison({"a": fit, "b": on_model})).text
    )
    moments = {
        trace["name"]: trace["y"] for trace in panel_of(moments_figure({"a": fit, "b": on_model}), "Right knee moment")
    }
    theirs = {
        trace["name"]: trace["y"]
        for trace in panel_of(moments_figure({"b": on_model}), "Right knee moment, extension +")
    }
    np.testing.assert_allclose(moments["b"], theirs["b"], rtol=1e-5)


def panel_of(figure, title):
    """The traces of the panel whose title begins so."""
    titles = [note["text"] for note in figure.layout["annotations"]]
    panel = next(k for k, text in enumerate(titles) if text.startswith(f"<b>{title}"))
    return [trace for trace in figure.data if trace["xaxis"] == (f"x{panel + 1}" if panel else "x")]


def test_a_segment_is_the_same_where_its_joints_and_neighbours_are(fit):
    ours = fit.skeleton
    assert all(same_segment(segment, ours, ours) for segment in ours.segments)
    armless = replace(ours, joints=tuple(joint for joint in ours.joints if "arm" not in joint.child))
    shared = [segment for segment in armless.segments if same_segment(segment, ours, armless)]
    assert set(armless.segments) - set(shared) == {"torso"}
    pack = replace(ours.joints[-1], child="pack", parent="torso", axes=())
    carrying = replace(ours, joints=(*ours.joints, pack))
    assert all(same_segment(segment, ours, carrying) for segment in ours.segments)


@pytest.mark.parametrize(("turned_deg", "sign"), [(0, 1), (30, 1), (180, -1), (150, -1), (90, 0)])
def test_signs_of_a_coordinate_are_told_by_what_it_turns(fit, turned_deg, sign):
    ours = fit.skeleton

    def about_another_axis(axis):
        if axis.coordinate != "knee_angle_r":
            return axis
        angle = np.radians(turned_deg)
        x, y, z = axis.direction
        return replace(
            axis, direction=np.array([x * np.cos(angle) - z * np.sin(angle), y, x * np.sin(angle) + z * np.cos(angle)])
        )

    other = replace(
        ours,
        joints=tuple(replace(joint, axes=tuple(map(about_another_axis, joint.axes))) for joint in ours.joints),
    )
    assert same_sign("knee_angle", "r", ours, other) == sign
    assert same_sign("knee_angle", "l", ours, other) == 1
    assert same_sign("wing_angle", "r", ours, other) == 0


def test_moments_are_those_of_cycles(fit):
    figure = moments_figure({"a": fit, "b": fit})
    traces = panel_of(figure, "Right knee moment, extension + (N m/kg)")
    assert [trace["name"] for trace in traces] == ["a", "b"]
    cycles = fit.cycles()
    knee = cycles[(cycles.quantity == "knee_angle_moment") & (cycles.side == "r")]
    np.testing.assert_allclose(traces[0]["y"], -knee.groupby("percent").value.mean(), rtol=1e-5, atol=1e-6)


@pytest.mark.slow
def test_the_command(fit, demo_run, tmp_path):
    moved(fit, "torso", 0, 3.0).save(tmp_path / "again")
    outcome = run("compare", demo_run[1], tmp_path / "again", "-o", tmp_path / "comparison")
    assert outcome.status == 0, outcome.err
    assert "1 of 120 body segment parameters changed beyond their error bars (mass of torso)" in " ".join(
        outcome.out.split()
    )
    assert {path.name for path in (tmp_path / "comparison").glob("[!.]*")} == {"compare.html", "compare.csv"}
    again = run("compare", demo_run[1], tmp_path / "again", "-o", tmp_path / "comparison")
    assert again.status == 0, again.err  # its own results are replaced
    for wrong in ([demo_run[1]], [demo_run[1], demo_run[1]], [demo_run[1], tmp_path]):
        assert run("compare", *wrong, "-o", tmp_path / "c").status == 2
