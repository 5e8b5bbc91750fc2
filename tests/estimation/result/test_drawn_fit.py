"""Draws from the posterior spread as the error bars say, and each is one possible person and motion."""

from itertools import pairwise

import numpy as np
import pytest

from kinertia.errors import KinertiaError
from kinertia.estimation.result.drawn_fit import chosen_draws, drawn_fit, drawn_reactions, kept_draws
from kinertia.estimation.simultaneous.instruments.instrument_errors import GAIN as GAIN_OF_PLATE
from kinertia.estimation.simultaneous.instruments.plates import GAIN, corrected_loads
from kinertia.estimation.simultaneous.instruments.priors import GAIT27_UNCERTAINTY
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.uncertainty import posterior_draws
from kinertia.estimation.simultaneous.uncertainty.model_errors import fixed_axes, placement
from kinertia.estimation.simultaneous.uncertainty.posterior_draws import TrialDraws
from kinertia.motion.dynamics import inverse_dynamics
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.joint_moments import body_joints
from kinertia.report.exports.files import write_draws
from kinertia.report.exports.saved_fit import load_fit, write_fit
from kinertia.workflow.from_files import prepare_subject

SYSTEMATIC = 0.10
"""Of reported deviations, which are linear in all unknowns but the delay; draws are not."""


def sampling(count: int) -> float:
    """Two deviations of the deviation of so many normal numbers."""
    return 2.0 / np.sqrt(2.0 * count)


def spread_over_reported(moments: np.ndarray, trial) -> np.ndarray:
    """(j,) RMS deviation over time of drawn joint moments (n, w, c), over the reported one; without the root.

    Draws have the axes of the estimate, fixed where there is one walk.
    """
    loads, joints, curves = trial.joint_loads["estimate"], body_joints(trial.skeleton), trial.joint_curves
    start = int(np.argmin(np.abs(curves.time - trial.time[0])))
    moments_3d = curves.joints["estimate"].moments[start : start + len(loads)]
    by_joint = np.concatenate([moments_3d, np.zeros_like(moments_3d)], axis=2).reshape(len(loads), -1)
    axes = fixed_axes(trial.skeleton, joints, by_joint, loads, GAIT27_UNCERTAINTY.with_fixed_axes().fixed_axes)
    drawn = np.square(moments - loads).mean(axis=(0, 1))
    reported = (np.square(trial.deviations.moments) - axes).mean(axis=0)
    return np.sqrt(drawn / reported)[6:]


@pytest.fixture(scope="module")
def drawn(fit):
    return [drawn_fit(fit, number) for number in range(kept_draws(fit).count)]


def test_joint_moments_spread_as_reported(fit, drawn):
    (trial,) = fit.trials
    moments = np.array([draw.trials[0].joint_loads["estimate"] for draw in drawn])
    ratio = spread_over_reported(moments, trial)
    np.testing.assert_allclose(ratio, 1.0, atol=SYSTEMATIC + sampling(len(drawn)))
    assert np.median(ratio) == pytest.approx(1.0, abs=SYSTEMATIC)


@pytest.fixture(scope="module")
def not_drawn(demo_run):
    """(w, c) variances of angles by the placement of markers and axes, which are in draws as in the estimate."""
    demo, _ = demo_run
    (trial,), known = demo.fit.trials, prepare_subject(demo.subject_file).uncertainty
    assert known.fixed_axes
    misplaced_m = np.array([known.misplaced_m(marker.segment) for marker in trial.skeleton.markers])
    seen = np.ones((len(trial.motion.q), len(misplaced_m)), dtype=bool)
    return placement(trial.skeleton, trial.motion.q, seen, misplaced_m, known.fixed_axes)


def test_angles_and_parameters_spread_as_reported(fit, drawn, not_drawn):
    (trial,) = fit.trials
    q = np.array([draw.trials[0].motion.q for draw in drawn]) - trial.motion.q
    reported = np.square(trial.deviations.coordinates) - not_drawn
    ratio = np.sqrt(np.square(q).mean(axis=(0, 1)) / reported.mean(axis=0))
    np.testing.assert_allclose(ratio, 1.0, atol=SYSTEMATIC + sampling(len(drawn)))
    mass = np.array([draw.estimate.mass_kg for draw in drawn])
    np.testing.assert_allclose(mass.std(axis=0), fit.posterior.sd[:, 0], rtol=SYSTEMATIC + sampling(len(drawn)))
    assert mass.sum(axis=1).std() < 0.5, "the scale knows the sum"
    assert all(draw.estimate.physically_consistent().all() for draw in drawn)


def test_errors_of_plates_spread_as_reported(fit):
    """Gains of force plates, which are drawn together with everything else."""
    draws = kept_draws(fit)
    reported = {entry.plate: entry.sd for entry in fit.posterior.calibration if entry.quantity == GAIN_OF_PLATE}
    gains = draws.trials[0].plates[:, :, GAIN]
    assert len(reported) == gains.shape[1]
    np.testing.assert_allclose(gains.std(axis=0), [*reported.values()], rtol=SYSTEMATIC + sampling(len(gains)))


def test_parts_of_a_draw_belong_together(fit, drawn):
    """Residuals of the pelvis are larger where the body is of one draw and motion and forces of another."""
    time = fit.trials[0].time

    def residual(body, moved) -> float:
        (trial,) = moved.trials
        loads = inverse_dynamics(trial.skeleton, body.estimate, trial.motion, trial.reactions.at(time))
        return float(np.square(loads[:, :6]).mean())

    together = [residual(draw, draw) for draw in drawn[:60]]
    mixed = [residual(draw, other) for draw, other in pairwise(drawn[:61])]
    assert np.mean(mixed) > 1.5 * np.mean(together)


def test_a_seed_chooses_draws(fit):
    count = kept_draws(fit).count
    assert chosen_draws(fit, 3) == [0, 1, 2]
    assert chosen_draws(fit, 10, 5) == chosen_draws(fit, 10, 5) != chosen_draws(fit, 10, 6)
    assert sorted(chosen_draws(fit, count, 7)) == list(range(count))
    with pytest.raises(KinertiaError, match=f"this result keeps {count}"):
        chosen_draws(fit, count + 1)


def test_two_level_has_nothing_to_draw_from(two_level):
    with pytest.raises(KinertiaError, match="no error bars"):
        drawn_fit(two_level, 0)


def test_a_saved_fit_draws_the_same(fit, drawn, tmp_path):
    write_fit(fit, None, tmp_path / "fit.npz")
    again = drawn_fit(load_fit(tmp_path), 4)
    np.testing.assert_array_equal(again.estimate.table(), drawn[4].estimate.table())
    np.testing.assert_array_equal(again.trials[0].trajectory, drawn[4].trials[0].trajectory)


def test_kept_draws_are_bounded():
    kept = posterior_draws._kept
    assert kept(1000) == posterior_draws.MOST_DRAWS
    assert kept(60_000) * 4 * 60_000 <= posterior_draws.MOST_BYTES
    assert kept(10_000_000) == posterior_draws.FEWEST_DRAWS


def test_what_all_trials_share_is_the_same_in_each():
    random = np.random.default_rng(1)
    root, turn = np.tril(random.standard_normal((5, 5))), np.linalg.qr(random.standard_normal((3, 3)))[0]
    other = root.copy()
    other[:3, :3] = root[:3, :3] @ turn  # another root of the same covariance
    normal = random.standard_normal((7, 5))
    shared = posterior_draws._in_trial(normal @ root.T, normal, other, 3)
    np.testing.assert_allclose(shared[:, :3], (normal @ root.T)[:, :3])


@pytest.mark.parametrize("shares", [(0.4, 0.4, 0.4), (1.0, 0.8, 0.4), (0.2, 0.25, 0.3)])
def test_places_rates_and_accelerations_are_narrowed_by_their_own_shares(shares):
    """Of splines with coefficients that go on for some knots."""
    basis, alone = _curves(6.0)
    narrowed = alone.copy()
    posterior_draws._narrow(narrowed, np.array(shares), basis)
    inner = slice(30, -30)
    for order, share in enumerate(shares):
        before, after = (
            np.mean([np.square(basis.evaluate(draws_of_motion)[order][inner]).mean() for draws_of_motion in some])
            for some in (alone, narrowed)
        )
        assert after / before == pytest.approx(share, rel=0.15)


def test_splines_of_few_frames_do_not_leak_into_others():
    """They are hundreds of times larger; deviations of draws in the last frames were 1.4 times those reported."""
    basis, alone = _curves(5.96)
    loose = alone.copy()
    loose[:, -1] *= 400.0
    for motions in (alone, loose):
        posterior_draws._narrow(motions, np.array([1.0, 0.8, 0.4]), basis)
    last = basis.evaluate(np.square(loose - alone).mean(axis=0), slice(-80, -20))[0]
    assert last.max() < 0.01 * np.square(alone).mean()


def _curves(end_s):
    """Splines over frames of 100 Hz up to this time, and coefficients that go on for some knots."""
    random = np.random.default_rng(2)
    time = np.arange(0.0, end_s, 0.01)
    basis = MotionBasis(time, 0.05, part=slice(0, 551))
    white = random.standard_normal((100, basis.size + 1, 2))
    return basis, white[:, 1:] + 0.6 * white[:, :-1]


@pytest.mark.slow
@pytest.mark.first
def test_opensim_finds_the_reported_deviations_on_all_draws(opensim, fit, tmp_path):
    from osim_tools import inverse_dynamics_tool

    (trial,), count = fit.trials, kept_draws(fit).count
    write_draws(fit, tmp_path, count)
    folders = sorted(tmp_path.glob("draw_*"))
    assert len(folders) == count
    names = trial.kinematics.ik.coordinates
    rotational = fit.skeleton.rotational
    columns = [f"{name}_{'moment' if turn else 'force'}" for name, turn in zip(names, rotational, strict=True)]
    moments = []
    for folder in folders:
        files = folder / "model.osim", folder / "kinematics.mot", folder / "external_loads.xml"
        moments.append(inverse_dynamics_tool(opensim, *files, folder)[columns].to_numpy())
    start = int(np.argmin(np.abs(trial.kinematics.trajectory_time - trial.time[0])))
    found = np.array(moments)[:, start : start + len(trial.time)]
    ratio = spread_over_reported(found, trial)
    np.testing.assert_allclose(ratio, 1.0, atol=SYSTEMATIC + sampling(count))
    assert np.median(ratio) == pytest.approx(1.0, abs=SYSTEMATIC)


@pytest.mark.slow
def test_many_draws_spread_as_reported_within_ten_percent(demo_run, tmp_path, monkeypatch):
    """Each joint, with hardly any sampling left."""
    from command_line import fitted

    monkeypatch.setattr(posterior_draws, "MOST_DRAWS", 1500)
    monkeypatch.setattr(posterior_draws, "MOST_BYTES", 10**9)
    fit = load_fit(fitted(tmp_path / "out", demo_run[0].subject_file).folder)
    moments = [drawn_fit(fit, n).trials[0].joint_loads["estimate"] for n in range(kept_draws(fit).count)]
    assert len(moments) == 1500
    np.testing.assert_allclose(spread_over_reported(np.array(moments), fit.trials[0]), 1.0, atol=SYSTEMATIC)


@pytest.mark.slow
@pytest.mark.measured
def test_legs_spread_as_reported_where_the_delay_outlasts_a_landing(fit_of):
    """Their deviations were up to 2.3 times the draws' while they were linear in the delay."""
    walk_b = load_fit(fit_of("pig_b").folder)
    (trial,) = walk_b.trials
    moments = [drawn_fit(walk_b, n).trials[0].joint_loads["estimate"] for n in range(kept_draws(walk_b).count)]
    ratio = spread_over_reported(np.array(moments), trial)[:12]
    np.testing.assert_allclose(ratio, 1.0, atol=SYSTEMATIC + sampling(len(moments)))
    assert np.median(ratio) == pytest.approx(1.0, abs=SYSTEMATIC)


def test_drawn_errors_of_plates_are_added_to_the_estimated_ones():
    """Loads that are corrected for both errors at once are those of the estimate, corrected for the drawn rest."""
    rng = np.random.default_rng(3)
    recorded, standing = rng.normal(0.0, 300.0, (20, 2, 6)), np.ones((20, 2))
    recorded[..., 1] = 700.0
    plate_index = np.tile([0, 1], (20, 1))
    shared = np.array([[0.2, 0.0, 0.3], [0.9, 0.0, 0.3]]), np.eye(3)
    gain, departure = np.array([0.08, -0.05]), np.array([0.03, 0.02])

    def corrected(gains):
        errors = np.zeros((2, 7))
        errors[:, GAIN] = gains
        return corrected_loads(recorded, standing, plate_index, errors, *shared)

    plates = np.zeros((1, 2, 7))
    plates[0, :, GAIN] = departure
    nothing = np.zeros(0), np.zeros((1, 0, 0))
    draws = TrialDraws(*nothing, plates, gain, *shared, np.array([0.004]), np.zeros(1))
    estimate = GroundReactions(np.arange(20) / 100, corrected(gain), plate_index, np.zeros((20, 2, 6)), None)
    drawn = drawn_reactions(estimate, draws, 0)
    np.testing.assert_allclose(drawn.wrench, corrected(gain + departure), rtol=1e-12)
    assert np.abs(drawn.wrench - estimate.wrench).max() > 10.0
    np.testing.assert_allclose(estimate.time - drawn.time, 0.004)
