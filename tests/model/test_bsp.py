from dataclasses import FrozenInstanceError

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinertia.estimation.identifiability import ParameterVector
from kinertia.model.bsp import MIRROR_SIGNS, PARAMETERS, BodySegmentParameters, combine
from pinocchio_model import pin

STUDY_SEGMENTS = (
    *("pelvis", "torso", "thigh_r", "shank_r", "foot_r", "thigh_l", "shank_l", "foot_l"),
    *("upper_arm_r", "forearm_r", "upper_arm_l", "forearm_l"),
)


def random_bsp(segments: tuple[str, ...] = STUDY_SEGMENTS, seed: int = 0) -> BodySegmentParameters:
    """Every segment a cloud of point masses, so that it is physically consistent."""
    rng = np.random.default_rng(seed)
    bodies = []
    for _ in segments:
        points = rng.normal(rng.normal(size=3), rng.uniform(0.05, 0.3, 3), (8, 3))
        bodies.append(combine(rng.uniform(0.1, 1.0, 8), points, np.zeros((8, 3, 3))))
    return BodySegmentParameters(segments, *(np.array(values) for values in zip(*bodies, strict=True)))


def one_segment(mass: float, moments: list[float], products: tuple[float, float, float] = (0, 0, 0)):
    return BodySegmentParameters.from_table(("shank_r",), [[mass, 0.1, -0.2, 0.3, *moments, *products]])


def assert_same(a: BodySegmentParameters, b: BodySegmentParameters) -> None:
    assert a.segments == b.segments
    np.testing.assert_allclose(a.table(), b.table(), rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mass_kg": np.ones(3)}, r"mass_kg has shape \(3,\); \(2,\)"),
        ({"com_m": np.zeros((2, 2))}, "com_m has shape"),
        ({"inertia_kgm2": np.eye(3)}, "inertia_kgm2 has shape"),
        ({"inertia_kgm2": np.array([np.eye(3), np.triu(np.ones((3, 3)))])}, "'b' is not symmetric"),
        ({"com_m": np.array([[0, 0, 0], [0, np.nan, 0]])}, "com_m of segment 'b' is not finite"),
        ({"segments": ("a", "a")}, "unique"),
    ],
)
def test_wrong_input_is_named(change: dict, message: str) -> None:
    valid = {
        "segments": ("a", "b"),
        "mass_kg": np.ones(2),
        "com_m": np.zeros((2, 3)),
        "inertia_kgm2": np.array(2 * [np.eye(3)]),
    }
    BodySegmentParameters(**valid)
    with pytest.raises(ValueError, match=message):
        BodySegmentParameters(**(valid | change))


def test_values_cannot_be_changed_in_place() -> None:
    bsp = random_bsp()
    with pytest.raises(ValueError, match="read-only"):
        bsp.mass_kg[0] = 1.0
    with pytest.raises(FrozenInstanceError):
        bsp.mass_kg = np.ones(12)


def test_total_mass() -> None:
    assert BodySegmentParameters.from_table(
        ("a", "b"), np.outer([1.5, 2.0], np.ones(10))
    ).total_mass_kg == pytest.approx(3.5)


def test_dynamic_parameters_are_pinocchios() -> None:
    bsp = random_bsp()
    expected = [
        pin.Inertia(m, c, i).toDynamicParameters()
        for m, c, i in zip(bsp.mass_kg, bsp.com_m, bsp.inertia_kgm2, strict=True)
    ]
    np.testing.assert_allclose(bsp.dynamic_parameters(), np.concatenate(expected), rtol=1e-12, atol=1e-14)


def test_pseudo_inertia_is_pinocchios() -> None:
    bsp = random_bsp()
    for pseudo, m, c, i in zip(bsp.pseudo_inertia(), bsp.mass_kg, bsp.com_m, bsp.inertia_kgm2, strict=True):
        expected = pin.PseudoInertia.FromInertia(pin.Inertia(m, c, i)).toMatrix()
        np.testing.assert_allclose(pseudo, expected, rtol=1e-12, atol=1e-14)


def test_round_trips() -> None:
    bsp = random_bsp()
    assert_same(bsp, BodySegmentParameters.from_table(bsp.segments, bsp.table()))
    assert_same(bsp, BodySegmentParameters.from_dynamic_parameters(bsp.segments, bsp.dynamic_parameters()))
    assert_same(bsp, BodySegmentParameters.from_frame(bsp.to_frame()))
    assert_same(bsp, bsp.mirrored().mirrored())


def test_massless_segment_survives_the_dynamic_parameters() -> None:
    talus = BodySegmentParameters.from_table(("talus",), np.zeros((1, 10)))
    assert_same(talus, BodySegmentParameters.from_dynamic_parameters(("talus",), talus.dynamic_parameters()))
    with pytest.raises(ValueError, match="'talus' has a first moment but no mass"):
        BodySegmentParameters.from_dynamic_parameters(("talus",), [0, 1, 0, 0, 0, 0, 0, 0, 0, 0])


def test_frame_is_a_long_table_in_the_documented_order() -> None:
    frame = random_bsp().to_frame()
    assert list(frame.columns) == ["segment", "parameter", "unit", "value"]
    assert list(frame["parameter"][:10]) == list(PARAMETERS)
    assert list(frame["unit"][:5]) == ["kg", "m", "m", "m", "kg m2"]
    assert list(frame["segment"].unique()) == list(STUDY_SEGMENTS)


def test_frame_rows_may_be_shuffled() -> None:
    bsp = random_bsp()
    shuffled = BodySegmentParameters.from_frame(bsp.to_frame().sample(frac=1.0, random_state=1))
    order = [shuffled.segments.index(segment) for segment in bsp.segments]
    np.testing.assert_array_equal(shuffled.table()[order], bsp.table())


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda f: f.drop(columns="unit"), "lacks the column.s. unit"),
        (lambda f: f.iloc[1:], "pelvis: mass missing"),
        (lambda f: pd.concat([f, f.iloc[:1]]), "pelvis: mass is given twice"),
        (lambda f: f.replace({"unit": {"kg": "g"}}), "pelvis: mass is in 'g'; give it in 'kg'"),
        (lambda f: f.replace({"parameter": {"ixy": "xy"}}), "pelvis: 'xy' is none of mass"),
    ],
)
def test_spoilt_frame_is_refused(spoil, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        BodySegmentParameters.from_frame(spoil(random_bsp().to_frame()))


def test_combine_agrees_with_pinocchio_and_with_one_body() -> None:
    parts = random_bsp(("a", "b", "c"))
    mass, com, inertia = combine(parts.mass_kg, parts.com_m, parts.inertia_kgm2)
    bodies = [pin.Inertia(*body) for body in zip(parts.mass_kg, parts.com_m, parts.inertia_kgm2, strict=True)]
    total = bodies[0] + bodies[1] + bodies[2]
    assert mass == pytest.approx(total.mass)
    np.testing.assert_allclose(com, total.lever, rtol=1e-12)
    np.testing.assert_allclose(inertia, total.inertia, rtol=1e-12, atol=1e-14)
    alone = combine(parts.mass_kg[:1], parts.com_m[:1], parts.inertia_kgm2[:1])
    np.testing.assert_allclose(alone[2], parts.inertia_kgm2[0], rtol=1e-14)
    with pytest.raises(ValueError, match="total mass 0"):
        combine([0.0], [[0, 0, 0]], [np.eye(3)])


def test_mirrored_is_the_reflection_in_the_sagittal_plane() -> None:
    bsp = random_bsp()
    mirrored, reflection = bsp.mirrored(), np.diag([1.0, 1.0, -1.0])
    for name, partner in (("thigh_l", "thigh_r"), ("forearm_r", "forearm_l"), ("pelvis", "pelvis")):
        i, j = bsp.segments.index(name), bsp.segments.index(partner)
        assert mirrored.mass_kg[i] == bsp.mass_kg[j]
        np.testing.assert_allclose(mirrored.com_m[i], reflection @ bsp.com_m[j])
        np.testing.assert_allclose(mirrored.inertia_kgm2[i], reflection @ bsp.inertia_kgm2[j] @ reflection)


def test_consistent_segments_have_no_inconsistencies() -> None:
    bsp = random_bsp()
    assert bsp.physically_consistent().all()
    assert (np.linalg.eigvalsh(bsp.pseudo_inertia()) > 0).all()
    assert bsp.inconsistencies() == []


@pytest.mark.parametrize(
    ("bsp", "sentences"),
    [
        (one_segment(-2.0, [2, 2, 2]), ["shank_r: mass is -2 kg, not positive."]),
        (one_segment(0.0, [2, 2, 2]), ["shank_r: mass is 0 kg, not positive."]),
        (
            one_segment(1.0, [1, 1, 2.5]),
            ["shank_r: triangle inequality ixx + iyy > izz violated by 0.5 kg m2."],
        ),
        (
            one_segment(1.0, [1, -0.5, 1.2]),
            [
                "shank_r: iyy is -0.5 kg m2, not positive.",
                "shank_r: triangle inequality ixx + iyy > izz violated by 0.7 kg m2.",
                "shank_r: triangle inequality iyy + izz > ixx violated by 0.3 kg m2.",
            ],
        ),
        (
            one_segment(1.0, [2, 2, 2], (1.5, 0, 0)),
            ["shank_r: ixy, ixz, iyz are too large: triangle inequality of the principal moments violated by 1 kg m2."],
        ),
    ],
)
def test_inconsistencies_name_segment_condition_and_amount(bsp: BodySegmentParameters, sentences: list[str]) -> None:
    assert bsp.inconsistencies() == sentences
    assert not bsp.physically_consistent().any()
    assert np.linalg.eigvalsh(bsp.pseudo_inertia()[0])[0] <= 1e-12


@given(st.lists(st.floats(-1.0, 1.0), min_size=7, max_size=7))
def test_consistency_is_positive_definiteness_of_the_pseudo_inertia(values: list[float]) -> None:
    mass, *moments = values
    bsp = one_segment(mass, moments[:3], tuple(0.3 * v for v in moments[3:]))
    smallest = np.linalg.eigvalsh(bsp.pseudo_inertia()[0])[0]
    if abs(smallest) > 1e-9:
        assert bsp.physically_consistent()[0] == (smallest > 0)
    assert bsp.physically_consistent()[0] == (bsp.inconsistencies() == [])


def test_parameter_names_units_and_bounds() -> None:
    reference = random_bsp()
    both, half = ParameterVector(reference, symmetric=False), ParameterVector(reference, symmetric=True)
    assert (len(both.names), len(half.names)) == (84, 49)
    assert both.names[14:16] == ("thigh_r.mass", "thigh_r.com_x")
    assert half.names[14:16] == ("thigh.mass", "thigh.com_x")
    segments = [name.split(".")[0] for name in half.names[::7]]
    assert segments == ["pelvis", "torso", "thigh", "shank", "foot", "upper_arm", "forearm"]
    for vector in (both, half):
        assert len(vector.units) == len(vector.lower_bounds) == len(vector.names)
    assert half.units[:5] == ("kg", "m", "m", "m", "kg m2")
    np.testing.assert_array_equal(half.lower_bounds[:7], [0, -np.inf, -np.inf, -np.inf, 0, 0, 0])


def test_theta_round_trip_and_fixed_products() -> None:
    reference, other = random_bsp(), random_bsp(seed=1)
    vector = ParameterVector(reference, symmetric=False)
    estimated = vector.bsp(vector.values(other))
    np.testing.assert_array_equal(estimated.table()[:, :7], other.table()[:, :7])
    np.testing.assert_array_equal(estimated.table()[:, 7:], reference.table()[:, 7:])


def test_symmetric_theta_is_the_mean_and_left_mirrors_right() -> None:
    reference = random_bsp()
    vector = ParameterVector(reference, symmetric=True)
    right, left = reference.segments.index("foot_r"), reference.segments.index("foot_l")
    table, theta = reference.table(), vector.values(reference)
    mean = 0.5 * (table[right] + table[left] * MIRROR_SIGNS)
    start = vector.names.index("foot.mass")
    np.testing.assert_allclose(theta[start : start + 7], mean[:7])
    np.testing.assert_array_equal(theta[:7], table[0, :7])
    symmetric = vector.bsp(theta)
    np.testing.assert_allclose(symmetric.table()[right], mean)
    for i in range(2, 12):
        np.testing.assert_array_equal(symmetric.mirrored().table()[i], symmetric.table()[i])
    np.testing.assert_allclose(vector.values(symmetric), theta, rtol=1e-15)


@pytest.mark.parametrize("symmetric", [True, False])
def test_jacobian_against_finite_differences(symmetric: bool) -> None:
    vector = ParameterVector(random_bsp(), symmetric)
    theta = vector.values(random_bsp(seed=2))
    step = 1e-6 * np.eye(len(theta))
    numeric = np.column_stack(
        [(vector.bsp(theta + h).dynamic_parameters() - vector.bsp(theta - h).dynamic_parameters()) / 2e-6 for h in step]
    )
    np.testing.assert_allclose(vector.jacobian(theta), numeric, rtol=1e-7, atol=1e-7)


def test_any_segment_names_work_left_first_or_unpaired() -> None:
    vector = ParameterVector(random_bsp(("tibia_l", "torso", "tibia_r", "hand_r")), symmetric=True)
    assert [name.split(".")[0] for name in vector.names[::7]] == ["torso", "tibia", "hand_r"]
    theta = np.arange(1.0, 22.0)
    table = vector.bsp(theta).table()
    np.testing.assert_array_equal(table[0, :7], theta[7:14] * MIRROR_SIGNS[:7])
    np.testing.assert_array_equal(table[3, :7], theta[14:])


def test_parameter_vector_refuses_what_does_not_fit() -> None:
    vector = ParameterVector(random_bsp(), symmetric=True)
    with pytest.raises(ValueError, match=r"theta has shape \(84,\); \(49,\)"):
        vector.bsp(np.zeros(84))
    with pytest.raises(ValueError, match="are not those of the reference"):
        vector.values(random_bsp(("pelvis",)))
    with pytest.raises(ValueError, match="not unique"):
        ParameterVector(random_bsp(("hand", "hand_r", "hand_l")), symmetric=True)
