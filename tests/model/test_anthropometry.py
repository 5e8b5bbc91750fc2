import hashlib
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinertia.errors import SubjectError
from kinertia.model.anthropometry import SEGMENTS, BodyGeometry, check_subject, literature_bsp
from kinertia.model.bsp import BodySegmentParameters

REFERENCE_PERSON = {"male": (73.0, 1.741), "female": (61.9, 1.735)}
LENGTHS = {
    "torso": 0.477,
    **{
        f"{name}_{side}": length
        for side in "rl"
        for name, length in {
            "thigh": 0.4222,
            "shank": 0.4403,
            "foot": 0.139,
            "foot_total": 0.2581,
            "upper_arm": 0.2817,
            "forearm": 0.2689,
        }.items()
    },
}
PERSON = BodyGeometry((-0.080, -0.008, 0.0), (-0.023, -0.088, 0.0), LENGTHS)
PELVIS_LENGTH = np.hypot(0.057, 0.080)

sexes = st.sampled_from(["male", "female"])
sources = st.sampled_from(["dumas", "deleva"])


def segment(bsp: BodySegmentParameters, name: str) -> tuple[float, np.ndarray, np.ndarray]:
    i = bsp.segments.index(name)
    return bsp.mass_kg[i], bsp.com_m[i], bsp.inertia_kgm2[i]


def table(name: str) -> pd.DataFrame:
    return pd.read_csv(files("kinertia.model") / "data" / name, comment="#")


@st.composite
def geometries(draw) -> BodyGeometry:
    lengths = {name: length * draw(st.floats(0.5, 1.3)) for name, length in LENGTHS.items()}
    lumbar = (draw(st.floats(-0.15, 0.0)), draw(st.floats(-0.05, 0.05)), draw(st.floats(-0.02, 0.02)))
    mid_hip = (draw(st.floats(-0.08, 0.02)), draw(st.floats(-0.15, -0.06)), draw(st.floats(-0.02, 0.02)))
    return BodyGeometry(lumbar, mid_hip, lengths)


@given(st.floats(10, 300), st.floats(1.2, 2.5), sexes, sources, geometries())
def test_every_body_is_consistent_and_weighs_what_the_scale_says(mass, height, sex, source, geometry) -> None:
    bsp = literature_bsp(mass, height, sex, geometry, source)
    assert bsp.segments == SEGMENTS
    assert bsp.total_mass_kg == pytest.approx(mass, rel=1e-12)
    assert bsp.inconsistencies() == []


@pytest.mark.parametrize("sex", ["male", "female"])
@pytest.mark.parametrize("source", ["dumas", "deleva"])
def test_left_mirrors_right(sex: str, source: str) -> None:
    bsp = literature_bsp(70.0, 1.7, sex, PERSON, source)
    paired = [name not in ("pelvis", "torso") for name in SEGMENTS]
    np.testing.assert_array_equal(bsp.mirrored().table()[paired], bsp.table()[paired])


def test_each_side_has_its_own_length() -> None:
    longer = replace(PERSON, lengths_m={**LENGTHS, "thigh_l": 2 * LENGTHS["thigh_l"]})
    bsp = literature_bsp(70.0, 1.7, "male", longer)
    (m_r, com_r, i_r), (m_l, com_l, i_l) = segment(bsp, "thigh_r"), segment(bsp, "thigh_l")
    assert m_l == m_r
    np.testing.assert_allclose(com_l, 2 * com_r * [1, 1, -1])
    np.testing.assert_allclose(np.diag(i_l), 4 * np.diag(i_r))


def test_dumas_male_thigh_and_foot_by_hand() -> None:
    bsp = literature_bsp(100.2, 1.77, "male", PERSON)
    mass, com, inertia = segment(bsp, "thigh_r")
    assert mass == pytest.approx(12.3)
    np.testing.assert_allclose(com, np.array([-0.041, -0.429, 0.033]) * 0.4222)
    scaled = inertia / (12.3 * 0.4222**2)
    np.testing.assert_allclose(np.diag(scaled), [0.29**2, 0.15**2, 0.30**2])
    np.testing.assert_allclose(scaled[[0, 0, 1], [1, 2, 2]], [0.07**2, -(0.02**2), -(0.07**2)])
    mass, com, inertia = segment(bsp, "foot_l")
    assert mass == pytest.approx(1.2)
    np.testing.assert_allclose(com, np.array([0.502, -0.199, -0.034]) * 0.139)
    assert inertia[0, 1] == pytest.approx(1.2 * (0.17 * 0.139) ** 2)
    assert inertia[0, 2] == pytest.approx(1.2 * (0.11 * 0.139) ** 2)


def test_sign_of_the_products_fits_the_shape_of_foot_and_thigh() -> None:
    # A foot's rear is high: integral x y < 0; a thigh's upper end is behind and outside: x y < 0, y z > 0.
    bsp = literature_bsp(100.2, 1.77, "male", PERSON)
    assert segment(bsp, "foot_r")[2][0, 1] > 0
    assert segment(bsp, "thigh_r")[2][0, 1] > 0
    assert segment(bsp, "thigh_r")[2][1, 2] < 0


def test_dumas_pelvis_is_moved_from_the_lumbar_joint_to_mid_asis() -> None:
    mass, com, inertia = segment(literature_bsp(99.9, 1.61, "female", PERSON), "pelvis")
    assert mass == pytest.approx(14.6)
    np.testing.assert_allclose(com, np.array([-0.080, -0.008, 0.0]) + np.array([-0.009, -0.232, 0.002]) * PELVIS_LENGTH)
    np.testing.assert_allclose(np.diag(inertia), 14.6 * (np.array([0.91, 1.0, 0.79]) * PELVIS_LENGTH) ** 2, rtol=1e-12)


def test_dumas_torso_is_abdomen_thorax_and_head() -> None:
    mass, com, inertia = segment(literature_bsp(100.2, 1.77, "male", PERSON), "torso")
    assert mass == pytest.approx(2.9 + 30.4 + 6.7)
    masses = np.array([2.9, 30.4, 6.7])
    lengths = np.array([0.143, 0.334, 0.278])
    fractions = np.array([[0.173, -0.361, -0.003], [0.0, -0.555, -0.004], [0.02, 0.536, 0.001]])
    coms = fractions * lengths[:, None] + [[0, 0.143, 0], [0, 0.477, 0], [0, 0.477, 0]]
    # abdomen and thorax stand together where the 2007 table's one-piece torso has its CoM
    published = np.array([0.0, 0.477, 0.0]) + 0.477 * np.array([-0.036, -0.420, -0.002])
    coms[:2] += published - masses[:2] @ coms[:2] / masses[:2].sum()
    np.testing.assert_allclose(com, masses @ coms / 40.0)
    ixx = masses * (np.array([0.54, 0.42, 0.28]) * lengths) ** 2
    away = coms - masses @ coms / 40.0
    assert inertia[0, 0] == pytest.approx((ixx + masses * (away[:, 1] ** 2 + away[:, 2] ** 2)).sum())


@pytest.mark.parametrize(("sex", "published"), [("male", -0.420), ("female", -0.436)])
def test_thorax_and_abdomen_are_about_as_high_as_the_one_piece_torso_of_2007(sex, published) -> None:
    row = table("dumas2007.csv").query("sex == @sex").set_index("segment")
    thorax, abdomen = row.loc["thorax"], row.loc["abdomen"]
    total = thorax["length"] + abdomen["length"]
    y = thorax["mass"] * thorax["com_y"] * thorax["length"]
    y += abdomen["mass"] * (abdomen["com_y"] * abdomen["length"] - 100 * thorax["length"])
    assert y / (thorax["mass"] + abdomen["mass"]) / total / 100 == pytest.approx(published, abs=0.025)


def test_forearm_carries_the_hand() -> None:
    mass, com, _ = segment(literature_bsp(100.2, 1.741, "male", PERSON), "forearm_r")
    hand = 0.1879
    assert mass == pytest.approx(1.7 + 0.6)
    expected = 1.7 * np.array([0.01, -0.417, 0.014]) * 0.2689
    expected += 0.6 * (np.array([0.035, -0.357, 0.032]) * hand + [0, -0.2689, 0])
    np.testing.assert_allclose(com, expected / 2.3)


def test_deleva_limbs_by_hand() -> None:
    bsp = literature_bsp(73.0, 1.741, "male", PERSON, "deleva")
    mass, com, inertia = segment(bsp, "shank_r")
    assert mass == pytest.approx(0.0433 * 73.0)
    np.testing.assert_allclose(com, [0, -0.4395 * 0.4403, 0])
    radii = np.array([0.251, 0.102, 0.246]) * 0.4403
    np.testing.assert_allclose(inertia, np.diag(0.0433 * 73.0 * radii**2))
    mass, com, inertia = segment(bsp, "foot_r")
    np.testing.assert_allclose(com, [0.502 * 0.139, -0.199 * 0.139, 0], atol=1e-15)
    radii = np.array([0.124, 0.245, 0.257]) * 0.2581
    np.testing.assert_allclose(inertia, np.diag(0.0137 * 73.0 * radii**2))


def test_deleva_trunk_by_hand() -> None:
    # a person as tall from mid hip to the cervical joint as the reference subject: 603.3 mm
    geometry = replace(PERSON, lengths_m={**LENGTHS, "torso": 0.6033 - 0.080})
    bsp = literature_bsp(73.0, 1.741, "male", geometry, "deleva")
    mass, com, inertia = segment(bsp, "pelvis")
    assert mass == pytest.approx(0.1117 * 73.0)
    np.testing.assert_allclose(com, [-0.023, -0.088 + (1 - 0.6115) * 0.1457, 0])
    np.testing.assert_allclose(np.diag(inertia), mass * (np.array([0.615, 0.587, 0.551]) * 0.1457) ** 2)
    mass, com, _ = segment(bsp, "torso")
    assert mass == pytest.approx((0.0694 + 0.1596 + 0.1633) * 73.0)
    down = 0.1596 * 0.5066 * 0.2421 + 0.1633 * (0.2421 + 0.4502 * 0.2155) - 0.0694 * (1 - 0.5002) * 0.2429
    np.testing.assert_allclose(com, [0, 0.5233 - down / 0.3923, 0], atol=1e-15)


@pytest.mark.parametrize(("sex", "dumas_sum"), [("male", 1.002), ("female", 0.999)])
def test_documented_sums_of_the_mass_fractions(sex: str, dumas_sum: float) -> None:
    limbs = ["upper_arm", "forearm", "hand", "thigh", "shank", "foot"]
    for name, expected, unit in (
        ("dumas2007.csv", dumas_sum, 100),
        ("deleva1996.csv", 1.0 if sex == "male" else 0.9999, 1),
    ):
        mass = table(name).query("sex == @sex").set_index("segment")["mass"] / unit
        assert mass.sum() + mass[limbs].sum() == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("sex", ["male", "female"])
def test_the_two_tables_agree_in_the_large(sex: str) -> None:
    mass, height = REFERENCE_PERSON[sex]
    dumas, deleva = (literature_bsp(mass, height, sex, PERSON, source) for source in ("dumas", "deleva"))
    np.testing.assert_allclose(dumas.mass_kg, deleva.mass_kg, rtol=0.35)
    assert np.abs(dumas.com_m - deleva.com_m).max() < 0.08
    ratio = np.diagonal(dumas.inertia_kgm2, 0, 1, 2) / np.diagonal(deleva.inertia_kgm2, 0, 1, 2)
    assert ((ratio > 0.3) & (ratio < 3.0)).all()


@pytest.mark.parametrize(
    ("arguments", "field", "unit"),
    [
        ((70000.0, 1.7, "male"), "mass_kg", "grams"),
        ((5.0, 1.7, "male"), "mass_kg", "another unit"),
        ((float("nan"), 1.7, "male"), "mass_kg", "another unit"),
        ((float("inf"), 1.7, "male"), "mass_kg", "another unit"),
        ((70.0, 170.0, "male"), "height_m", "centimetres"),
        ((70.0, 1700.0, "male"), "height_m", "millimetres"),
        ((70.0, 5.9, "male"), "height_m", "feet"),
        ((70.0, 71.0, "male"), "height_m", "inches"),
        ((70.0, 2.6, "male"), "height_m", "another unit"),
        ((70.0, 1.7, "M"), "sex", "neither male nor female"),
    ],
)
def test_impossible_subjects_are_refused(arguments, field: str, unit: str) -> None:
    with pytest.raises(SubjectError) as error:
        check_subject(*arguments)
    assert error.value.field == field
    assert (error.value.finding.code, error.value.finding.evidence["unit"].value) == ("S102", unit)
    with pytest.raises(SubjectError):
        literature_bsp(*arguments, PERSON)


def test_limits_are_allowed() -> None:
    check_subject(10.0, 0.5, "female")
    check_subject(300, 2.5, "male")


def test_unusable_geometry_and_source_are_refused() -> None:
    without = {name: length for name, length in LENGTHS.items() if name != "foot_total_l"}
    literature_bsp(70.0, 1.7, "male", replace(PERSON, lengths_m=without), "dumas")
    with pytest.raises(SubjectError, match=r"foot_total_l: this length is missing; the 'deleva' table"):
        literature_bsp(70.0, 1.7, "male", replace(PERSON, lengths_m=without), "deleva")
    for wrong in (422.2, 0.0, float("nan")):
        with pytest.raises(SubjectError, match=r"thigh_r = .*S102"):
            literature_bsp(70.0, 1.7, "male", replace(PERSON, lengths_m={**LENGTHS, "thigh_r": wrong}))
    upside_down = replace(PERSON, lumbar_joint_m=PERSON.mid_hip_m, mid_hip_m=PERSON.lumbar_joint_m)
    with pytest.raises(SubjectError, match=r"lumbar_joint_m = .*S102"):
        literature_bsp(70.0, 1.7, "male", upside_down)
    with pytest.raises(SubjectError, match="choose one of dumas, deleva"):
        literature_bsp(70.0, 1.7, "male", PERSON, "winter")


@pytest.mark.parametrize(
    ("name", "digest"), [("dumas2007.csv", "6932cbbe111f8f52"), ("deleva1996.csv", "43431c2ecc722e42")]
)
def test_tables_are_those_that_were_compared_number_by_number(name, digest):
    """With transcripts of Dumas, Chèze & Verriest 2007 (corrected foot) and of de Leva 1996, Table 4."""
    content = (files("kinertia.model") / "data" / name).read_bytes()
    assert hashlib.sha256(content).hexdigest().startswith(digest)
