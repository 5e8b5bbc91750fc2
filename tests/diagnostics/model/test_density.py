import numpy as np
import pytest

from kinertia.diagnostics.model.density import dense_doubts, points
from kinertia.model.bsp import BodySegmentParameters


def ball(mass_kg: float, density_kg_m3: float) -> BodySegmentParameters:
    radius = (mass_kg / (4.0 / 3.0 * np.pi * density_kg_m3)) ** (1.0 / 3.0)
    return BodySegmentParameters(
        ("femur_r",), np.array([mass_kg]), np.zeros((1, 3)), 0.4 * mass_kg * radius**2 * np.eye(3)[None]
    )


@pytest.mark.parametrize(("density", "said"), [(1000.0, ""), (4990.0, ""), (8000.0, "femur_r (8 times)")])
def test_a_ball_is_as_dense_as_it_is(density, said):
    told = dense_doubts(ball(5.0, density))
    assert bool(told) == bool(said)
    assert said in "".join(told)


def test_light_bodies_are_not_judged():
    assert dense_doubts(ball(0.1, 8000.0)) == []


def test_mass_in_a_point():
    bsp = ball(5.0, 1000.0)
    none = BodySegmentParameters(bsp.segments, bsp.mass_kg, bsp.com_m, np.zeros((1, 3, 3)))
    assert points(bsp) == []
    assert points(none) == ["femur_r"]
    assert dense_doubts(none) == []
    massless = BodySegmentParameters(bsp.segments, np.zeros(1), bsp.com_m, np.zeros((1, 3, 3)))
    assert points(massless) == []
