"""Markers that drift or moved, and joints that the trials corrected."""

from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.diagnostics.result.marker_errors import corrected_joints, moved_markers
from kinertia.estimation.simultaneous.calibration_entry import AXIS, CalibrationEntry
from kinertia.estimation.simultaneous.markers.marker_noise import MarkerNoise
from results import codes, context, walking

TWO = {"walk": walking(), "run": walking()}


def test_a_drifting_marker_is_named_with_what_is_usual():
    noise = MarkerNoise({"A": 0.002, "B": 0.003, "C": 0.012}, 0.2, ("C",))
    (found,) = moved_markers(context(marker_noise=(noise,)))
    assert (found.code, found.where.trial, found.where.markers) == ("M163", "walk", ("C",))
    assert [found.evidence[name].value for name in ("sd_m", "usual_sd_m")] == [0.012, 0.003]


def test_heads_and_the_skin_of_forearms_turn_without_a_loose_marker():
    noise = MarkerNoise(
        {"A": 0.002, "B": 0.003, "R.Wrist.Lat": 0.012, "Top.Head": 0.012}, 0.2, ("R.Wrist.Lat", "Top.Head")
    )
    assert list(moved_markers(context(marker_noise=(noise,)))) == []


@pytest.mark.parametrize(
    ("label", "away_m", "expected"),
    [
        ("R.ASIS", 0.029, []),
        ("R.ASIS", 0.031, ["M162"]),
        ("R.Acromium", 0.07, []),  # raised arms take it along
        ("R.Acromium", 0.08, ["M162"]),
    ],
)
def test_a_marker_that_sits_elsewhere_than_in_every_other_trial(label, away_m, expected):
    quiet = MarkerNoise({label: 0.002}, 0.2, ())
    distances = ({label: 0.001}, {label: away_m})
    found = list(moved_markers(context(trials=TWO, marker_noise=(quiet, quiet), marker_distances_m=distances)))
    assert codes(found) == expected
    assert [one.where.trial for one in found] == ["run"] * len(expected)


def test_what_calibration_corrected_is_not_silent():
    nothing = SimpleNamespace(elbow_rotations_rad={}, torso_rotation_rad=None)
    alone = SimpleNamespace(posterior=None)
    assert list(corrected_joints(SimpleNamespace(ready=nothing, fit=alone))) == []
    ready = SimpleNamespace(elbow_rotations_rad={"l": -2.1}, torso_rotation_rad=0.6)
    elbow, torso = corrected_joints(SimpleNamespace(ready=ready, fit=alone))
    assert (elbow.code, elbow.where.part, elbow.evidence["rotation_rad"].value) == ("M171", "left elbow", -2.1)
    assert (torso.code, torso.evidence["rotation_rad"].value) == ("M172", 0.6)


@pytest.mark.parametrize(
    ("tilts_deg", "sd_deg", "found"), [((8.0, 7.0), 2.0, []), ((-12.0, 5.0), 2.0, [13.0]), ((-12.0, 5.0), 7.0, [])]
)
def test_a_knee_axis_that_the_trials_show_elsewhere(tilts_deg, sd_deg, found):
    entries = [
        CalibrationEntry(
            kind="joint",
            joint="knee_r",
            quantity=AXIS,
            axis=str(k),
            value=float(np.radians(tilt)),
            prior_sd=float(np.radians(5.0)),
            sd=float(np.radians(sd_deg)),
            unit="rad",
        )
        for k, tilt in enumerate(tilts_deg, 1)
    ]
    nothing = SimpleNamespace(elbow_rotations_rad={}, torso_rotation_rad=None)
    fit = SimpleNamespace(posterior=SimpleNamespace(calibration=entries))
    shown = [*corrected_joints(SimpleNamespace(ready=nothing, fit=fit))]
    assert [one.code for one in shown] == ["M175"] * len(found)
    assert [np.degrees(one.evidence["rotation_rad"].value) for one in shown] == pytest.approx(found)
    assert [one.where.part for one in shown] == ["right knee"] * len(found)
