"""The page of accuracy in its smallest form: that it is computed and filled."""

import re

import numpy as np
import pytest

from validation import accuracy
from validation.bsp_errors import errors
from validation.calibration_errors import LARGEST, calibrated, calibration_section
from validation.pooling import pooling_section
from validation.study_noise import study_draw, study_section
from validation.synthetic_walks import study_walk


def test_errors_of_the_truth_are_zero():
    trial = study_walk(0.5)
    assert errors(trial.bsp, trial.bsp) == (0.0, 0.0, 0.0)


@pytest.mark.slow
def test_page(monkeypatch):
    monkeypatch.setattr("validation.study_noise.study_walk", lambda: study_walk(0.5))
    draw = study_draw(0, two_level=False)
    outcome = calibrated(LARGEST, 0, duration_s=0.5)
    values = {name: np.arange(3.0) for name in ("whole", "first half", "second half", "halves")}
    sds = {"whole": np.ones(3), "first half": np.full(3, 2.0), "second half": np.full(3, 2.0), "halves": np.ones(3)}
    page = accuracy.document(
        {
            "draws": "1",
            "study": study_section([draw], [["at best", "1", "2", "3"]]),
            "calibration": calibration_section({"all three": [outcome]}),
            "measured": "",
            "pooling": pooling_section(values, sds),
            "people": "2",
            "moments": "",
            "error_bars": "| mass (kg) |",
        }
    )
    mass, com, inertia = draw["simultaneous"]
    assert f"| simultaneous | {mass:.2f} | {1e3 * com:.1f} | {inertia:.3f} |" in page
    assert "| at best | 1 | 2 | 3 |" in page
    assert "than with either half alone for 100 % of the BSPs" in page
    assert re.search(r"\| all three \| [\d.]+ / [\d.]+ \([\d.]+\)", page)
