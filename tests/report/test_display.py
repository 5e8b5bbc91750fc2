"""What notebooks show of fits, trials and recordings."""

from dataclasses import replace

import numpy as np

from found import ASSUMED, FAULTY, ZERO
from kinertia.trial.data import Markers, PlateLoads, Recording
from report_page import Elements


def test_fit_trial_and_parameters_show_themselves(fit, two_level):
    for result in (fit, two_level):
        shown = Elements(result._repr_html_())
        assert result.subject.name in shown.text
        assert result.overview.line in shown.text
        assert len(shown.named("tr")) == 1 + 4 + 1 + 120
    found = Elements(replace(fit, findings=FAULTY)._repr_html_()).text
    assert ZERO.message in found
    trial = fit.trials[0].kinematics.trial
    shown = Elements(trial._repr_html_()).text
    assert f"{len(trial.markers.time)} frames at 100 Hz" in shown
    start, end = trial.windows()[0]
    assert f"{start:.3f} to {end:.3f} s" in shown
    assert f"right foot {trial.loads.force[:, 0, 1].max():.0f} N" in shown
    fitted = fit.trials[0]
    shown = Elements(fitted._repr_html_())
    assert fitted.name in shown.text
    assert f"{len(fitted.time)} of {len(trial.markers.time)} frames used" in shown.text
    assert len(shown.named("tr")) == 5
    table = Elements(fit.estimate._repr_html_())
    assert len(table.named("tr")) == 2 + 12
    assert f"{fit.estimate.mass_kg[1]:.4g}" in table.text


def test_recording_shows_itself():
    time = np.arange(4) / 100
    positions = np.zeros((4, 2, 3))
    positions[1, 1] = np.nan
    markers = Markers(time, ("A", "<B>"), positions)
    force = np.zeros((4, 1, 3))
    force[2, 0, 1] = 812.0
    plates = PlateLoads(time, ("FP1",), force, np.zeros((4, 1, 3)), (None,))
    shown = Elements(Recording("walk", markers, plates, mass_kg=72.6, findings=(ASSUMED,))._repr_html_()).text
    for text in ("walk", "4 frames at 100 Hz", "2 markers", "72.6 kg", "FP1 812 N", "<B> (seen 75 %)", ASSUMED.message):
        assert text in shown
    still = Elements(Recording("static", markers.cut(0.0, 0.0))._repr_html_()).text
    assert "1 frames" not in still
    assert "no force plates" in still
