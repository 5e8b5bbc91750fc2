"""What coordinates are called, whichever signs a model has."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.result.fit import Fit
from kinertia.report.figures.coordinate_titles import convention_of, panels_of, title_of
from kinertia.report.figures.cycle_figures import cycle_figures
from kinertia.report.figures.figure import BLACK, COMPARED, SIDES
from kinertia.report.figures.time_figures import joint_moment_figure

LEGS = ("hip_flexion", "hip_adduction", "hip_rotation", "knee_angle", "ankle_angle", "subtalar_angle")


def titles(skeleton):
    return {coordinate.name: coordinate.title for coordinate in panels_of(skeleton)}


def turned_round(skeleton, *coordinates):
    """The model of a maker who counts these the other way."""

    def other(axis):
        return replace(axis, direction=-np.asarray(axis.direction)) if axis.coordinate in coordinates else axis

    joints = tuple(replace(joint, axes=tuple(map(other, joint.axes))) for joint in skeleton.joints)
    return replace(skeleton, name="theirs", joints=joints)


def test_legs_of_other_models_are_called_by_what_they_do(fit):
    ours, same = fit.skeleton, titles(turned_round(fit.skeleton))
    assert {name: same[name] for name in LEGS} == {name: titles(ours)[name] for name in LEGS}
    assert same["lumbar_extension"] == "lumbar extension", "of others only the name is known"
    both = [f"{name}_{side}" for name in LEGS for side in "rl"]
    opposite = turned_round(ours, *both)
    assert [titles(opposite)[name] for name in LEGS] == [
        "Hip extension +",
        "Hip abduction +",
        "Hip external rotation +",
        "Knee extension +",
        "Ankle plantarflexion +",
        "Subtalar eversion +",
    ]
    assert title_of(opposite, opposite.coordinates.index("knee_angle_l")) == "knee extension, left"


@pytest.mark.parametrize("coordinates", [["knee_angle_r"], ["hip_adduction_l"]])
def test_sides_with_other_signs_keep_the_models_names(fit, coordinates):
    name = coordinates[0][:-2]
    assert titles(turned_round(fit.skeleton, *coordinates))[name] == name.replace("_", " ")


@pytest.mark.slow
@pytest.mark.parametrize(("model", "title"), [("gait2354", "Knee extension +"), ("rajagopal", "Knee flexion +")])
@pytest.mark.measured
def test_the_knee_bends_in_swing_as_its_title_says(fit_with_model, model, title):
    from kinertia.report.exports.saved_fit import load_fit

    fit = load_fit(fit_with_model(model, True))
    assert titles(fit.skeleton)["knee_angle"] == title
    knee = np.degrees(fit.trials[0].coordinates["knee_angle_r"])
    assert (knee.max() > 40) == (title == "Knee flexion +")
    assert (knee.min() < -40) == (title == "Knee extension +")


CONVENTIONS = ("clinical", "isb", "opensim")


MOMENTS = {
    "hip_flexion": ("Hip extension", "Hip flexion"),
    "hip_adduction": ("Hip abduction", "Hip adduction"),
    "hip_rotation": ("Hip external rotation", "Hip internal rotation"),
    "knee_flexion": ("Knee extension", "Knee flexion"),
    "knee_adduction": ("Knee abduction", "Knee adduction"),
    "knee_rotation": ("Knee external rotation", "Knee internal rotation"),
    "ankle_flexion": ("Ankle plantarflexion", "Ankle dorsiflexion"),
    "ankle_adduction": ("Ankle eversion", "Ankle inversion"),
    "ankle_rotation": ("Ankle external rotation", "Ankle internal rotation"),
}
"""Titles by the name of the moment in files, where its sign is opposite and where it is the same."""


def by_convention(fit: Fit, convention):
    return replace(fit, settings=fit.settings.model_copy(update={"convention": convention}))


def panel(figure, title):
    """The thick curve of each side in the panel with this title, which is there once."""
    (k,) = [k for k, note in enumerate(figure.layout["annotations"]) if note["text"].startswith(f"<b>{title} +")]
    axis = f"x{k + 1 if k else ''}"
    lines = [trace for trace in figure.data if trace["xaxis"] == axis and trace.get("line", {}).get("width") == 2.2]
    return {line["name"].partition(",")[0]: np.asarray(line["y"], dtype=float) for line in lines}


@pytest.mark.parametrize("convention", CONVENTIONS)
@pytest.mark.parametrize("name", MOMENTS)
def test_the_title_of_a_joint_moment_is_true(fit, convention, name):
    """Drawn as its title says: the curve in the files, whose name states the direction, or its negative."""
    figure = cycle_figures(by_convention(fit, convention))["joint_moment"]
    opposite, same = MOMENTS[name]
    title, sign = (opposite, -1.0) if convention == "clinical" else (same, 1.0)
    cycles = fit.cycles()
    for side, drawn in panel(figure, title).items():
        rows = cycles[(cycles.quantity == f"{name}_joint_moment") & (cycles.side == side[0])]
        np.testing.assert_allclose(drawn, sign * rows.groupby("percent").value.mean(), rtol=1e-5, atol=1e-5)
    assert all("internal" in note["text"] for note in figure.layout["annotations"])


def test_over_time_the_signs_are_the_same(fit):
    (trial,) = fit.trials
    for convention in CONVENTIONS:
        titles = [note["text"] for note in joint_moment_figure(trial, fit.mass_kg, convention).layout["annotations"]]
        over_cycle = cycle_figures(by_convention(fit, convention), legs=True)["joint_moment"].layout["annotations"]
        assert titles == [note["text"] for note in over_cycle]


@pytest.mark.parametrize(
    ("quantity", "clinical", "isb", "sign"),
    [
        ("pelvis_tilt", "Pelvic tilt, anterior", "Pelvic tilt, posterior", -1.0),
        ("pelvis_obliquity", "Pelvic obliquity, this side up", "Pelvic obliquity, this side down", -1.0),
        ("hip_flexion", "Hip flexion", "Hip flexion", 1.0),
        ("knee_flexion", "Knee flexion", "Knee flexion", 1.0),
        ("ankle_dorsiflexion", "Ankle dorsiflexion", "Ankle dorsiflexion", 1.0),
    ],
)
def test_clinical_angles_by_convention(fit, quantity, clinical, isb, sign):
    figures = {name: cycle_figures(by_convention(fit, name))["clinical"] for name in ("clinical", "isb")}
    ours, other = panel(figures["clinical"], clinical), panel(figures["isb"], isb)
    assert set(ours) == {"right", "left"}
    for side, values in ours.items():
        np.testing.assert_allclose(other[side], sign * values, rtol=1e-5)


def test_an_imported_model_keeps_its_own_signs_unless_one_states_others(fit):
    assert convention_of(fit) == "clinical"
    imported = replace(fit, file=object())
    assert convention_of(imported) == "opensim"
    assert convention_of(by_convention(imported, "isb")) == "isb"


def test_no_result_that_is_compared_has_the_colour_of_a_side():
    sides = {colour for _, colour in SIDES.values() if colour != BLACK}
    assert not sides & set(COMPARED)
    assert len(set(COMPARED)) == len(COMPARED)
