"""What coordinates are called, whichever signs a model has."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.report.coordinate_titles import panels_of, title_of

LEGS = ("hip_flexion", "hip_adduction", "hip_rotation", "knee_angle", "ankle_angle", "subtalar_angle")


def titles(skeleton):
    return {one.name: one.title for one in panels_of(skeleton)}


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
    from kinertia.report.saved_fit import load_fit

    fit = load_fit(fit_with_model(model, True))
    assert titles(fit.skeleton)["knee_angle"] == title
    knee = np.degrees(fit.trials[0].coordinates["knee_angle_r"])
    assert (knee.max() > 40) == (title == "Knee flexion +")
    assert (knee.min() < -40) == (title == "Knee extension +")
