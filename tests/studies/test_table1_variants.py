from dataclasses import astuple, fields, replace
from functools import partial
from unittest import mock

import numpy as np
import pytest

from kinertia.estimation.study_parameters import ParameterVector
from kinertia.estimation.two_level import TwoLevelProblem, TwoLevelResult, Window
from kinertia.motion.dynamics import residual
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.studies import table1_guesses
from kinertia.studies.table1 import PUBLISHED, Errors, inner_frames, random_start, run_draw, study_trial
from kinertia.studies.table1_guesses import trust_region
from kinertia.studies.table1_variants import (
    BASE,
    CLASSES,
    NEAREST,
    NOISY,
    TODAY,
    VARIANTS,
    Course,
    Variant,
    VariantResult,
    run_variant_draw,
    run_variants,
)
from kinertia.synthetic.noise import displaced, study_noise
from kinertia.synthetic.walk import balancing_wrench
from one_process import in_one_process


@pytest.fixture(scope="module")
def trial():
    return study_trial()


@pytest.fixture(scope="module")
def vector(trial):
    return ParameterVector(trial.bsp, True)


@pytest.fixture(scope="module")
def problem(trial, vector):
    """Uncorrected, without noise, so that the residual is linear in the masses; moments as they are."""
    return TwoLevelProblem(trial.skeleton, vector, [trial.window], False, 1.0)


def changed(variant):
    """What differs from the base: fields, and options of the trust region method."""
    names = {f.name for f in fields(Variant)} - {"title", "share"}
    found = {name for name in names if getattr(variant, name) != getattr(BASE, name)}
    options = variant.estimate.keywords if isinstance(variant.estimate, partial) else {}
    signal = options.get("signal")
    of_signal = set(signal.keywords) if isinstance(signal, partial) else set()
    return (found - {"estimate"}) | set(options) | of_signal if options else found


@pytest.mark.parametrize("variant", VARIANTS, ids=lambda variant: variant.title)
def test_one_thing_is_changed_at_a_time(variant):
    two = {
        "400 iterations, no tolerance": {"tolerance", "most_iterations"},
        "moments about the ground, 400 iterations": {"signal", "most_iterations"},
        "moments about the ground, N and N m as they are": {"signal", "length_m"},
        NEAREST.title: {"signal", "tolerance"},
    }
    if variant.title in two:
        assert changed(variant) == two[variant.title]
    else:
        assert len(changed(variant)) == (variant is not BASE)
    assert TODAY.estimate is table1_guesses.as_today


def test_titles_differ():
    assert len({variant.title for variant in VARIANTS}) == len(VARIANTS)


def test_today_is_table_1_bit_for_bit(trial):
    """What goes into the estimator, noise and all, and the errors of what comes out."""
    seen = []

    def given_back(skeleton, start, windows, correct):
        seen.append((start.table().tobytes(), windows[0].motion.qdd.tobytes(), windows[0].wrench.tobytes(), correct))
        loads = [residual(skeleton, start, windows[0].motion, windows[0].wrench)]
        return TwoLevelResult(start, (), tuple(loads), (2.0, 1.0), 1, True)

    with (
        mock.patch("kinertia.studies.table1.estimate_two_level", given_back),
        mock.patch("kinertia.studies.table1_guesses.estimate_two_level", given_back),
        mock.patch("kinertia.studies.table1_variants.correct_pelvis", lambda skeleton, bsp, window: window.motion),
    ):
        draw = run_draw(trial, 1, 2)
        noisy = run_variant_draw(trial, 1, (TODAY, 2, True))
        clean = run_variant_draw(trial, 1, (TODAY, 2, False))
    default, ours = seen[:4], seen[4:]
    assert ours == [default[1], default[3], default[0], default[2]]
    assert [course.errors for course in noisy] == [draw.errors[condition] for condition in NOISY]
    assert [course.errors.mass_rms_kg for course in clean] == [draw.errors[NOISY[0]].mass_rms_kg] * 2


def test_noise_is_what_its_formula_says(trial):
    """Default unchanged, bit for bit: amplitude, rate and phase are drawn in this order, per marker coordinate."""
    rng, shape = np.random.default_rng(5), trial.markers.positions.shape[1:]
    amplitude, rate, phase = rng.uniform(0, 0.01, shape), rng.uniform(0, 25, shape), rng.uniform(0, 2 * np.pi, shape)
    wanted = trial.markers.positions + amplitude * np.sin(rate * trial.time[:, None, None] + phase)
    for noisy in (study_noise(trial.markers, np.random.default_rng(5)), BASE.noise(trial, np.random.default_rng(5))):
        np.testing.assert_array_equal(noisy.positions, wanted)


def test_noise_per_marker_and_segment(trial):
    def moved(noise):
        return noise(trial, np.random.default_rng(1)).positions - trial.markers.positions

    per_marker, per_segment = moved(table1_guesses.noise_per_marker), moved(table1_guesses.noise_per_segment)
    np.testing.assert_allclose(per_marker, np.repeat(per_marker[..., :1], 3, axis=2), atol=1e-14)
    assert len(np.unique(per_marker[40, :, 0])) == 41
    segments = [marker.segment for marker in trial.skeleton.markers]
    for axis in range(3):
        assert len(np.unique(per_segment[40, :, axis].round(12))) == len(set(segments))
    for a, b in ((0, 1), (10, 11)):
        assert segments[a] == segments[b]
        np.testing.assert_allclose(per_segment[:, a], per_segment[:, b], atol=1e-14)


def test_slower_noise_is_the_same_at_half_the_speed(trial):
    slow = table1_guesses.slower_noise(trial, np.random.default_rng(1)).positions
    half = replace(trial.markers, time=trial.time / 2)
    shape = half.positions.shape[1:]
    np.testing.assert_allclose(slow, displaced(half, shape, np.random.default_rng(1)).positions, atol=1e-12)


def test_moments_about_the_ground(trial, vector, problem):
    """Against the ground reactions that the body asks for; and the derivative, against differences."""
    theta = random_start(vector.values(trial.bsp), np.random.default_rng(1))
    signal = table1_guesses.about_ground(replace(problem, length=0.5))
    missing = balancing_wrench(trial.skeleton, vector.bsp(theta), trial.motion) - trial.window.wrench
    missing[:, 3:] /= 0.5
    as_it_is = table1_guesses.about_ground(replace(problem, length=0.5), length_m=1.0)
    np.testing.assert_allclose(as_it_is.residuals(theta).reshape(-1, 6), missing * [1, 1, 1, 0.5, 0.5, 0.5], atol=1e-8)
    np.testing.assert_allclose(signal.residuals(theta).reshape(-1, 6), missing, atol=1e-8)
    step = np.zeros(49)
    step[8] = 1e-4  # the torso's CoM
    difference = (signal.residuals(theta + step) - signal.residuals(theta - step)) / 2e-4
    np.testing.assert_allclose(signal.jacobian(theta)[:, 8], difference, atol=1e-5)


def test_every_fifth_frame_and_lengths(vector, trial, problem):
    theta = 1.1 * vector.values(trial.bsp)
    every, fifth = problem.residuals(theta).reshape(-1, 6), table1_guesses.every_fifth(problem)
    np.testing.assert_array_equal(fifth.residuals(theta).reshape(-1, 6), every[::5])
    rows = problem.jacobian(theta).reshape(-1, 6, 49)[::5]
    np.testing.assert_array_equal(fifth.jacobian(theta), rows.reshape(-1, 49))
    halved = table1_guesses.with_length(2.0, problem).residuals(theta).reshape(-1, 6)
    np.testing.assert_allclose(halved, every / [1, 1, 1, 2, 2, 2])


def test_starts_differ_where_they_say(vector, trial):
    truth = vector.values(trial.bsp)
    usual, mass, com = (
        start(vector, truth, np.random.default_rng(1)).reshape(-1, 7)
        for start in (BASE.start, table1_guesses.mass_of_scale, table1_guesses.com_by_distance)
    )
    np.testing.assert_array_equal(usual.ravel(), random_start(truth, np.random.default_rng(1)))
    assert vector.bsp(mass.ravel()).total_mass_kg == pytest.approx(trial.bsp.total_mass_kg)
    assert np.ptp(mass[:, 0] / usual[:, 0]) < 1e-12
    np.testing.assert_array_equal(mass[:, 1:], usual[:, 1:])
    np.testing.assert_array_equal(com[:, [0, 4, 5, 6]], usual[:, [0, 4, 5, 6]])
    true = truth.reshape(-1, 7)[:, 1:4]
    off = np.abs(com[:, 1:4] - true) / np.linalg.norm(true, axis=1, keepdims=True)
    assert 0.4 < off.max() <= 0.5
    assert (off > np.abs(usual[:, 1:4] / true - 1.0) - 1e-12).all()


def test_29_markers_still_show_every_coordinate(trial):
    fewer = table1_guesses.fewer_markers(trial)
    assert len(fewer.markers.labels) == 29
    np.testing.assert_array_equal(fewer.motion.q, trial.motion.q)
    few = slice(0, 20)
    markers = replace(fewer.markers, time=fewer.time[few], positions=fewer.markers.positions[few])
    np.testing.assert_allclose(solve_ik(fewer.skeleton, markers).q, trial.motion.q[few], atol=1e-6)


def test_slow_walk_is_consistent(trial):
    slow = table1_guesses.slow_walk(trial)
    assert slow.motion.qd[:, 0].mean() == pytest.approx(1.0, abs=0.02)
    assert np.abs(residual(slow.skeleton, slow.bsp, slow.motion, slow.window.wrench)).max() < 1e-9
    np.testing.assert_array_equal(slow.bsp.table(), trial.bsp.table())


def test_known_variance_moves_coordinates_by_their_errors(trial):
    noisy = BASE.noise(trial, np.random.default_rng(1))
    q = solve_ik(trial.skeleton, noisy).q
    spline = table1_guesses.known_variance(trial, noisy)
    moved, wrong = (np.sqrt(np.square(q - other).mean(axis=0)) for other in (spline(trial.time), trial.motion.q))
    met = np.abs(moved / wrong - 1.0) < 0.05
    assert met.sum() >= 24
    # the others hardly move at all: even the parabola is nearer to them than the truth
    bend = np.abs(spline(trial.time, 3)).max(axis=0)
    assert (moved < wrong)[~met].all()
    assert bend[~met].max(initial=0.0) < 0.1 * np.median(bend)


def test_ends_are_used_where_margins_are_zero(trial):
    time = trial.time
    assert inner_frames(time, 0.0) == slice(0, len(time))
    assert len(time[inner_frames(time, BASE.margin_s)]) == len(time) - 20


@pytest.fixture(scope="module")
def exact(trial, vector):
    """Start and exact window, for the optimiser."""
    start = vector.bsp(random_start(vector.values(trial.bsp), np.random.default_rng(3)))
    inner = inner_frames(trial.time, 0.1)
    return trial.skeleton, start, Window(trial.time[inner], trial.motion.cut(inner), trial.window.wrench[inner])


def test_trust_region_finds_the_truth_without_noise(exact, vector, trial):
    path, costs = trust_region(*exact, False, tolerance=1e-12, most_iterations=400)
    np.testing.assert_array_equal(path[0], vector.values(exact[1]))
    assert (np.diff(costs) <= 0).all()
    assert len(path) == len(costs)
    np.testing.assert_allclose(path[-1], vector.values(trial.bsp), atol=1e-4)


@pytest.mark.slow
def test_options_of_the_optimiser(exact):
    path, costs = trust_region(*exact, True, most_iterations=3)
    assert path.shape == (4, 49)
    differences, _ = trust_region(*exact, True, most_iterations=3, differences=True)
    np.testing.assert_allclose(differences, path, atol=1e-3)
    assert (differences != path)[-1].any()
    for options in ({"scaled": False}, {"subspace": True}):
        other, its_costs = trust_region(*exact, True, most_iterations=3, **options)
        np.testing.assert_array_equal(other[0], path[0])
        assert its_costs[0] == costs[0]
        assert np.abs(other[-1] - path[-1]).max() > 1e-3
    tight, loose = (trust_region(*exact, False, tolerance=tolerance)[0] for tolerance in (1e-9, 1e-2))
    assert len(loose) < len(tight) <= 101
    np.testing.assert_array_equal(loose, tight[: len(loose)])


def course(factor, condition):
    return Course(
        Errors(*(factor * np.array(astuple(PUBLISHED[condition]))).tolist()), np.ones((3, 3)), np.array([9.0, 3.0, 2.9])
    )


def test_results_of_a_variant():
    pairs = [tuple(course(factor, condition) for condition in NOISY) for factor in (1.0, 3.0)]
    result = VariantResult(BASE, pairs[0], tuple(pairs))
    assert result.distance == pytest.approx(2.0)
    assert result.mean(True).mass_rms_kg == pytest.approx(2 * 1.71)
    assert result.helped == dict.fromkeys(CLASSES, 1.0)
    worse = tuple((b, replace(a, errors=replace(a.errors, com_rms_m=9.0))) for a, b in pairs)
    assert VariantResult(BASE, pairs[0], worse).helped["CoM"] == 0.0
    assert pairs[0][0].stopped_by(0.5) == 2
    assert pairs[0][0].stopped_by(1e-9) == 2
    assert pairs[0][0].stopped_by(0.9) == 1


def test_draws_of_variants(trial):
    """Their number, and that they depend on nothing but seed and number."""
    still = partial(trust_region, most_iterations=1)
    variants = (Variant("a", still), Variant("b", still, share=0.5))
    with in_one_process():
        a, b = run_variants(trial, variants, repeats=2)
        (again,) = run_variants(trial, variants[1:], repeats=2)
    assert [len(result.draws) for result in (a, b)] == [2, 1]
    assert a.draws[0][1].errors == b.draws[0][1].errors == again.draws[0][1].errors
    assert a.draws[0][1].errors != a.draws[1][1].errors
    assert a.clean[0].errors != a.draws[0][0].errors
