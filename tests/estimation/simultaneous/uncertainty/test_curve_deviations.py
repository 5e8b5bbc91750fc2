from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.simultaneous import solver
from kinertia.estimation.simultaneous.inputs import BSP, PLACES, STILL
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import StaticInformation
from kinertia.estimation.simultaneous.mixture_prior import GaussianPrior
from kinertia.estimation.simultaneous.outcome import Ended
from kinertia.estimation.simultaneous.search.gauss_newton import GaussNewton
from kinertia.estimation.simultaneous.search.problem import MapProblem, Point
from kinertia.estimation.simultaneous.solver import _roots_in_trials, _uncertainty
from kinertia.estimation.simultaneous.terms.instrument_term import CLOCK, PLATES, ZEROS
from kinertia.estimation.simultaneous.uncertainty.curve_deviations import curve_deviations
from kinertia.estimation.simultaneous.uncertainty.marginal_posterior import OfPhases
from kinertia.estimation.simultaneous.uncertainty.model_errors import block_growth, end_growth, knee_geometry
from kinertia.estimation.simultaneous.uncertainty.moment_derivatives import MomentsOfTrial
from kinertia.estimation.simultaneous.uncertainty.posterior_draws import Mode
from kinertia.motion.dynamics import Motion, inverse_dynamics
from kinertia.motion.joint_moments import body_joints, component_signs, joint_moments
from small_problem import SWITCH_S, curved_problem, point, small_problem
from validation.study_bound import dense_band


@pytest.fixture(scope="module", params=["27 DOF", "curved axes"])
def estimate(request, tmp_path_factory):
    """Also of a model in which several axes follow one coordinate by curves."""
    curved = request.param == "curved axes"
    problem = curved_problem(tmp_path_factory.mktemp("curved") / "small.osim") if curved else small_problem()
    (coefficients,), static = point(problem)
    return problem, coefficients, static


def moments(problem, coefficients: np.ndarray, static: np.ndarray, with_impact: bool = False) -> np.ndarray:
    """(d, c) joint moments at a point, by `inverse_dynamics`; with the impacts added to the loads on the feet."""
    return inverse_dynamics(*state(problem, coefficients, static, with_impact))


def state(problem, coefficients: np.ndarray, static: np.ndarray, with_impact: bool):
    """Skeleton, parameters, motion at the dynamic frames, and loads on the feet, at a point."""
    names = problem.calibration.coordinates
    values = dict(zip(names, static[problem.layout[STILL]].tolist(), strict=True))
    dynamic = np.flatnonzero(problem.trials[0].dynamic)
    motion = Motion(*problem.bases[0].evaluate_steady(coefficients)).cut(dynamic)
    reactions, time = problem.loads.reactions(0, static), problem.trials[0].time[dynamic]
    loads = reactions.at(time) + (reactions.uncertain_at(time) if with_impact else 0.0)
    return problem.skeleton.lock(values), problem.model.bsp(static), motion, loads


def prior_information(problem, static: np.ndarray) -> np.ndarray:
    information, places = problem.prior_information(static), problem.layout.errors
    information[places, places] += GaussianPrior.of(problem.layout.error_priors).precision
    return information


def dense(problem, coefficients: np.ndarray, static: np.ndarray) -> np.ndarray:
    """Information on all coefficients and static unknowns as one matrix."""
    normal = problem.normal(0, coefficients, static)
    band = dense_band(normal.band)
    n, s = len(band), problem.layout.size
    full = np.zeros((n + s, n + s))
    full[:n, :n] = band
    full[:n, n:] = normal.border.reshape(n, s)
    full[n:, :n] = full[:n, n:].T
    full[n:, n:] = normal.static + prior_information(problem, static)
    return full


@pytest.fixture(params=[(1.0, 1.0, 1.0), (0.5, 0.2, 3.0)], ids=["as expected", "unlike"])
def noise(request) -> np.ndarray:
    """What is seen of the markers' errors, their rates and their accelerations, over what is expected."""
    return np.array(request.param)


def curves(problem, coefficients: np.ndarray, static: np.ndarray) -> dict[str, np.ndarray]:
    """(d, ...) all that has a deviation, by the functions that results are made with."""
    dynamic = np.flatnonzero(problem.trials[0].dynamic)
    q, qd, _ = (part[dynamic] for part in problem.bases[0].evaluate(coefficients))
    moment = moments(problem, coefficients, static)
    ground = problem.loads.reactions(0, static).at(problem.trials[0].time[dynamic])[..., :3]
    return {
        "coordinates": q,
        "moments": moment,
        "powers": qd * moment,
        "ground_forces": ground.reshape(len(q), 6),
        "joints": joints(problem, coefficients, static),
    }


def joints(problem, coefficients: np.ndarray, static: np.ndarray, with_impact: bool = False) -> np.ndarray:
    """(d, 6 j) moments and forces of joints, as `moments`; without signs for sides."""
    skeleton, bsp, motion, loads = state(problem, coefficients, static, with_impact)
    found = joint_moments(skeleton, bsp, motion, loads)
    signs = np.array([component_signs(joint) for joint in body_joints(skeleton)]).reshape(-1, 3)
    return np.stack([found.moments * signs, found.forces], axis=2).reshape(len(motion.q), 6 * len(signs))


def derivatives_at(problem, coefficients: np.ndarray, static: np.ndarray, delay_sd_s: float):
    """The motion at the dynamic frames, and `MomentsOfTrial.derivatives` there."""
    frames = np.flatnonzero(problem.trials[0].dynamic)
    motion = [part[frames] for part in problem.model.full(problem.bases[0].evaluate_steady(coefficients), static)]
    reactions = problem.loads.reactions(0, static)
    return motion, MomentsOfTrial(problem, 0, static, reactions, delay_sd_s).derivatives(motion, frames)


def delay_sd_s(problem, covariance: np.ndarray) -> float:
    """Deviation of the delay of the forces, from the covariance (S, S) of the static unknowns."""
    late = problem.loads.delay_unknowns(0)
    return float(np.sqrt(covariance[np.ix_(late, late)].sum()))


def dense_derivatives(
    problem, coefficients: np.ndarray, static: np.ndarray, shares=(1.0, 1.0, 1.0), delay_sd_s=0.0, grown=1.0
) -> dict[str, np.ndarray]:
    """(d, ..., unknowns) derivatives of `curves` by all coefficients and static unknowns; with these shares of what
    places, rates and accelerations do, and times `grown` (d, r, 1) what they do to moments.
    """
    basis, frames = problem.bases[0], np.flatnonzero(problem.trials[0].dynamic)
    motion, every = derivatives_at(problem, coefficients, static, delay_sd_s)
    d, (size, c) = len(frames), coefficients.shape
    by, three = every.rows(slice(0, c)), every.rows(slice(c, None))
    nothing, same = np.zeros((d, c, c)), np.tile(np.eye(c), (d, 1, 1))
    still, zero, ground = by.static, np.zeros_like(by.static), np.zeros((d, 6, by.static.shape[2]))
    ground[..., problem.layout.errors] = by.ground
    speed, value = motion[1][:, problem.moving][..., None], by.value[..., None]
    more = np.broadcast_to(grown, (d, every.q.shape[1], 1))
    by_place, by_rate, by_acceleration = (more[:, :c] * derivative for derivative in (by.q, by.qd, by.qdd))
    orders = {
        "coordinates": (same, nothing, nothing, zero),
        "moments": (by_place, by_rate, by_acceleration, still),
        "powers": (speed * by_place, speed * by_rate + value * same, speed * by_acceleration, speed * still),
        "ground_forces": (*(np.zeros((d, 6, c)),) * 3, ground),
        "joints": (*(more[:, c:] * derivative for derivative in (three.q, three.qd, three.qdd)), three.static),
    }
    result = {}
    for name, (*moved, fixed) in orders.items():
        wide = fixed.shape[1]
        through = np.zeros((d, wide, size, c))
        for row, t in enumerate(frames):
            for a, spline in enumerate(basis.active[t]):
                parts = zip(basis.steady_values[:, t, a] * shares, moved, strict=True)
                through[row, :, spline] = sum(derivative * part[row] for derivative, part in parts)
        rest = np.zeros((d, wide, problem.layout.size - fixed.shape[2]))
        result[name] = np.concatenate([through.reshape(d, wide, size * c), fixed, rest], axis=2)
    return result


def test_derivatives_agree_with_finite_differences(estimate):
    """In random directions of one kind of unknown each."""
    problem, coefficients, static = estimate
    n, layout = coefficients.size, problem.layout
    derivatives = dense_derivatives(problem, coefficients, static)
    rng = np.random.default_rng(0)
    kinds = (layout[BSP], layout[PLATES], layout[CLOCK], layout[ZEROS], layout[STILL])
    parts = [slice(0, n), *(slice(n + part.start, n + part.stop) for part in kinds)]
    # a step under load, which there is none of, makes the splines through the loads swing for some samples
    frames_s = problem.trials[0].time[problem.trials[0].dynamic]
    away = np.abs(frames_s - SWITCH_S) > 0.05
    # nor is it told between samples where somebody begins to stand
    reactions = problem.loads.reactions(0, static)
    steps_s = reactions.time[1:][np.diff(reactions.loaded, axis=0).any(axis=1)]
    away &= (np.abs(frames_s[:, None] - steps_s) > 0.05).all(axis=1)
    assert away.any()
    for part in parts:
        for _ in range(3):
            h = np.zeros(n + layout.size)
            h[part] = rng.normal(0.0, 1e-5, part.stop - part.start)
            ahead, behind = (
                curves(problem, coefficients + s * h[:n].reshape(coefficients.shape), static + s * h[n:])
                for s in (1.0, -1.0)
            )
            for name, derivative in derivatives.items():
                change, expected = derivative @ h, (ahead[name] - behind[name]) / 2.0
                size = max(np.abs(change).max(initial=0.0), 1e-9 * np.abs(ahead[name]).max(initial=0.0))
                np.testing.assert_allclose(change[away], expected[away], atol=1e-6 * size, err_msg=name)


def test_deviations_are_those_of_the_dense_covariance(estimate, noise):
    problem, coefficients, static = estimate
    information = dense(problem, coefficients, static)
    full = inverse(information)
    n = coefficients.size
    # of it, what would be left if all that does not move were known
    alone = inverse(dense(problem, coefficients, static)[:n, :n])
    part = problem.eliminated(0, coefficients, static)
    information = prior_information(problem, static) + part.information
    root = StaticInformation.of(information, problem.layout.in_root.stop).root_of_covariance()
    # each over the deviations of its two unknowns: what is nearly uncorrelated is known no better than these
    static_sd = np.sqrt(np.diag(full)[n:])
    relative = root @ root.T / np.outer(static_sd, static_sd), full[n:, n:] / np.outer(static_sd, static_sd)
    np.testing.assert_allclose(*relative, rtol=0.0, atol=1e-4)
    sd = curve_deviations(problem, 0, coefficients, static, part, root, noise)
    impacts, speed = of_impacts(problem, coefficients, static, moments), speeds(problem, coefficients)
    noise_n = problem.loads.reactions(0, static).noise_n * (
        curves(problem, coefficients, static)["ground_forces"] != 0.0
    )
    late = delay_sd_s(problem, full[n:, n:])
    left, c = derivatives_at(problem, coefficients, static, late)[1], coefficients.shape[1]
    of_joints = of_impacts(problem, coefficients, static, joints) + left.delay_squares[:, c:]
    more = {
        "joints": of_joints + knee_geometry(problem.skeleton, body_joints(problem.skeleton), left.value[:, c:]),
        "moments": impacts + left.delay_squares[:, :c],
        "powers": (impacts + left.delay_squares[:, :c]) * speed**2,
        "ground_forces": noise_n**2 + left.ground_delay_squares,
    }
    by = dense_derivatives(problem, coefficients, static, delay_sd_s=late)
    by_noise = dense_derivatives(problem, coefficients, static, np.sqrt(noise), late, grown(problem, static))
    for name, derivative in by.items():
        expected = np.einsum("dri,ij,drj->dr", derivative, full, derivative, optimize=True) + more.get(name, 0.0)
        for sign, shaken in ((1.0, by_noise[name][..., :n]), (-1.0, derivative[..., :n])):
            expected += sign * np.einsum("dri,ij,drj->dr", shaken, alone, shaken, optimize=True)
        found = getattr(sd, name).reshape(expected.shape)
        np.testing.assert_allclose(found, np.sqrt(expected), rtol=1e-3, err_msg=name)


def test_unknowns_that_are_left_out_of_the_vector_count_in_all_curves(estimate):
    """As the mass that moves with a thigh in other tasks: motion, loads and parameters follow it."""
    problem, coefficients, static = estimate
    n, layout, rng = coefficients.size, problem.layout, np.random.default_rng(3)
    part = problem.eliminated(0, coefficients, static)
    information = prior_information(problem, static) + part.information
    root = StaticInformation.of(information, layout.in_root.stop).root_of_covariance()
    more = 10.0 * root @ rng.normal(size=(layout.size, 2)) / np.sqrt(layout.size)
    more[problem.loads.delay_unknowns(0)] = 0.0  # their derivatives depend on their own deviation
    here = problem, 0, coefficients, static, part
    without, with_more = (
        curve_deviations(*here, unknowns_root, np.ones(3)) for unknowns_root in (root, np.hstack([more, root]))
    )
    normal = problem.normal(0, coefficients, static)
    followed = -np.linalg.solve(dense_band(normal.band), normal.border.reshape(n, -1) @ more)
    late = delay_sd_s(problem, root @ root.T)
    for name, by in dense_derivatives(problem, coefficients, static, delay_sd_s=late).items():
        change = np.square(by @ np.concatenate([followed, more])).sum(axis=-1)
        before, after = (
            np.square(getattr(deviations, name)).reshape(change.shape) for deviations in (without, with_more)
        )
        assert not change.size or (change > 0.1 * before).any(), name
        np.testing.assert_allclose(after, before + change, rtol=1e-3, atol=1e-6 * change.max(initial=0.0), err_msg=name)


def grown(problem, static: np.ndarray) -> np.ndarray:
    """(d, r, 1) by how much more the markers' errors make of moments where skin moves unseen, and at the ends."""
    every = problem.trials[0].time
    time = every[problem.trials[0].dynamic]
    larger = block_growth(problem, 0, static, time, body_joints(problem.skeleton))
    return (larger * end_growth(problem.bases[0], every, time)[:, None])[..., None]


def speeds(problem, coefficients: np.ndarray) -> np.ndarray:
    """(d, c) of the coordinates that move."""
    return problem.bases[0].evaluate(coefficients)[1][problem.trials[0].dynamic]


def test_deviations_of_two_trials_are_those_of_one_dense_matrix(estimate, noise, monkeypatch):
    """The first counts for two: what its motion leaves open is that of the errors alone."""
    monkeypatch.setattr(solver, "motion_noise", lambda *_: noise)
    problem, coefficients, static = estimate
    (trial,) = problem.trials
    sd = np.linspace(0.0, 0.02, len(problem.skeleton.markers))
    trials = [replace(trial, displacement_sd_m=sd).repeated(2.0), replace(trial, displacement_sd_m=sd[::-1].copy())]
    pair = MapProblem(problem.skeleton, problem.prior, problem.calibration, trials)
    static = point(pair)[1]
    rng = np.random.default_rng(0)
    here = pair.at(Point((coefficients,) * 2, static, tuple(rng.normal(size=3 * len(sd)) for _ in range(2))))
    gaussian = GaussianPrior.of(pair.layout.error_priors)
    chains, information, rhs = dense_pair(pair, here, gaussian)
    covariance = inverse(information)
    model = GaussNewton.of(pair, here).under(gaussian)
    ended = Ended(here.point, here, gaussian, True, 1, (0.0, 0.0))
    none = Mode(
        np.zeros(pair.layout.size), tuple(np.zeros_like(coefficient) for coefficient in here.point.coefficients)
    )
    alike = OfPhases(static, np.zeros((len(static),) * 2), (pair, pair), (here.point, here.point))
    uncertain = _roots_in_trials(pair, ended, model), np.zeros((pair.layout.size, 0))
    static_covariance, sds, _ = _uncertainty(pair, ended, model, uncertain, [none], alike)
    s = pair.layout.size
    scale = np.sqrt(np.diag(static_covariance))
    np.testing.assert_allclose(
        static_covariance / np.outer(scale, scale), covariance[:s, :s] / np.outer(scale, scale), atol=1e-4
    )
    model, answered = GaussNewton.of(pair, here).under(gaussian), here.slope.under(gaussian)[1]
    assert answered @ model.step(answered) == pytest.approx(rhs @ covariance @ rhs, rel=1e-4)

    in_trial = pair.in_trial(0, here.point)
    late = delay_sd_s(pair, chains[0] @ covariance @ chains[0].T)
    by = dense_derivatives(pair, coefficients, in_trial, delay_sd_s=late)["moments"]
    n = coefficients.size
    normal = pair.normal(0, coefficients, in_trial)
    motion = inverse(dense_band(normal.band))
    carried = -motion @ normal.border.reshape(n, s)
    through = by[..., n:] + by[..., :n] @ carried
    larger = grown(pair, in_trial)
    shaken = dense_derivatives(pair, coefficients, in_trial, np.sqrt(noise), late, larger)["moments"][..., :n]
    expected = np.einsum("dri,ij,drj->dr", shaken, motion / 2.0, shaken, optimize=True)
    of_static = chains[0] @ covariance @ chains[0].T
    expected += np.einsum("dri,ij,drj->dr", through, of_static, through, optimize=True)
    left = derivatives_at(pair, coefficients, in_trial, late)[1].delay_squares[:, : coefficients.shape[1]]
    expected = np.sqrt(expected + of_impacts(pair, coefficients, in_trial, moments) + left)
    np.testing.assert_allclose(sds[0].moments, expected, rtol=1e-3)


def inverse(matrix: np.ndarray) -> np.ndarray:
    scale = 1.0 / np.sqrt(np.diag(matrix))
    return scale[:, None] * np.linalg.inv(scale[:, None] * matrix * scale) * scale


def dense_pair(pair, here, gaussian) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
    """Static unknowns, displacements and motions of two trials in one matrix: per trial the derivative of its static
    unknowns by all, information, right-hand side.
    """
    point, places = here.point, pair.layout.errors
    normals = [pair.normal(k, part, pair.in_trial(k, point)) for k, part in enumerate(point.coefficients)]
    s, wide = pair.layout.size, len(point.displaced[0])
    sizes = [normal.rhs.size for normal in normals]
    ends = s + 2 * wide + np.cumsum(sizes)
    information, rhs = np.zeros((ends[-1],) * 2), np.zeros(ends[-1])
    information[:s, :s] = pair.prior_information(point.static)
    rhs[:s], _ = pair.prior_slope(point.static)
    information[places, places] += gaussian.precision
    rhs[places] += gaussian.pull - gaussian.precision @ point.static[places]
    chains = []
    for k, normal in enumerate(normals):
        columns, moving = slice(s + k * wide, s + (k + 1) * wide), slice(ends[k] - sizes[k], ends[k])
        chain = np.zeros((s, ends[-1]))
        chain[:, :s] = np.eye(s)
        chain[pair.layout[PLACES], columns] = np.diag(pair.displaced_sd[k])
        across = normal.border.reshape(-1, s) @ chain
        information += chain.T @ normal.static @ chain
        information[moving] += across
        information[:, moving] += across.T
        information[moving, moving] += dense_band(normal.band)
        information[columns, columns] += np.eye(wide)
        rhs += chain.T @ normal.static_rhs
        rhs[moving] += normal.rhs.ravel()
        rhs[columns] -= point.displaced[k]
        chains.append(chain)
    return chains, information, rhs


def of_impacts(problem, coefficients: np.ndarray, static: np.ndarray, kind) -> np.ndarray:
    """(d, ...) moving mean square of what impacts would add to `moments` or `joints`."""
    more = kind(problem, coefficients, static, True) - kind(problem, coefficients, static)
    basis = problem.bases[0]
    half = round(2.0 * len(basis.first) / (basis.size - 5))
    rows = np.clip(np.arange(len(more))[:, None] + np.arange(-half, half + 1), 0, len(more) - 1)
    return np.square(more)[rows].mean(axis=1)
