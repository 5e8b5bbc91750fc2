from dataclasses import replace

import numpy as np
import pytest

import kinertia.estimation.simultaneous.solver as simultaneous
from kinertia.estimation.prior import literature_prior, with_symmetry
from kinertia.estimation.simultaneous.instruments.plates import FLOOR_UNKNOWNS
from kinertia.estimation.simultaneous.instruments.priors import InstrumentPrior
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.mixture_prior import FaultMixture
from kinertia.estimation.simultaneous.observation import CalibrationPrior, Observation
from kinertia.estimation.simultaneous.solver import estimate_simultaneous
from kinertia.model.bsp import BodySegmentParameters
from kinertia.motion.smoothing import smooth
from kinertia.synthetic.walk import SyntheticTrial, unlike_literature, walk, walking_subject
from small_problem import one_plate_per_foot
from validation.calibration_errors import DISTURBANCES, calibrated

SPACING_S = 0.05
PLATES = {"x": 0.005, "z": 0.005, "gain": 0.02, "free moment": 0.001, "turn": 0.002}
EXACT = FaultMixture.certain(1e-9)


@pytest.fixture(scope="module")
def person():
    return unlike_literature(walking_subject(), np.random.default_rng(3))


@pytest.fixture(scope="module")
def prior(person):
    return literature_prior(person.literature)


@pytest.fixture(scope="module")
def trial(person):
    return walk(person, 0.8, 60.0, trapezoid=False)


@pytest.fixture(scope="module")
def calibration(trial):
    plates, clock = {name: FaultMixture.certain(sd) for name, sd in PLATES.items()}, FaultMixture.certain(0.005)
    return CalibrationPrior(
        {},
        np.full(len(trial.skeleton.markers), 0.005),
        InstrumentPrior(plates, dict.fromkeys(FLOOR_UNKNOWNS, EXACT), clock),
    )


def observation(trial: SyntheticTrial, frames: slice = slice(None), noise_m: float = 0.0, seed: int = 0) -> Observation:
    """Exact forces, markers with white noise, and a start that is the truth."""
    rng = np.random.default_rng(seed)
    time, loads = trial.time, trial.foot_loads.reshape(len(trial.time), 12)
    markers = trial.markers.positions + rng.normal(0.0, noise_m, trial.markers.positions.shape) if noise_m else None
    markers = trial.markers.positions if markers is None else markers
    return Observation(
        time=time[frames],
        markers=markers[frames],
        marker_sd=np.full(markers.shape[1], max(noise_m, 0.001)),
        marker_frames=1.0,
        q=trial.motion.q[frames],
        spacing_s=SPACING_S,
        dynamic=np.ones(len(time[frames]), dtype=bool),
        ground=one_plate_per_foot(smooth(time, loads, 25.0), len(time[frames])),
        force_sd=3.0,
        moment_sd=1.0,
    )


@pytest.fixture(scope="module")
def exact(trial, prior, calibration):
    return estimate_simultaneous(trial.skeleton, prior, calibration, [observation(trial)])


def test_exact_data_give_back_the_motion(trial, exact):
    """As well as splines of this spacing can say it."""
    basis = MotionBasis(trial.time, SPACING_S)
    best = basis.evaluate(basis.fit(trial.motion.q))[0]
    limit = np.abs(best - trial.motion.q).max()
    assert exact.converged
    assert exact.cost[1] < min(5.0, 0.05 * exact.cost[0])
    inner = slice(6, -6)
    angles = trial.skeleton.rotational
    off = np.abs(exact.motions[0].q - trial.motion.q)[inner]
    assert off[:, ~angles].max() < limit + 0.001
    assert np.sqrt(np.mean(np.square(off[:, angles]))) < limit + 0.01


def test_exact_data_pull_the_body_towards_the_truth(person, prior, exact):
    before, after = (person.bsp.table() - bsp.table() for bsp in (prior.mean, exact.bsp))
    assert np.square(after / prior.sd).sum() < np.square(before / prior.sd).sum()
    assert np.square(after[:, 0]).sum() < 0.5 * np.square(before[:, 0]).sum()
    sd = np.sqrt(np.diag(exact.bsp_covariance)).reshape(-1, 10)
    assert (sd < prior.sd * (1.0 + 1e-9)).all()
    assert np.abs((person.bsp.table() - exact.bsp.table()) / sd).max() < 4.0
    assert exact.bsp.total_mass_kg == pytest.approx(person.bsp.total_mass_kg, rel=0.005)


@pytest.mark.parametrize("with_draws", [True, False])
def test_same_input_same_result(trial, prior, calibration, exact, with_draws):
    again = estimate_simultaneous(
        trial.skeleton, prior, calibration, [observation(trial)], with_draws=with_draws
    ).of_first(1)
    assert (again.draws is not None) == with_draws
    if with_draws:
        np.testing.assert_array_equal(again.draws.trials[0].coefficients, exact.draws.trials[0].coefficients)
    np.testing.assert_array_equal(again.bsp.table(), exact.bsp.table())
    np.testing.assert_array_equal(again.bsp_covariance, exact.bsp_covariance)
    np.testing.assert_array_equal(again.curve_deviations[0].moments, exact.curve_deviations[0].moments)
    np.testing.assert_array_equal(again.motions[0].q, exact.motions[0].q)
    assert again.cost == exact.cost


def test_progress_rises_with_every_step(trial, prior, calibration):
    shares = []
    far = observation(trial, noise_m=0.005)
    result = estimate_simultaneous(trial.skeleton, prior, calibration, [far], shares.append)
    assert len(shares) == result.iterations
    assert shares == sorted(set(shares))
    assert 0.0 < shares[0] <= shares[-1] < 1.0


def test_two_trials_tell_more_than_either(trial, prior, calibration):
    first, second = (observation(trial, noise_m=0.003, seed=seed) for seed in (1, 2))

    def deviation(trials):
        result = estimate_simultaneous(trial.skeleton, prior, calibration, trials)
        return np.sqrt(np.diag(result.bsp_covariance))

    both = deviation([first, second])
    for alone in (first, second):
        ratio = both / deviation([alone])
        assert ratio.max() < 1.02
        assert ratio.mean() < 0.99


@pytest.mark.slow
def test_markers_displaced_in_one_trial_are_found_and_hurt_nothing(trial, prior, calibration):
    """Thigh markers 10 mm forward in the second of two trials: without displacements of its own, it bends the first."""
    first, second = (observation(trial, noise_m=0.001, seed=seed) for seed in (1, 2))
    thighs = np.isin(trial.skeleton.marker_segments, [trial.skeleton.segments.index(f"thigh_{s}") for s in "rl"])
    moved_m = np.where(thighs[:, None], [0.01, 0.0, 0.0], 0.0)
    turned = trial.skeleton.pose(trial.motion.q).rotation[:, trial.skeleton.marker_segments]
    second = replace(second, markers=second.markers + (turned @ moved_m[..., None])[..., 0])

    def estimate(sd_m):
        trials = [replace(seen_trial, displacement_sd_m=np.where(thighs, sd_m, 0.0)) for seen_trial in (first, second)]
        return estimate_simultaneous(trial.skeleton, prior, calibration, trials)

    free, stiff = estimate(0.01), estimate(0.0)
    assert free.converged
    apart = free.marker_offsets_m[1] - free.marker_offsets_m[0]
    assert apart[thighs].mean(axis=0) == pytest.approx([0.01, 0.0, 0.0], abs=0.003)
    assert not apart[~thighs].any()
    assert not np.any(stiff.marker_offsets_m)
    assert free.cost[1] < 0.9 * stiff.cost[1]
    hips = [i for i, name in enumerate(trial.skeleton.coordinates) if name.startswith("hip_flexion")]
    off = [np.abs(result.motions[0].q - trial.motion.q)[:, hips].mean() for result in (free, stiff)]
    assert off[0] < 0.5 * off[1]


@pytest.mark.slow
def test_halves_pooled_give_about_the_whole(person, prior, calibration):
    trial = walk(person, 1.6, 60.0, trapezoid=False)
    middle = len(trial.time) // 2
    halves = [observation(trial, part, 0.003) for part in (slice(None, middle), slice(middle, None))]
    whole, pooled = (
        estimate_simultaneous(trial.skeleton, prior, calibration, trials)
        for trials in ([observation(trial, noise_m=0.003)], halves)
    )
    sd = np.sqrt(np.diag(whole.bsp_covariance)).reshape(-1, 10)
    away = (pooled.bsp.table() - whole.bsp.table()) / sd
    assert np.sqrt(np.mean(np.square(away))) < 0.3
    assert np.abs(away).max() < 1.0
    assert (np.sqrt(np.diag(pooled.bsp_covariance)) / sd.ravel()).mean() == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name != "all three")) for name in DISTURBANCES]
)
def test_what_was_put_in_comes_back_within_its_error_bars(name):
    recovered = calibrated(DISTURBANCES[name], seed=1, duration_s=1.3, compare=False)
    for quantity, (error, sd) in recovered.deviations.items():
        assert abs(error) < 3.0 * sd, quantity
        assert sd < 0.75 * {"delay": 0.010, "right plate, x": 0.020}.get(quantity, 0.010), quantity


def test_without_forces_only_markers_count(trial, prior, calibration):
    """A body and instruments that no equation of motion asks about stay as they were believed to be."""
    dynamic = np.zeros(len(trial.time), dtype=bool)
    seen = replace(observation(trial, noise_m=0.003), dynamic=dynamic)
    result = estimate_simultaneous(trial.skeleton, prior, calibration, [seen])
    np.testing.assert_allclose(result.bsp.table(), prior.mean.table(), rtol=0, atol=1e-6)
    errors = [entry for entry in result.calibration if entry.kind in ("plate", "synchronisation")]
    assert {error.kind for error in errors} == {"plate", "synchronisation"}
    for error in errors:
        assert (error.value, error.sd) == (pytest.approx(0.0, abs=1e-9), pytest.approx(error.prior_sd))
    np.testing.assert_allclose(result.motions[0].q[6:-6], trial.motion.q[6:-6], atol=0.08)


def test_wrong_forces_in_unmeasured_frames_do_not_matter(trial, prior, calibration):
    seen = observation(trial, noise_m=0.003)
    seen = replace(seen, dynamic=np.arange(len(trial.time)) < 24)
    loads = trial.foot_loads.reshape(len(trial.time), 12).copy()
    cut = smooth(trial.time[:28], loads[:28], 25.0)
    results = [
        estimate_simultaneous(
            trial.skeleton, prior, calibration, [replace(seen, ground=replace(seen.ground, loads=part))]
        )
        for part in (cut, smooth(trial.time, np.where(np.arange(len(loads))[:, None] < 28, loads, 0.0), 1e6))
    ]
    away = (results[0].bsp.table() - results[1].bsp.table()) / prior.sd
    assert np.abs(away).max() < 0.1


@pytest.mark.slow
def test_impossible_priors_still_give_a_possible_body(trial, prior, calibration):
    table = prior.mean.table()
    table[:, 4] *= 3.0
    impossible = BodySegmentParameters.from_table(prior.mean.segments, table)
    assert not impossible.physically_consistent().all()
    start = replace(prior, mean=impossible)
    result = estimate_simultaneous(trial.skeleton, start, calibration, [observation(trial)])
    assert result.bsp.physically_consistent().all()


def test_an_unfinished_run_says_so_and_keeps_the_best_iterate(trial, prior, calibration, monkeypatch):
    monkeypatch.setattr(simultaneous, "_MAX_ITERATIONS", 2)
    result = estimate_simultaneous(trial.skeleton, prior, calibration, [observation(trial, noise_m=0.003)])
    assert not result.converged
    assert result.iterations == 2
    assert result.cost[1] < result.cost[0]


def test_what_lies_between_two_optima_is_no_estimate(trial, prior, calibration, exact, monkeypatch):
    """With other knots all masses are three times as large; half of the way there nothing fits. The distance is in the
    deviations.
    """

    def elsewhere(problem, point, adapted):
        static = point.static.copy()
        static[problem.layout["bsp"]][::10] += np.log(3.0)
        return replace(point, static=static)

    monkeypatch.setattr(simultaneous, "_continued", elsewhere)
    result = estimate_simultaneous(trial.skeleton, prior, calibration, [observation(trial)])
    sd_kg = np.sqrt(np.diag(exact.bsp_covariance))[::10]
    assert np.abs((result.bsp.mass_kg - exact.bsp.mass_kg) / sd_kg).max() < 0.5
    assert np.abs(result.motions[0].q - exact.motions[0].q).max() < 0.01
    assert result.bsp_covariance[0, 0] > exact.bsp_covariance[0, 0]


def test_deviations_of_every_size_have_a_covariance(trial, prior, calibration):
    """Products of inertia known to 1e-7 kg m2 beside masses known to 1 kg: data only ever lower a deviation."""
    sd = prior.sd.copy()
    sd[:, 7:] = 1e-7
    covariance = with_symmetry(np.diag(np.square(sd.ravel())), prior.mean.segments, 0.9999)
    seen = observation(trial, noise_m=0.003)
    result = estimate_simultaneous(trial.skeleton, replace(prior, covariance=covariance), calibration, [seen])
    posterior_sd = np.sqrt(np.diag(result.bsp_covariance)).reshape(-1, 10)
    assert (posterior_sd > 0).all()
    assert (posterior_sd <= sd * 1.001).all()
