"""Who leans over loads that run along the feet is not on displaced plates."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.diagnostics.result.sideways_lean import sideways_lean
from kinertia.synthetic.walk import walking_subject
from kinertia.trial.data import FootLoads, Markers
from results import codes, context, error

BOTH = tuple(error("position", 0.020, 0.0036, 0.004, "m", name, axis="z") for name in ("left", "right"))
ON_FEET = [one for one in walking_subject().skeleton.markers if one.segment.startswith("foot")]
LABELS = tuple(one.label for one in ON_FEET)
RIGHT = tuple(one.label for one in ON_FEET if one.segment == "foot_r")


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
        own = np.flatnonzero(sides == side)
        positions[:, own, 0] = np.linspace(0.0, 0.25, len(own))
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
    (one,) = found(sign * 0.002, sign * -0.018)
    assert (one.code, one.where.axis, one.where.plate) == ("M145", "mediolateral", None)
    assert one.evidence["lean_m"].value == pytest.approx(0.020, abs=1e-6)
    assert one.evidence["beside_m"].value == pytest.approx((0.002, 0.018), abs=1e-6)
    assert np.degrees(one.evidence["tilt_rad"].value) == pytest.approx(1.16, abs=0.01)


@pytest.mark.parametrize(
    ("recorded_m", "corrected_m", "more"),
    [
        (0.020, 0.000, {}),
        (0.016, -0.008, {}),
        (0.000, 0.007, {}),
        (0.002, -0.018, {"errors": (BOTH[0], replace(BOTH[1], value=0.0))}),
        (0.002, -0.018, {"errors": tuple(replace(one, axis="x") for one in BOTH)}),
        (0.002, -0.018, {"errors": ()}),
        (0.002, -0.018, {"seen": RIGHT}),
    ],
    ids=["displaced plates", "too much", "a little", "one plate", "along the walk", "no error", "one foot seen"],
)
def test_other_corrections_are_none(recorded_m, corrected_m, more):
    assert codes(found(recorded_m, corrected_m, **more)) == []
