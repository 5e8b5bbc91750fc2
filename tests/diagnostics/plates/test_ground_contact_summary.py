"""Findings on plates where the truth is known: synthetic forces, and the measured trials."""

import numpy as np
import pytest

from gait_loads import RATE_HZ
from kinertia.diagnostics.evidence.ambiguous_loads import off_plate
from kinertia.diagnostics.plates.ground_contact import check_plates
from kinertia.trial.data import Markers, PlateLoads, Recording
from walk_on_plates import ALL_STEPS, FEET, STRIDE_S, walk


def test_contacts_and_feet():
    recording = walk(ALL_STEPS)
    plates = check_plates(recording, FEET)
    assert [plate.name for plate in plates] == [f"plate {k}" for k in range(1, 9)]
    for plate, (side, number) in zip(plates, ALL_STEPS, strict=True):
        if number < 0:
            continue
        (contact,) = plate.contacts
        assert contact.foot == side
        begin = 0.2 + (STRIDE_S / 2 if side == "l" else 0.0) + STRIDE_S * number
        assert contact.start_s == pytest.approx(begin, abs=0.002)
        assert plate.peak_n == pytest.approx(700.0)
        assert plate.outside_share is None
        name = {"r": "right", "l": "left"}[side]
        assert plate.stood_on() == f"{name} {contact.start_s:.2f}-{contact.end_s:.2f} s"


def test_without_foot_markers_contacts_are_nobodys():
    (plate,) = check_plates(walk([("r", 0)]), None)
    assert [contact.foot for contact in plate.contacts] == [None]
    assert plate.stood_on().startswith("unknown foot 0.20-0.80")
    assert check_plates(Recording("static", walk([("r", 0)]).markers), FEET) == ()


@pytest.mark.parametrize("turned", [0.0, 0.5, 2.0])
@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("height", [0.0, 0.3])
def test_centre_of_pressure_off_the_plate(turned, reverse, height):
    """A rectangle of 0.6 x 0.4 m, turned; pressure on a line that leaves it: 0.04, 0.14, 0.24 m beyond its long end."""
    cosine, sine = np.cos(turned), np.sin(turned)
    spin = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
    middle = np.array([1.0, height, -2.0])
    corners = np.array([[0.3, 0, 0.2], [0.3, 0, -0.2], [-0.3, 0, -0.2], [-0.3, 0, 0.2]]) @ spin.T + middle
    corners = corners[::-1] if reverse else corners
    along = np.arange(-0.26, 0.55, 0.1)
    place = np.column_stack([along, 0 * along, 0.1 + 0 * along]) @ spin.T + middle
    force = np.tile([30.0, 700.0, -20.0], (len(along), 1))
    time = np.arange(len(along)) / RATE_HZ
    plates = PlateLoads(time, ("plate 1",), force[:, None], np.cross(place, force)[:, None], (None,), corners[None])
    markers = Markers(time, ("A",), np.zeros((len(time), 1, 3)))
    (plate,) = check_plates(Recording("one", markers, plates), None)
    assert plate.outside_share == pytest.approx(3 / 9)
    assert off_plate(plates, 0)[1] == pytest.approx(np.percentile([0.04, 0.14, 0.24], 95))
