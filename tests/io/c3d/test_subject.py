"""Mass, stature and body measures as different makers write them into a C3D file."""

from pathlib import Path

import numpy as np
import pytest

from kinertia.io.c3d.subject import subject_data

WHERE = Path("walk.c3d")


def read(group="PROCESSING", **values):
    entries = {key: {"value": np.array([value]) if np.isscalar(value) else value} for key, value in values.items()}
    return subject_data(WHERE, {group: entries, "POINT": {}})


def codes(data):
    return [one.code for one in data.findings]


@pytest.mark.parametrize("group", ["PROCESSING", "SUBJECT", "SUBJECTS"])
@pytest.mark.parametrize(
    "mass", ["Bodymass", "BodyMass", "BODY_MASS", "Mass", "Weight", "Mass_kg", "Body weight (kg)", "A_BodyMass_kg"]
)
@pytest.mark.parametrize("height", ["Height", "HEIGHT", "BodyHeight", "Stature", "Subject_Height", "A_Height_mm"])
def test_mass_and_stature_by_any_name(group, mass, height):
    data = read(group, **{mass: 41.5, height: 1610.0})
    assert (data.mass_kg, data.height_m) == (41.5, pytest.approx(1.61))


@pytest.mark.parametrize(
    "key",
    ["RKneeWidth", "R_KneeWidth", "RightKneeWidth", "Right Knee Width", "R.Knee.Width", "KneeWidth_R", "rkneediameter"],
)
def test_joint_widths_by_any_name(key):
    data = read(Height=1700.0, **{key: 102.0})
    assert data.measurements["RKneeWidth"] == pytest.approx(0.102)
    assert "LKneeWidth" not in data.measurements


def test_a_width_without_a_side_is_of_both():
    data = read(AnkleWidth=70.0)
    assert data.measurements["RAnkleWidth"] == data.measurements["LAnkleWidth"] == pytest.approx(0.07)


@pytest.mark.parametrize(
    ("height", "width"), [(1700.0, 102.0), (170.0, 10.2), (1.7, 0.102), (170.0, 102.0), (1.7, 102.0)]
)
def test_units_follow_from_the_stature_or_else_from_what_people_have(height, width):
    data = read(Height=height, LKneeWidth=width)
    assert (data.height_m, data.measurements["LKneeWidth"]) == (pytest.approx(1.7), pytest.approx(0.102))


def test_a_unit_that_is_named_counts():
    data = read(**{"Height_cm": 170.0, "LKneeWidth (mm)": 102.0, "Mass": "60,5 kg"})
    assert (data.mass_kg, data.height_m) == (60.5, pytest.approx(1.7))
    assert data.measurements["LKneeWidth"] == pytest.approx(0.102)


@pytest.mark.parametrize(
    ("mass_kg", "height_mm", "width_mm"),
    [(10.5, 780.0, 62.0), (16.0, 1040.0, 70.0), (25.0, 1225.0, 92.0), (150.0, 1900.0, 140.0)],
)
def test_children_and_heavy_adults_are_plausible(mass_kg, height_mm, width_mm):
    data = read(Bodymass=mass_kg, Height=height_mm, RKneeWidth=width_mm)
    assert (data.mass_kg, data.height_m) == (mass_kg, pytest.approx(height_mm / 1e3))
    assert codes(data) == ["F124"]


def test_what_cannot_be_true_is_not_used():
    data = read(Bodymass=700.0, Height=1700.0, RKneeWidth=1.0e6)
    assert (data.mass_kg, data.height_m, data.measurements) == (None, pytest.approx(1.7), {})
    assert [one.evidence["quantity"].value for one in data.findings if one.code == "F125"] == ["mass", "RKneeWidth"]
    assert read(Bodymass=400.0, Height=1250.0).mass_kg is None, "a weight in newtons"
    assert read(Height=9000.0).height_m is None


@pytest.mark.parametrize(
    "values", [{}, {"Bodymass": 0.0}, {"Bodymass": np.nan}, {"Bodymass": [60.0, 70.0]}, {"Bodymass": ""}]
)
def test_nothing_is_made_of_nothing(values):
    """Of two persons' masses nobody knows which is whose."""
    data = read(**values)
    assert (data.mass_kg, data.height_m, data.measurements, data.findings) == (None, None, {}, [])


def test_lengths_of_other_kinds_keep_their_keys_and_angles_are_none():
    data = read(Height=1700.0, InterAsisDistance=240.0, HeadOffset=10.0, LTibialTorsion=0.3)
    assert data.measurements == {"InterAsisDistance": pytest.approx(0.24)}
