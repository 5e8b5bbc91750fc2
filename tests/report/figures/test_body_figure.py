"""The drawn body: colours and centres of mass are those of the fit."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Joint
from kinertia.report.figures.body_figure import body_figure
from kinertia.report.figures.bsp_figures import segment_name
from kinertia.report.figures.figure import between


def changed(fit, segment, column, change):
    """The fit with one change from the literature's values."""
    table = fit.literature.table().copy()
    table[fit.literature.segments.index(segment), column] += change
    return replace(fit, estimate=BodySegmentParameters.from_table(fit.literature.segments, table))


def outlines(figure):
    """Traces of the segments by their names; one per drawing that shows it, left to right."""
    traces = {}
    for trace in figure.data:
        if trace.get("fill"):
            traces.setdefault(trace["text"].partition(":")[0], []).append(trace)
    return traces


def centres(figure, name):
    """Of the drawings, left to right: across and up (m) by segment."""
    return [
        {
            said.partition(":")[0].removeprefix("CoM of "): (float(x), float(y))
            for said, x, y in zip(trace["text"], trace["x"], trace["y"], strict=True)
        }
        for trace in figure.data
        if trace.get("name") == name
    ]


def test_each_side_is_drawn_from_its_own_side_and_from_the_front(fit):
    drawn = outlines(body_figure(fit))
    assert {name: len(traces) for name, traces in drawn.items()} == {
        segment_name(name): 3 if name in ("pelvis", "torso") else 2 for name in fit.estimate.segments
    }
    assert [note["text"] for note in body_figure(fit).layout["annotations"]] == [
        "<b>right side</b>",
        "<b>front</b>",
        "<b>left side</b>",
    ]
    knees = [body["shank, right"][0] - body["pelvis"][0] for body in centres(body_figure(fit), "CoM, literature")[:2]]
    assert knees[1] < -0.05, "the right leg is on the left of a person who faces us"


def test_what_weighs_nothing_is_not_drawn(fit):
    """OpenSim models have bodies without mass between joints, as our own has at the ankles."""
    table, prior_sd = fit.literature.table().copy(), fit.posterior.prior_sd.copy()
    row = fit.literature.segments.index("foot_r")
    table[row] = prior_sd[row] = 0.0
    literature = BodySegmentParameters.from_table(fit.literature.segments, table)
    bare = replace(fit, literature=literature, posterior=replace(fit.posterior, prior_sd=prior_sd))
    assert set(outlines(body_figure(fit))) - set(outlines(body_figure(bare))) == {"foot, right"}


def test_what_is_attached_is_drawn_where_it_is(fit):
    pack = np.array([[10.0, -0.3, 0.25, 0.0, 0.2, 0.2, 0.2, 0.0, 0.0, 0.0]])
    names = (*fit.literature.segments, "rucksack")
    literature, estimate = (
        BodySegmentParameters.from_table(names, np.concatenate([bsp.table(), pack]))
        for bsp in (fit.literature, fit.estimate)
    )
    joint = Joint("torso", "rucksack", np.eye(3), np.zeros(3), ())
    skeleton = replace(fit.skeleton, joints=(*fit.skeleton.joints, joint))
    figure = body_figure(replace(fit, skeleton=skeleton, literature=literature, estimate=estimate, posterior=None))
    centre = centres(figure, "CoM, literature")[0]["rucksack"]
    outline = outlines(figure)["rucksack"][0]
    assert np.mean([min(outline["x"]), max(outline["x"])]) == pytest.approx(centre[0], abs=2e-3)
    assert np.mean([min(outline["y"]), max(outline["y"])]) == pytest.approx(centre[1], abs=2e-3)


def test_colours_go_by_the_change_of_mass(fit):
    heavier = changed(fit, "thigh_r", 0, 0.2 * fit.literature.mass_kg[2])
    figure = body_figure(heavier)
    drawn = outlines(figure)
    assert {trace["fillcolor"] for trace in drawn["thigh, right"]} == {"#D55E00"}
    assert {trace["fillcolor"] for name, traces in drawn.items() if name != "thigh, right" for trace in traces} == {
        "#FFFFFF"
    }
    assert "+20 %" in drawn["thigh, right"][0]["text"]
    assert f"± {1.96 * fit.posterior.sd[2, 0]:.2f} kg" in drawn["thigh, right"][0]["text"]
    small = outlines(body_figure(changed(fit, "thigh_r", 0, -0.04 * fit.literature.mass_kg[2])))
    assert small["thigh, right"][0]["fillcolor"] == between("#FFFFFF", "#0072B2", 0.4)
    assert "thigh, right: +" in figure.alt


def test_colours_go_by_what_the_data_say_of_the_mass(fit, two_level):
    sd = fit.posterior.prior_sd.copy()
    sd[3, 0] *= np.sqrt(1 - 0.9)
    drawn = outlines(body_figure(replace(fit, posterior=replace(fit.posterior, sd=sd)), "information"))
    assert drawn["shank, right"][0]["fillcolor"] == between("#FFFFFF", "#0072B2", 0.9)
    assert drawn["shank, right"][0]["text"] == "shank, right: 90 % (measured)"
    assert drawn["torso"][0]["fillcolor"] == "#FFFFFF"
    assert body_figure(two_level, "information") is None
    assert "±" not in body_figure(two_level).alt


def test_a_segment_that_was_kept_is_grey_and_says_so(fit):
    posterior = fit.posterior
    prior_sd, sd = posterior.prior_sd.copy(), posterior.sd.copy()
    prior_sd[0] = sd[0] = 0.0
    kept = replace(fit, posterior=replace(posterior, prior_sd=prior_sd, sd=sd))
    for shown in ("mass", "information"):
        drawn = outlines(body_figure(kept, shown))["pelvis"]
        assert {(trace["text"], trace["fillcolor"]) for trace in drawn} == {("pelvis: fixed", "#E9E9E9")}


@pytest.mark.parametrize(("axis", "shifts"), [(0, (1, 0, -1)), (1, (0, 0, 0)), (2, (0, -1, 0))])
def test_centres_of_mass_move_where_they_are_seen_to(fit, axis, shifts):
    """25 mm forward, upward or to the right, from the right, the front and the left; the segments stand upright."""
    figure = body_figure(changed(fit, "torso", 1 + axis, 0.025))
    for before, after, shift in zip(
        centres(figure, "CoM, literature"), centres(figure, "CoM, estimate"), shifts, strict=True
    ):
        moved = np.subtract(after["torso"], before["torso"])
        np.testing.assert_allclose(moved, (0.025 * shift, 0.025 * (axis == 1)), atol=1e-6)
        assert np.abs(np.subtract(after["pelvis"], before["pelvis"])).max() == 0


def test_a_segment_is_as_long_as_it_is_and_of_its_volume(fit):
    """A thigh is drawn from the side in its true length: the outline of a capsule of its mass in water."""
    thigh = outlines(body_figure(fit))["thigh, right"][0]
    x, y = (np.asarray(thigh[name], dtype=float) for name in "xy")
    radius = 0.5 * np.ptp(x)
    long = np.ptp(y) - 2 * radius
    volume = np.pi * radius**2 * long + 4 / 3 * np.pi * radius**3
    assert volume == pytest.approx(fit.literature.mass_kg[2] / 1000, rel=0.02)
