from dataclasses import astuple, fields, replace
from functools import partial

import numpy as np
import pytest

from kinertia.estimation.identifiability import ParameterVector
from kinertia.estimation.two_level import TwoLevelProblem, Window
from kinertia.motion.dynamics import residual
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.studies import table1_variants
from kinertia.studies.table1 import (
    CONDITIONS,
    PUBLISHED,
    TODAY,
    Draw,
    Errors,
    Setup,
    Table1,
    coordinates,
    random_start,
    run_draw,
    study_trial,
    two_level,
)
from kinertia.studies.table1_variants import (
    BASE,
    CLASSES,
    NOISY,
    VARIANTS,
    Variant,
    distance,
    error_signal,
    helped,
    run_variants,
    stopped_by,
    trust_region,
)
from kinertia.synthetic.laboratory import camera_noise, displaced, study_noise
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
    """Uncorrected, without noise, so that the residual is linear in the masses; moments divided by 0.5 m."""
    return TwoLevelProblem(trial.skeleton, vector, [trial.window], False, 0.5)


def changed(variant):
    """What differs from the base: steps of the set-up, options of the trust region method, the trial."""
    setup, base = variant.setup, VARIANTS[BASE].setup
    steps = {f.name for f in fields(Setup)} - {"estimate"}
    different = {name for name in steps if getattr(setup, name) != getattr(base, name)}
    different |= {"trial"} if variant.trial is not study_trial else set()
    if isinstance(setup.estimate, partial):
        assert setup.estimate.func is trust_region
        return different | set(setup.estimate.keywords)
    return different | ({"estimate"} if setup.estimate is not trust_region else set())


@pytest.mark.parametrize("title", VARIANTS)
def test_one_thing_is_changed_at_a_time(title):
    """Several only where the title says so."""
    assert len(changed(VARIANTS[title])) == (title != BASE) + ("ground, " in title)


def test_today_is_table_1():
    assert VARIANTS["today's set-up"] == Variant(TODAY) == Variant(Setup())
    assert Setup() == Setup(random_start, Setup().noise, coordinates, 0.1, two_level)


@pytest.mark.slow
def test_every_variant_has_ten_draws_and_the_nearest_fifty(trial, monkeypatch):
    counted = {}

    def counted_only(task, cases, progress):
        for trial, _, number, setup, conditions in cases:
            assert set(NOISY) <= set(conditions)
            assert (set(conditions) == set(CONDITIONS)) == (number == 0)
            counted.setdefault((id(trial), setup), []).append(number)
        raise InterruptedError

    monkeypatch.setattr("kinertia.studies.table1_variants.in_parallel", counted_only)
    with pytest.raises(InterruptedError):
        run_variants(measured=trial)
    assert len(counted) == len(VARIANTS) + 2
    *others, nearest = [counted[key] for key in list(counted)[: len(VARIANTS)]]
    assert all(numbers == list(range(10)) for numbers in [*others, *list(counted.values())[len(VARIANTS) :]])
    assert nearest == list(range(50))


def test_noise_is_what_its_formula_says(trial):
    """Default unchanged, bit for bit: amplitude, rate and phase are drawn in this order, per marker coordinate."""
    rng, shape = np.random.default_rng(5), trial.markers.positions.shape[1:]
    amplitude, rate, phase = rng.uniform(0, 0.01, shape), rng.uniform(0, 25, shape), rng.uniform(0, 2 * np.pi, shape)
    wanted = trial.markers.positions + amplitude * np.sin(rate * trial.time[:, None, None] + phase)
    for noisy in (study_noise(trial.markers, np.random.default_rng(5)), TODAY.noise(trial, np.random.default_rng(5))):
        np.testing.assert_array_equal(noisy.positions, wanted)


def test_noise_per_marker_and_segment(trial):
    def moved(noise):
        return noise(trial, np.random.default_rng(1)).positions - trial.markers.positions

    per_marker, per_segment = moved(table1_variants.noise_per_marker), moved(table1_variants.noise_per_segment)
    np.testing.assert_allclose(per_marker, np.repeat(per_marker[..., :1], 3, axis=2), atol=1e-14)
    assert len(np.unique(per_marker[40, :, 0])) == 41
    segments = [marker.segment for marker in trial.skeleton.markers]
    for axis in range(3):
        assert len(np.unique(per_segment[40, :, axis].round(12))) == len(set(segments))
    for a, b in ((0, 1), (10, 11)):
        assert segments[a] == segments[b]
        np.testing.assert_allclose(per_segment[:, a], per_segment[:, b], atol=1e-14)


def test_slower_noise_is_the_same_at_half_the_speed(trial):
    slow = table1_variants.slower_noise(trial, np.random.default_rng(1)).positions
    half = replace(trial.markers, time=trial.time / 2)
    shape = half.positions.shape[1:]
    np.testing.assert_allclose(slow, displaced(half, shape, np.random.default_rng(1)).positions, atol=1e-12)


def test_moments_about_the_ground(trial, vector, problem):
    """Against the ground reactions that the body asks for; and the derivative, against differences."""
    theta = random_start(vector, np.random.default_rng(1))
    residuals, jacobian = error_signal(problem, about_ground=True, every=1)
    missing = balancing_wrench(trial.skeleton, vector.bsp(theta), trial.motion) - trial.window.wrench
    np.testing.assert_allclose(residuals(theta).reshape(-1, 6), missing / [1, 1, 1, 0.5, 0.5, 0.5], atol=1e-8)
    step = np.zeros(49)
    step[8] = 1e-4  # the torso's CoM
    difference = (residuals(theta + step) - residuals(theta - step)) / 2e-4
    np.testing.assert_allclose(jacobian(theta)[:, 8], difference, atol=1e-5)


def test_every_fifth_frame(vector, problem):
    theta = 1.1 * vector.values(vector.reference)
    residuals, jacobian = error_signal(problem, about_ground=False, every=5)
    np.testing.assert_array_equal(residuals(theta).reshape(-1, 6), problem.residuals(theta).reshape(-1, 6)[::5])
    rows = problem.jacobian(theta).reshape(-1, 6, 49)[::5]
    np.testing.assert_array_equal(jacobian(theta), rows.reshape(-1, 49))


def test_starts_differ_where_they_say(vector, trial):
    truth = vector.values(trial.bsp)
    usual, mass, com = (
        start(vector, np.random.default_rng(1)).reshape(-1, 7)
        for start in (TODAY.start, table1_variants.mass_of_scale, table1_variants.com_by_distance)
    )
    assert 0.4 < np.abs(usual.ravel() / truth - 1.0).max() <= 0.5
    assert vector.bsp(mass.ravel()).total_mass_kg == pytest.approx(trial.bsp.total_mass_kg)
    assert np.ptp(mass[:, 0] / usual[:, 0]) < 1e-12
    np.testing.assert_array_equal(mass[:, 1:], usual[:, 1:])
    np.testing.assert_array_equal(com[:, [0, 4, 5, 6]], usual[:, [0, 4, 5, 6]])
    true = truth.reshape(-1, 7)[:, 1:4]
    off = np.abs(com[:, 1:4] - true) / np.linalg.norm(true, axis=1, keepdims=True)
    assert 0.4 < off.max() <= 0.5
    assert (off > np.abs(usual[:, 1:4] / true - 1.0) - 1e-12).all()


def test_29_markers_still_show_every_coordinate(trial):
    fewer = table1_variants.fewer_markers()
    assert len(fewer.markers.labels) == 29
    np.testing.assert_array_equal(fewer.motion.q, trial.motion.q)
    few = slice(0, 20)
    markers = replace(fewer.markers, time=fewer.time[few], positions=fewer.markers.positions[few])
    np.testing.assert_allclose(solve_ik(fewer.skeleton, markers).q, trial.motion.q[few], atol=1e-6)


def test_slow_walk_is_consistent(trial):
    slow = VARIANTS["the same walk at 1 m/s"].trial()
    assert slow.motion.qd[:, 0].mean() == pytest.approx(1.0, abs=0.02)
    assert np.abs(residual(slow.skeleton, slow.bsp, slow.motion, slow.window.wrench)).max() < 1e-9
    np.testing.assert_array_equal(slow.bsp.table(), trial.bsp.table())


def test_centres_of_mass_on_the_axes(trial):
    on_axes = VARIANTS["CoMs on the segments' axes"].trial()
    np.testing.assert_array_equal(on_axes.bsp.com_m, trial.bsp.com_m * [0, 1, 0])
    np.testing.assert_array_equal(on_axes.bsp.mass_kg, trial.bsp.mass_kg)
    assert np.abs(residual(on_axes.skeleton, on_axes.bsp, on_axes.motion, on_axes.window.wrench)).max() < 1e-9


def test_known_variance_finds_the_cutoffs_of_gcv_where_errors_are_independent(trial):
    """Then both are estimates of the same least error."""
    noisy = camera_noise(trial.markers, 0.003, np.random.default_rng(1))
    known, gcv = (smoothed(trial, noisy) for smoothed in (table1_variants.known_variance, coordinates))
    raw = solve_ik(trial.skeleton, noisy).q
    off, off_gcv, off_raw = (
        np.sqrt(np.square(q - trial.motion.q).mean(axis=0)) for q in (known(trial.time), gcv(trial.time), raw)
    )
    assert (off < 0.7 * off_raw).all()
    assert np.median(off / off_gcv) == pytest.approx(1.0, abs=0.05)


@pytest.fixture(scope="module")
def exact(trial, vector):
    """Start and exact window, for the optimiser."""
    start = vector.bsp(random_start(vector, np.random.default_rng(3)))
    inner = slice(10, len(trial.time) - 10)
    return trial.skeleton, start, Window(trial.time[inner], trial.motion.cut(inner), trial.window.wrench[inner])


def test_trust_region_finds_the_truth_without_noise(exact, vector, trial):
    path, costs, converged = trust_region(*exact, False, tolerance=1e-12, most_iterations=400)
    assert converged
    np.testing.assert_array_equal(path[0], vector.values(exact[1]))
    assert (np.diff(costs) <= 0).all()
    assert len(path) == len(costs)
    np.testing.assert_allclose(path[-1], vector.values(trial.bsp), atol=1e-4)


@pytest.mark.slow
def test_options_of_the_optimiser(exact):
    path, costs, converged = trust_region(*exact, True, most_iterations=3)
    assert path.shape == (4, 49)
    assert not converged
    differences, *_ = trust_region(*exact, True, most_iterations=3, differences=True)
    np.testing.assert_allclose(differences, path, atol=1e-3)
    assert (differences != path)[-1].any()
    for options in ({"scaled": False}, {"subspace": True}):
        other, its_costs, _ = trust_region(*exact, True, most_iterations=3, **options)
        np.testing.assert_array_equal(other[0], path[0])
        assert its_costs[0] == costs[0]
        assert np.abs(other[-1] - path[-1]).max() > 1e-3
    tight, loose = (trust_region(*exact, False, tolerance=tolerance)[0] for tolerance in (1e-9, 1e-2))
    assert len(loose) < len(tight) <= 101
    np.testing.assert_array_equal(loose, tight[: len(loose)])


def table(*draws):
    return Table1(("a",) * 49, np.ones(49), draws, 1, "walk")


def draw(number, factor):
    errors = {c: Errors(*(factor * np.array(astuple(PUBLISHED[c]))).tolist()) for c in NOISY}
    return Draw(number, errors, {}, {}, {})


def test_measures_of_a_table():
    first, three = draw(0, 1.0), draw(1, 3.0)
    assert distance(table(first, three)) == pytest.approx(2.0)
    assert helped(table(first, three)) == dict.fromkeys(CLASSES, 1.0)
    worse = replace(first.errors["correction_noise"], com_rms_m=9.0)
    worse = replace(first, errors={**first.errors, "correction_noise": worse})
    assert helped(table(worse, three)) == {"inertia": 1.0, "mass": 1.0, "CoM": 0.5}


def test_where_a_tolerance_stops():
    costs = np.array([9.0, 3.0, 2.9])
    assert stopped_by(costs, 0.5) == 2
    assert stopped_by(costs, 1e-9) == 2
    assert stopped_by(costs, 0.9) == 1


@pytest.mark.slow
def test_draws_of_variants(trial):
    """Their number, and that they depend on nothing but seed and number, like those of Table 1."""
    still = Setup(estimate=partial(trust_region, most_iterations=1))
    with in_one_process():
        results = run_variants(variants={"a": Variant(still), "b": Variant(still, times=2)}, repeats=1)
        (again,) = run_variants(variants={"c": Variant(still)}, repeats=1).values()
    a, b = results["a"], results["b"]
    assert [len(variant.draws) for variant in (a, b)] == [1, 2]
    alone = run_draw(trial, 1, 0, still)
    for variant in (a, b, again):
        assert variant.draws[0].errors == alone.errors
    assert list(a.draws[0].errors) == list(CONDITIONS)
    assert list(b.draws[1].errors) == list(NOISY)
    assert b.draws[1].errors[NOISY[1]] != alone.errors[NOISY[1]]


def test_ends_are_used_where_margins_are_zero(trial):
    seen = []

    def seen_only(skeleton, start, window, correct):
        seen.append(len(window.time))
        return np.ones((1, 49)), np.ones(1), True

    for margin_s in (0.1, VARIANTS["ends of the record too"].setup.margin_s):
        run_draw(trial, 1, 0, Setup(estimate=seen_only, margin_s=margin_s), NOISY[:1])
    assert seen == [len(trial.time) - 20, len(trial.time)]
