import numpy as np
import pytest
from scipy.linalg import block_diag

from kinertia.estimation import identifiability
from kinertia.estimation.identifiability import base_parameters, evidence
from kinertia.estimation.prior import literature_prior
from kinertia.model.bsp import PARAMETERS, BodySegmentParameters, dynamic_by_table
from kinertia.motion.dynamics import Motion, residual, root_regressor
from kinertia.synthetic.walk import walk, walking_subject

ROOT_SD = np.repeat([8.0, 2.4], 3)


@pytest.fixture(scope="module")
def person():
    return walking_subject()


@pytest.fixture(scope="module")
def trial(person):
    return walk(person, 1.3, 50.0, trapezoid=False)


@pytest.fixture(scope="module")
def base(person, trial):
    prior = literature_prior(person.literature)
    return base_parameters(trial.skeleton, person.literature, prior.sd, [trial.motion], [ROOT_SD])


@pytest.mark.parametrize(
    ("information", "word"),
    [
        (0.0, "assumed"),
        (0.249, "assumed"),
        (0.25, "informed"),
        (0.75, "informed"),
        (0.751, "measured"),
        (1, "measured"),
    ],
)
def test_evidence(information, word):
    assert evidence(information) == word


def test_count_is_what_joints_hide(base):
    """One per joint with intersecting axes (hips, back, shoulders), three per pin joint (knees, elbows); the two ankle
    axes do not meet and hide nothing.
    """
    assert base.count == 120 - 5 - 3 * 4
    assert len(base.never) == 9
    assert "mass moving between pelvis and thigh_r at the centre of their joint" in base.never
    knee = "mass moving between thigh_l and shank_l on the axis of their joint, with any distribution along it"
    assert knee in base.never


def test_mass_at_the_hip_centre_moves_between_thigh_and_pelvis_unseen(person, trial):
    """What `never` says, by inverse dynamics: 1 kg from pelvis to thigh at the hip centre changes no residual."""
    skeleton, bsp = trial.skeleton, person.literature
    hip = next(joint for joint in skeleton.joints if joint.child == "thigh_r").translation
    phi = bsp.dynamic_parameters().reshape(-1, 10)
    point = BodySegmentParameters(("a",), [1.0], [hip], [np.zeros((3, 3))]).dynamic_parameters()
    phi[bsp.segments.index("pelvis")] -= point
    phi[bsp.segments.index("thigh_r")] += np.eye(10)[0]
    moved = BodySegmentParameters.from_dynamic_parameters(bsp.segments, phi)
    none = np.zeros((len(trial.time), 6))
    before, after = (residual(skeleton, b, trial.motion, none) for b in (bsp, moved))
    np.testing.assert_allclose(after, before, atol=1e-8)


def test_a_joint_held_still_hides_all_that_moves_across_it(person, trial):
    held = trial.skeleton.lock({"elbow_flex_r": 0.3})
    kept = [i for i, name in enumerate(trial.skeleton.coordinates) if name != "elbow_flex_r"]
    motion = Motion(*(part[:, kept] for part in (trial.motion.q, trial.motion.qd, trial.motion.qdd)))
    prior = literature_prior(person.literature)
    base = base_parameters(held, person.literature, prior.sd, [motion], [ROOT_SD])
    assert base.count == 103 - 7
    assert "anything moving between upper_arm_r and forearm_r: their joint is fixed" in base.never


def test_gain_is_the_prior_deviation_over_that_of_least_squares(person, trial, base):
    """One prior deviation along the combination changes the load by `gain` noise deviations, over all frames."""
    prior = literature_prior(person.literature)
    chain = block_diag(*dynamic_by_table(person.literature.mass_kg, person.literature.com_m)) * prior.sd.ravel()
    rows = root_regressor(trial.skeleton, person.literature.segments, trial.motion) / ROOT_SD[:, None]
    for combination in base.best:
        weights = np.array(list(combination.weights.values()))
        assert np.square(weights).sum() == pytest.approx(1.0)
        assert np.linalg.norm(rows @ (chain @ weights)) == pytest.approx(combination.gain, rel=1e-6)
    assert list(base.best[0].weights)[:2] == [f"pelvis.{name}" for name in PARAMETERS[:2]]


def test_words_name_the_largest_weight_and_join_the_sides(base):
    combination = max(base.best, key=lambda c: abs(c.weights["thigh_r.mass"]))
    assert combination.words.startswith("mass of the right thigh and not of the left")
    assert any("mass of both thighs" in c.words for c in base.best)


def test_two_trials_show_more_than_one(person, trial, base):
    prior = literature_prior(person.literature)
    both = base_parameters(trial.skeleton, person.literature, prior.sd, [trial.motion] * 2, [ROOT_SD] * 2)
    assert both.best[0].gain == pytest.approx(np.sqrt(2) * base.best[0].gain)
    assert both.condition == pytest.approx(base.condition, rel=1e-3)
    assert both.shown >= base.shown


def test_long_motions_are_told_by_some_of_their_frames(person, trial, monkeypatch):
    prior, motions = literature_prior(person.literature), [trial.motion] * 3
    every = base_parameters(trial.skeleton, person.literature, prior.sd, motions, [ROOT_SD] * 3)
    monkeypatch.setattr(identifiability, "_ENOUGH_FRAMES", len(trial.time))
    some = base_parameters(trial.skeleton, person.literature, prior.sd, motions, [ROOT_SD] * 3)
    assert (some.count, some.never) == (every.count, every.never)
    np.testing.assert_allclose(
        [combination.gain for combination in some.best], [combination.gain for combination in every.best], rtol=0.2
    )
    assert some.best[0].words == every.best[0].words


def test_one_frame_of_every_few_is_drawn():
    drawn = identifiability._one_of(4, 41)
    np.testing.assert_array_equal(drawn // 4, np.arange(10))
    assert len(set(drawn % 4)) > 1
    np.testing.assert_array_equal(identifiability._one_of(1, 5), np.arange(5))
