"""The root equations of the estimate, against those of `dynamics`."""

import numpy as np
import pytest
from scipy.linalg import block_diag

from kinertia.estimation.simultaneous.inputs import BSP, STILL
from kinertia.estimation.simultaneous.terms.root_terms import RootFrames, columns_of
from kinertia.model.log_cholesky import dynamic_jacobian
from kinertia.motion.dynamics import Motion, residual_terms, root_regressor
from small_problem import curved_problem, point, small_problem


@pytest.fixture(params=["27 DOF", "curved axes"])
def problem(request, tmp_path):
    return small_problem() if request.param == "27 DOF" else curved_problem(tmp_path / "small.osim")


def test_they_are_those_of_the_dynamics_over_their_deviations(problem):
    coefficients, static = point(problem)
    frames, layout = np.flatnonzero(problem.trials[0].dynamic)[::3], problem.layout
    rng = np.random.default_rng(6)
    wrench, sd = rng.normal(0.0, 100.0, (len(frames), 6)), rng.uniform(1.0, 10.0, (len(frames), 6))
    by_ground = np.zeros((len(frames), 6, layout.in_root.stop))
    by_ground[..., layout.errors] = rng.standard_normal(by_ground[..., layout.errors].shape)
    skeleton, bsp, theta = problem.model.placed(static), problem.model.bsp(static), static[layout[BSP]]
    motion = Motion(*problem.model.full(problem.bases[0].evaluate(coefficients[0], frames), static))

    left, by = residual_terms(skeleton, bsp, motion, wrench)
    by_static = np.zeros_like(by_ground)
    by_parameter = root_regressor(skeleton, bsp.segments, motion)
    by_static[..., layout[BSP]] = by_parameter @ block_diag(*dynamic_jacobian(theta))
    by_static[..., layout[STILL]] = by.q[..., problem.given.still]
    by_static -= by_ground
    by_static[:, 3:] += np.cross(skeleton.root.centre(motion.q)[:, :, None], by_ground[:, :3], axis=1)

    columns = columns_of(skeleton, bsp.segments, problem.moving, problem.given.still, layout)
    given = RootFrames(
        skeleton,
        bsp,
        theta,
        motion,
        wrench,
        ((by_ground, lambda into, by: np.add(into, by, out=into)),),
        np.zeros((len(frames), 6, 0)),
        (),
        sd,
        frames,
        layout.in_root.stop,
    )
    terms = given.terms(columns)
    np.testing.assert_array_equal(terms.frames, frames)
    np.testing.assert_allclose(terms.left, left / sd, atol=1e-10)
    for ours, expected in ((terms.q, by.q), (terms.qd, by.qd), (terms.qdd, by.qdd)):
        np.testing.assert_allclose(ours, expected[..., problem.moving] / sd[..., None], atol=1e-10)
    np.testing.assert_allclose(terms.static, by_static / sd[..., None], atol=1e-10)
