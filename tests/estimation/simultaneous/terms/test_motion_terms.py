"""What coordinates pay beyond their ranges, and an estimate that stays within them."""

import numpy as np
import pytest

from kinertia.estimation.simultaneous.instruments.instrument_errors import BENDING
from kinertia.estimation.simultaneous.linear_algebra.frame_blocks import TimeBlock, time_blocks
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import NormalEquations
from kinertia.estimation.simultaneous.terms.motion_terms import BendingTrunk, RangeTerms, add_ranges, add_start
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.coordinate_range import CLAMPED_SD, SD, Bounds, Range
from small_problem import bending, point, small_problem
from validation.study_bound import dense_band

RANGES = {"elbow": Range(0.0, 2.6, clamped=True), "shoulder": Range(-1.0, 1.0, clamped=False)}


BOUNDS = Bounds.of(("elbow", "shoulder", "root"), RANGES)


def total(q: np.ndarray) -> float:
    """What these coordinates pay, frames worth one knot interval each."""
    return RangeTerms.of(BOUNDS, q, 1.0).cost


def test_within_nothing_is_paid_and_beyond_one_deviation_is_a_half():
    assert total(np.array([[1.0, 0.5, 1e9], [0.05, -0.95, -1e9]])) == 0.0
    assert total(np.array([[1.0, 1.0 + SD, 0.0]])) == pytest.approx(0.5)
    # the end is rounded off over half of this deviation
    assert total(np.array([[-10.0 * CLAMPED_SD, 0.0, 0.0]])) == pytest.approx(50.0)
    assert total(np.array([[-CLAMPED_SD, 0.0, 0.0]])) == pytest.approx(0.5 * (0.5 * np.log1p(np.exp(2.0))) ** 2)


def test_cost_and_curvature_have_no_corner_at_an_end():
    q = np.array([[2.6 + x, 0.0, 0.0] for x in np.linspace(-0.05, 0.05, 2001)])
    terms = RangeTerms.of(BOUNDS, q, 1.0)
    curvature = terms.curvature[:, 0]
    slopes = -np.gradient(terms.pull[:, 0], q[:, 0])
    np.testing.assert_allclose(slopes[2:-2], curvature[2:-2], atol=5e-3 / CLAMPED_SD**2)
    assert np.abs(np.diff(curvature)).max() < 0.01 / CLAMPED_SD**2


def test_derivatives_are_those_of_the_cost():
    rng = np.random.default_rng(0)
    basis = MotionBasis(np.linspace(0.0, 1.0, 61), 0.1)
    coefficients = rng.normal(0.0, 2.0, (basis.size, 3))

    def normal_at(coefficients: np.ndarray, time_block: TimeBlock) -> NormalEquations:
        normal = NormalEquations.zero(time_block.size, 3, 1)
        add_ranges(normal, basis, time_block, BOUNDS, basis.evaluate(coefficients, time_block.frames)[0])
        return normal

    whole = normal_at(coefficients, TimeBlock.whole(basis))
    assert whole.cost > 1.0
    step = 1e-7
    for i, j in ((0, 0), (4, 1), (7, 0), (basis.size - 1, 1), (3, 2)):
        there, back = coefficients.copy(), coefficients.copy()
        there[i, j] += step
        back[i, j] -= step
        two = [normal_at(moved, TimeBlock.whole(basis)) for moved in (there, back)]
        slope = (two[0].cost - two[1].cost) / (2 * step)
        assert slope == pytest.approx(-whole.rhs[i, j], rel=1e-5, abs=1e-3)
        bends = -(two[0].rhs - two[1].rhs)[i : i + 6] / (2 * step)
        np.testing.assert_allclose(bends[:, j], whole.band[i, : len(bends), j, j], rtol=1e-4, atol=1e-3)
    parts = time_blocks(basis, 6)
    assert len(parts) > 1
    assert sum(normal_at(coefficients, part).cost for part in parts) == pytest.approx(whole.cost)


def terms(moved: np.ndarray) -> NormalEquations:
    """Of a trial of so many splines in one block."""
    size, c = moved.shape
    basis = MotionBasis(np.linspace(0.0, 0.05 * (size - 5), 2 * size), 0.05)
    normal = NormalEquations.zero(size, c, 1)
    add_start(normal, TimeBlock.whole(basis), moved)
    return normal


def test_a_constant_offset_is_free_however_long_the_trial():
    """Ten minutes must not know an angle that markers in wrong places show wrongly: by 0.1 rad, which is much."""
    offset = np.full((12_000, 2), 0.1)
    normal = terms(offset)
    assert normal.cost < 0.2
    assert np.abs(normal.rhs).max() < 2e-4


def test_what_nothing_shows_goes_where_its_neighbours_go():
    """A gap of ten splines between two that are known."""
    normal = terms(np.zeros((12, 1)))
    matrix = dense_band(normal.band)
    matrix[[0, -1], [0, -1]] += 1e6
    filled = np.linalg.solve(matrix, 1e6 * np.eye(12)[0] * 0.2 + 1e6 * np.eye(12)[-1] * 0.3)
    np.testing.assert_allclose(filled, np.linspace(0.2, 0.3, 12), atol=0.005)


def test_terms_are_those_of_their_cost():
    rng = np.random.default_rng(0)
    moved, step = rng.normal(size=(2, 9, 3))
    normal = terms(moved)
    ahead, behind = (terms(moved + sign * step) for sign in (1.0, -1.0))
    assert (behind.cost - ahead.cost) / 2.0 == pytest.approx((normal.rhs * step).sum())
    bent = step.ravel() @ dense_band(normal.band) @ step.ravel()
    assert ahead.cost + behind.cost - 2.0 * normal.cost == pytest.approx(bent)


@pytest.fixture(scope="module")
def problem():
    return small_problem()


def test_what_stays_upright_is_not_carried_in_front_of_the_feet(problem):
    """Standing still, all that a bent trunk changes is where its weight is."""
    motion = np.zeros((3, 1, len(problem.given.free.coordinates)))
    motion[0, :, problem.given.free.coordinates.index("lumbar_extension")] = -0.3
    weight = np.array([[0.0, problem.prior.mass_kg * problem.given.free.gravity_m_s2, 0.0]])
    load = bending(problem, problem.given.free, motion, weight)[0]
    assert load[:3] == pytest.approx(0.0, abs=1e-6)
    assert load[5] == pytest.approx(-problem.given.free.gravity_m_s2 * np.sin(0.3), rel=1e-6)


def test_kappa_takes_from_the_first_moment_of_the_trunk_only(problem):
    bsp = problem.prior.mean
    trunk = BendingTrunk.of(bsp, problem.prior.mass_kg)
    assert trunk is not None
    bent = trunk.bent(bsp, 0.5)
    before, after = (body.dynamic_parameters().reshape(-1, 10) for body in (bsp, bent))
    assert after[trunk.row, 2] == pytest.approx(before[trunk.row, 2] - 0.5)
    assert after[trunk.row, 0] == before[trunk.row, 0]
    others = np.arange(len(bsp.segments)) != trunk.row
    np.testing.assert_allclose(after[others], before[others], atol=1e-12)


def test_a_rod_that_bends_loses_as_much_inertia_as_kappa_says():
    """Points of a uniform rod go down by what a load along it displaces them, which grows with their height squared."""
    height, mass_kg, kappa = (np.arange(1000) + 0.5) / 1000 * 0.6, 30.0 / 1000, 0.01
    down = np.square(height) * kappa / (mass_kg * np.square(height).sum())
    straight, bent = (np.square(heights).sum() * mass_kg for heights in (height, height - down))
    moment = straight - 30.0 * 0.3**2  # about the centre of mass
    inertia = np.diag([moment, 0.01, moment])[None]
    rod = BodySegmentParameters(("torso",), np.array([30.0]), np.array([[0.0, 0.3, 0.0]]), inertia)
    before, after = (body.dynamic_parameters() for body in (rod, BendingTrunk.of(rod, 60.0).bent(rod, kappa)))
    assert (after - before)[[4, 9]] == pytest.approx(bent - straight, rel=0.01)


@pytest.mark.parametrize(
    ("names", "masses"), [(("pelvis", "femur_r"), (10.0, 8.0)), (("lumbar1", "torso"), (15.0, 15.0))]
)
def test_no_trunk_or_one_of_several_bodies_does_not_bend(names, masses):
    bsp = BodySegmentParameters(
        names, np.array(masses), np.tile([0.0, 0.2, 0.0], (2, 1)), np.tile(np.eye(3), (2, 1, 1))
    )
    assert BendingTrunk.of(bsp, 60.0) is None


def test_every_trial_has_a_trunk_of_its_own():
    pair = small_problem(2)
    coefficients, static = point(pair)
    trunks = np.arange(len(static))[pair.layout[BENDING]]
    assert len(trunks) == 2
    for k in range(2):
        rhs = pair.gradient(k, coefficients[k], static).static_rhs[trunks]
        assert rhs[k] != 0.0
        assert rhs[1 - k] == 0.0
