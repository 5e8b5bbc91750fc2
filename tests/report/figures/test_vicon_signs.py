"""Signs of the report's curves, joint by joint and by convention, against Vicon's own in a measured file."""

from dataclasses import replace

import ezc3d
import numpy as np
import pytest

from kinertia import load_fit
from kinertia.motion.model_outputs import CLINICAL_ANGLES
from kinertia.report.figures.cycle_figures import cycle_figures
from kinertia.report.figures.time_figures import joint_moment_figure

pytestmark = pytest.mark.measured
FILE = "pig_c3d/subject_b_walk.c3d"
MOMENTS = {
    ("Hip", 0): ("Hip extension", "Hip flexion"),
    ("Hip", 1): ("Hip abduction", "Hip adduction"),
    ("Knee", 0): ("Knee extension", "Knee flexion"),
    ("Knee", 1): ("Knee abduction", "Knee adduction"),
    ("Ankle", 0): ("Ankle plantarflexion", "Ankle dorsiflexion"),
}
"""Titles by Vicon's joint and component, where the sign is Vicon's and where it is the opposite."""
OPPOSITE_IN_ISB = ("pelvis_tilt_clinical", "pelvis_obliquity_clinical")
ALIKE = 0.5
"""Least correlation with Vicon's curve: a sign is clear by far less; joint centres and axes differ."""


@pytest.fixture(scope="module")
def walk(fit_of):
    return load_fit(fit_of("pig_b").folder)


@pytest.fixture(scope="module")
def vicons(measured_folder):
    """Vicon's curve (f,) by name and component, as the file has it, and the times of its frames."""
    file = ezc3d.c3d(str(measured_folder / FILE))
    labels = [label.rpartition(":")[2] for label in file["parameters"]["POINT"]["LABELS"]["value"]]
    points, header = file["data"]["points"], file["header"]["points"]
    time = (header["first_frame"] + np.arange(points.shape[2])) / header["frame_rate"]
    return time, lambda name, row: points[row, labels.index(name)]


def under(fit, convention):
    return replace(fit, settings=fit.settings.model_copy(update={"convention": convention}))


def drawn(figure, title, side):
    """The thick curve of a side in the panel with this title, which is there once."""
    (k,) = [k for k, note in enumerate(figure.layout["annotations"]) if note["text"].startswith(f"<b>{title}")]
    axis = f"x{k + 1 if k else ''}"
    lines = [trace for trace in figure.data if trace["xaxis"] == axis and trace["name"].startswith(f"{side},")]
    (line,) = [drawn_line for drawn_line in lines if drawn_line.get("line", {}).get("width") in (2, 2.2)]
    return np.asarray(line["y"], dtype=float)


def correlation(curve, other):
    both = np.isfinite(curve) & np.isfinite(other)
    assert both.sum() > 40
    return np.corrcoef(curve[both], other[both])[0, 1]


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize(("joint", "row"), MOMENTS)
@pytest.mark.parametrize(("convention", "sign"), [("clinical", 1.0), ("isb", -1.0)])
def test_joint_moments(walk, vicons, joint, row, side, convention, sign):
    time, vicon_curve = vicons
    (trial,) = walk.trials
    curve = trial.joint_curves
    figure = joint_moment_figure(trial, walk.mass_kg, convention, len(curve.time))
    ours = drawn(figure, f"{MOMENTS[joint, row][convention == 'isb']} +", side)
    theirs = np.interp(curve.time, time, vicon_curve(f"{side[0].upper()}{joint}Moment", row))
    assert sign * correlation(ours, np.where(theirs == 0.0, np.nan, theirs)) > ALIKE


@pytest.mark.parametrize("quantity", CLINICAL_ANGLES)
@pytest.mark.parametrize("convention", ["clinical", "isb"])
def test_the_nine_angles(walk, vicons, quantity, convention):
    time, vicon_curve = vicons
    (trial,) = walk.trials
    figure = cycle_figures(under(walk, convention))["clinical"]
    angle = CLINICAL_ANGLES[quantity]
    k = list(CLINICAL_ANGLES).index(quantity)
    title = figure.layout["annotations"][k]["text"].removeprefix("<b>").partition(" +")[0]
    sign = -1.0 if convention == "isb" and quantity in OPPOSITE_IN_ISB else 1.0
    compared = 0
    for side in ("right", "left"):
        strides = [stride for stride in trial.strides if stride.side == side[0]]
        if not strides:
            continue
        curve = vicon_curve(f"{side[0].upper()}{angle.joint}Angles", angle.component)
        spans = [np.linspace(stride.start_s, stride.end_s, 101) for stride in strides]
        theirs = np.mean([np.interp(at, time, curve) for at in spans], axis=0)
        assert sign * correlation(drawn(figure, title, side), theirs) > ALIKE
        compared += 1
    assert compared
