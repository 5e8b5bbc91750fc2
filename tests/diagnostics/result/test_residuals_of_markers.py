"""Markers that drift or moved, and joints that the trials corrected."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.diagnostics.result.residuals import corrected_joints, moved_markers, sideways_lean
from kinertia.estimation.simultaneous.instruments.instrument_errors import AXIS, CalibrationEntry
from kinertia.estimation.simultaneous.markers.marker_noise import MarkerNoise
from kinertia.synthetic.walk import walking_subject
from kinertia.trial.data import FootLoads, Markers
from results import codes, context, error, walking

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
    assert [finding.where.trial for finding in found] == ["run"] * len(expected)


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
    assert [finding.code for finding in shown] == ["M175"] * len(found)
    assert [np.degrees(finding.evidence["rotation_rad"].value) for finding in shown] == pytest.approx(found)
    assert [finding.where.part for finding in shown] == ["right knee"] * len(found)


BOTH = tuple(error("position", 0.020, 0.0036, 0.004, "m", name, axis="z") for name in ("left", "right"))


ON_FEET = [marker for marker in walking_subject().skeleton.markers if marker.segment.startswith("foot")]


LABELS = tuple(marker.label for marker in ON_FEET)


RIGHT = tuple(marker.label for marker in ON_FEET if marker.segment == "foot_r")


def loads_beside(time, offset_m):
    """Loads of 400 N on each foot, this far to the right of the lines from heel to toe."""
    force = np.tile([0.0, 400.0, 0.0], (len(time), 2, 1))
    place = np.zeros_like(force)
    place[..., 0] = 0.1
    place[:, 0, 2], place[:, 1, 2] = 0.1 + offset_m, -0.1 + offset_m
    return FootLoads(time, force, np.cross(place, force), ("left", "right"))


def walked(recorded_m, corrected_m, seen=LABELS):
    """Kinematics and loads of somebody whose feet stand beside each other, with loads beside them by so much."""
    time = np.linspace(0.0, 1.0, 101)
    sides = np.array([0.1 if label in RIGHT else -0.1 for label in LABELS])
    positions = np.zeros((101, len(LABELS), 3))
    positions[..., 2] = sides
    for side in (0.1, -0.1):
        of_side = np.flatnonzero(sides == side)
        positions[:, of_side, 0] = np.linspace(0.0, 0.25, len(of_side))
    markers = Markers(time, LABELS, positions).select(list(seen))
    trial = SimpleNamespace(vertical="+Y", markers=markers, belt=None, loads=loads_beside(time, recorded_m))
    return SimpleNamespace(trial=trial, turned_deg=0.0), loads_beside(time, corrected_m)


def found(recorded_m, corrected_m, errors=BOTH, **walk):
    kinematics, corrected = walked(recorded_m, corrected_m, **walk)
    made = context(*errors, trials={"walk": kinematics}, ready={"subject": SimpleNamespace(height_m=1.8)})
    made.fit.trials[0].reactions = corrected
    made.__dict__["_axes"] = {"walk": FacingX()}
    return list(sideways_lean(made))


class FacingX:
    """Axes of somebody who walks along +X."""

    def named(self, axis):
        return {"axis": "mediolateral" if axis == 2 else "fore-aft", "file_axis": "XYZ"[axis]}


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_correction_that_takes_loads_away_from_the_feet_is_a_lean(sign):
    (finding,) = found(sign * 0.002, sign * -0.018)
    assert (finding.code, finding.where.axis, finding.where.plate) == ("M145", "mediolateral", None)
    assert finding.evidence["lean_m"].value == pytest.approx(0.020, abs=1e-6)
    assert finding.evidence["beside_m"].value == pytest.approx((0.002, 0.018), abs=1e-6)
    assert np.degrees(finding.evidence["tilt_rad"].value) == pytest.approx(1.16, abs=0.01)


@pytest.mark.parametrize(
    ("recorded_m", "corrected_m", "more"),
    [
        (0.020, 0.000, {}),
        (0.016, -0.008, {}),
        (0.000, 0.007, {}),
        (0.002, -0.018, {"errors": (BOTH[0], replace(BOTH[1], value=0.0))}),
        (0.002, -0.018, {"errors": tuple(replace(plate_error, axis="x") for plate_error in BOTH)}),
        (0.002, -0.018, {"errors": ()}),
        (0.002, -0.018, {"seen": RIGHT}),
    ],
    ids=["displaced plates", "too much", "a little", "one plate", "along the walk", "no error", "one foot seen"],
)
def test_other_corrections_are_none(recorded_m, corrected_m, more):
    assert codes(found(recorded_m, corrected_m, **more)) == []
