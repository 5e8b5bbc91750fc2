"""Findings on plates where the truth is known: synthetic forces, and the measured trials."""

from dataclasses import replace

import numpy as np
import pytest

from gait_loads import MASS_KG, RATE_HZ, gait_loads
from kinertia.diagnostics.plates.plate_summary import check_plates, mass_by_strides
from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.trial.data import FootLoads, Markers, PlateLoads, Recording, Trial
from walk_on_plates import ALL_STEPS, FEET, STRIDE_S, walk


def trial_of(loads, start_s, end_s):
    time = np.arange(0, loads.time[-1], 0.01)
    markers = Markers(time, ("A",), np.zeros((len(time), 1, 3)))
    return Trial("walk", markers, loads, (time >= start_s - 1e-9) & (time <= end_s + 1e-9))


@pytest.mark.parametrize(
    ("window", "over"),
    [((0.3, 3.43), "whole strides"), ((0.33, 1.62), "whole strides"), ((0.75, 1.4), "one step")],
)
def test_mass_over_whole_strides(window, over):
    trial = trial_of(gait_loads(4.0), *window)
    mass = mass_by_strides(trial)
    assert mass.over == over
    assert window[0] - 0.01 <= mass.start_s < mass.end_s <= window[1] + 0.01
    assert mass.mass_kg == pytest.approx(MASS_KG, rel=0.002)
    inside = (trial.loads.time >= window[0]) & (trial.loads.time <= window[1])
    plain = trial.loads.force[inside, :, 1].sum(axis=1).mean() / GRAVITY_M_S2
    assert abs(plain - MASS_KG) > 0.005 * MASS_KG  # what whole strides are needed for


def test_two_steps_where_no_foot_lands_twice():
    """Single plates under three steps: no foot's landing or leaving is seen twice."""
    loads = gait_loads(1.75)
    force = loads.force.copy()
    force[loads.time < 0.32, 1] = 0.0
    force[loads.time > 1.5, 0] = 0.0
    trial = trial_of(replace(loads, force=force), 0.33, 1.48)
    mass = mass_by_strides(trial)
    assert mass.over in ("two steps", "whole strides")
    assert mass.mass_kg == pytest.approx(MASS_KG, rel=0.01)


def test_no_whole_step_no_mass():
    assert mass_by_strides(trial_of(gait_loads(4.0), 1.0, 1.3)) is None
    assert mass_by_strides(trial_of(gait_loads(4.0), 9.0, 9.5)) is None


def test_standing_is_weighed_over_the_whole_window():
    time = np.arange(0, 1, 1 / RATE_HZ)
    force = np.zeros((len(time), 2, 3))
    force[:, :, 1] = MASS_KG * GRAVITY_M_S2 / 2
    trial = trial_of(FootLoads(time, force, np.zeros_like(force)), 0.0, 0.9)
    assert mass_by_strides(trial) is None  # a second of squatting would not be body weight
    assert mass_by_strides(trial, standing=True).mass_kg == pytest.approx(MASS_KG)


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
    assert plate.outside_m == pytest.approx(np.percentile([0.04, 0.14, 0.24], 95))


def test_who_jumps_is_not_weighed():
    """From the landing on the mean force is more than body weight: it stops the fall."""
    loads = gait_loads(4.0)
    force = np.where((loads.time < 0.5) | (loads.time > 0.9), 0.5 * MASS_KG * GRAVITY_M_S2, 0.0)
    both = np.zeros_like(loads.force)
    both[:, :, 1] = force[:, None]
    assert mass_by_strides(trial_of(replace(loads, force=both), 0.0, 3.9)) is None
    assert mass_by_strides(trial_of(replace(loads, force=both), 1.0, 3.9)).mass_kg == pytest.approx(MASS_KG)


def test_hops_on_one_leg_are_no_strides():
    """0.25 s on the ground of every 0.5 s, which carry the body on average."""
    loads = gait_loads(4.0)
    on_ground = loads.time % 0.5 < 0.25
    force = np.zeros_like(loads.force)
    force[:, 0, 1] = np.where(on_ground, 2.0 * MASS_KG * GRAVITY_M_S2, 0.0)
    mass = mass_by_strides(trial_of(replace(loads, force=force), 0.1, 3.9))
    assert mass.over == "whole hops"
    assert mass.mass_kg == pytest.approx(MASS_KG, rel=0.01)
