import numpy as np
import pytest

from kinertia.estimation.simultaneous.instruments.instrument_errors import BENDING
from kinertia.estimation.simultaneous.terms.root_loads import BendingTrunk
from kinertia.model.bsp import BodySegmentParameters
from small_problem import bending, point, small_problem


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
    before, after = (each.dynamic_parameters().reshape(-1, 10) for each in (bsp, bent))
    assert after[trunk.row, 2] == pytest.approx(before[trunk.row, 2] - 0.5)
    assert after[trunk.row, 0] == before[trunk.row, 0]
    others = np.arange(len(bsp.segments)) != trunk.row
    np.testing.assert_allclose(after[others], before[others], atol=1e-12)


def test_a_rod_that_bends_loses_as_much_inertia_as_kappa_says():
    """Points of a uniform rod go down by what a load along it displaces them, which grows with their height squared."""
    height, mass_kg, kappa = (np.arange(1000) + 0.5) / 1000 * 0.6, 30.0 / 1000, 0.01
    down = np.square(height) * kappa / (mass_kg * np.square(height).sum())
    straight, bent = (np.square(each).sum() * mass_kg for each in (height, height - down))
    moment = straight - 30.0 * 0.3**2  # about the centre of mass
    inertia = np.diag([moment, 0.01, moment])[None]
    rod = BodySegmentParameters(("torso",), np.array([30.0]), np.array([[0.0, 0.3, 0.0]]), inertia)
    before, after = (one.dynamic_parameters() for one in (rod, BendingTrunk.of(rod, 60.0).bent(rod, kappa)))
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
