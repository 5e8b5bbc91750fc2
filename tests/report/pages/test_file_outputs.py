"""What a file holds already beside Kinertia's curves."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.motion.model_outputs import model_outputs
from kinertia.report.comparison.side_by_side import comparison_summary, render_comparison
from kinertia.report.pages.file_outputs import compared_outputs, outputs_sentence, outputs_summary
from kinertia.report.pages.page import render
from kinertia.trial.file_contents import FileOutputs
from report_page import figures_of

SHIFT_DEG = 5.0


@pytest.fixture(scope="module")
def with_outputs(fit):
    """The demo's fit as if its file held the same curves, with angles shifted; and the same not per kg."""
    (trial,) = fit.trials
    time = trial.kinematics.trial.markers.time
    at = trial.kinematics.frames
    values = {}
    loads = trial.reactions.at(trial.time)
    for model_output in model_outputs(trial.skeleton, fit.estimate, trial.motion, loads, fit.mass_kg, "plug-in-gait"):
        if model_output.joint in ("Hip", "Knee", "Ankle") and model_output.kind != "FORCES":
            values[model_output.name] = np.full((len(time), 3), np.nan)
            values[model_output.name][at] = model_output.values * (1e-3 if model_output.kind == "MOMENTS" else 1.0)
            values[model_output.name][at] += SHIFT_DEG if model_output.kind == "ANGLES" else 0.0

    def made(factor=1.0):
        scaled = {name: points * (1.0 if name.endswith("Angles") else factor) for name, points in values.items()}
        stated = replace(trial.kinematics.trial, outputs=FileOutputs(time, scaled))
        return replace(fit, trials=(replace(trial, kinematics=replace(trial.kinematics, trial=stated)),))

    return made


@pytest.mark.parametrize("per_kg", [True, False])
def test_curves_that_are_the_same_and_shifted_ones(with_outputs, per_kg):
    fit = with_outputs(1.0 if per_kg else with_outputs().mass_kg)
    compared = compared_outputs(fit, fit.trials[0])
    assert len(compared) == 18
    for comparison in compared:
        assert comparison.correlation == pytest.approx(1.0, abs=1e-9)
        if comparison.kind == "ANGLES":
            assert comparison.rms == pytest.approx(SHIFT_DEG, abs=1e-6)
            assert comparison.mean == pytest.approx(SHIFT_DEG, abs=1e-6)
        else:
            assert comparison.rms < 1e-6
            assert not comparison.beyond
            assert comparison.outside == 0.0
    assert {comparison.quantity for comparison in compared if comparison.joint == "Knee"} == {
        "Knee flexion angle",
        "Knee extension moment",
        "Knee power",
    }


def test_report_and_comparison_show_them(fit, with_outputs):
    assert 'id="beside"' not in render(fit)
    stated = with_outputs()
    page = render(stated)
    assert 'id="beside"' in page
    folded = page.partition('id="beside"')[2].partition("</section>")[0]
    assert "Knee flexion angle" in folded
    assert ("extension moment" in folded.partition("<details>")[0]) == ('id="vicon"' not in page), "not twice"
    assert "right, in the file" in str(figures_of(page))
    both = {"before": fit, "after": stated}
    assert "after, walk</h3>" in render_comparison(both)
    summary = comparison_summary(both)["file_outputs"]
    assert summary["before"] == []
    assert summary["after"] == outputs_summary(stated)
    assert len(summary["after"]) == 18
    assert outputs_sentence(fit) == ""
    assert "hip 0.00; knee 0.00; ankle 0.00" in outputs_sentence(stated)
