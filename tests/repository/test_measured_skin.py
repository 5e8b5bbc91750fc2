"""Skin measured on a donor, carried over to another person's thighs and shanks."""

import numpy as np
import pandas as pd
import pytest

pytest.importorskip("opensim")
measured_skin = pytest.importorskip("validation.measured_skin")
skin_laboratory = pytest.importorskip("validation.skin_laboratory")


@pytest.fixture
def donor(tmp_path):
    """Two strides of three markers; the shank's one swings once per stride, the second stride twice as far."""
    phase = 2 * np.pi * np.arange(300) / 150
    moved = np.zeros((300, 3, 3))
    moved[:, 2, 0] = 0.004 * np.sin(phase) * np.where(np.arange(300) < 150, 1.0, 2.0)
    moved[:, 0, 1] = 0.006 * np.cos(phase)
    place = np.array([[0.05, 0.3, 0.0], [0.05, 0.1, 0.0], [0.04, -0.2, 0.0]])
    segment = np.array(["thigh", "thigh", "shank"])
    columns = {"moved": moved, "place": place, "segment": segment, "stature": np.array(1.7)}
    np.savez(tmp_path / "skin.npz", **{f"someone_{key}": value for key, value in columns.items()})
    return measured_skin.MeasuredSkin.read(tmp_path / "skin.npz")


def test_nearest_curves_are_taken_once_while_there_are_enough(donor):
    high = donor.places[0]
    assert donor.curves("thigh", np.array([high, high])) == [0, 1]
    assert donor.curves("shank", np.array([high, high])) == [2, 2]


def test_strides_follow_each_other_as_they_were_measured(donor):
    strides = np.arange(0.0, 4.0, 0.01)
    moved = donor.at(strides, [2])[:, 0, 0]
    assert np.allclose(moved[:200], moved[200:], atol=1e-6)
    assert moved[100:200].max() == pytest.approx(2 * moved[:100].max(), rel=0.01)


def test_strides_count_from_the_first_heel_strike():
    time = np.array([0.4, 1.0, 1.5, 2.2, 3.3])
    assert measured_skin.strides_since(time, np.array([1.0, 2.0, 3.2]), 1.1) == pytest.approx(
        [-0.6 / 1.1, 0.0, 0.5, 1.0 + 0.2 / 1.2, 2.0 + 0.1 / 1.1]
    )


def test_heel_strikes_are_where_the_force_rises():
    force = np.tile([0.0, 0.0, 500.0, 600.0, 0.0], 3)
    forces = pd.DataFrame({"ground_force_r_vy": force}, pd.Index(0.1 * np.arange(15)))
    assert measured_skin.heel_strikes_s(forces, "r") == pytest.approx([0.2, 0.7, 1.2])


def test_page_has_coverage_over_the_stride_and_after_heel_strike():
    name = "knee_angle_r_moment"
    errors, down = np.array([1.0, 1.0, 5.0, 1.0]), np.array([False, False, True, True])
    walk = skin_laboratory.Walk(
        {name: errors},
        {name: np.ones(4)},
        {hz: {name: 2.0 * errors} for hz in (6, 10, 12)},
        {name: down},
        {"plate": 17},
    )
    knee = skin_laboratory.joint_row([walk], "knee_angle")
    assert knee == ["knee", "2.65", "5.29", "0.50", "1.00", "75 %", "3.61", "50 %"]
    found = skin_laboratory.instruments_text([walk], skin_laboratory.INSTRUMENTS["faulty"])
    assert "plate, 20 mm: found to 3.0 mm (RMS), within 4 mm in 1 of 1 people" in found
    assert "delay, 10 ms: found to 10.0 ms (RMS), within 2 ms in 0 of 1 people" in found
