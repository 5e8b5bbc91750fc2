import numpy as np
import pytest

from kinertia.errors import KinertiaError
from kinertia.estimation.identifiability import ParameterVector
from kinertia.estimation.two_level import correct_pelvis
from kinertia.io.subject.reader import read_subject
from kinertia.model.bsp import BodySegmentParameters
from kinertia.motion.dynamics import residual, root_regressor
from kinertia.studies.table1 import measured_trial, symmetric_truth
from kinertia.synthetic.walk import (
    STATIC_ONLY,
    Manner,
    centre_of_pressure,
    consistent_trial,
    unlike_literature,
    walk,
    walking_subject,
)
from recordings import is_here

CONSISTENT = {
    "synthetic": (("synthetic/static.trc", "synthetic/walk.trc", "synthetic/walk_grf.mot"), 72.6, 1.803, (1.09, 2.16)),
    "rajagopal": (
        (
            "rajagopal_walk/static_walk_1.trc",
            "rajagopal_walk/motion_capture_walk.trc",
            "rajagopal_walk/grf_walk.mot",
        ),
        85.0,
        1.83,
        (0.6, 1.84),
    ),
}
"""Static trial, markers and forces, mass (kg), height (m), and when all ground contact is measured (s)."""


@pytest.fixture(scope="module")
def subject():
    return walking_subject()


@pytest.fixture(scope="module")
def trial(subject):
    return walk(subject)


def largest_residual(trial) -> float:
    return np.abs(residual(trial.skeleton, trial.bsp, trial.motion, trial.window.wrench)).max()


def on_foot(trial, landmark: str) -> np.ndarray:
    """(n, 2, 3) m on the ground below a landmark of the right and left foot."""
    labels = {"heel": ["{}.Heel"], "forefoot": ["{}.Toe.Lat", "{}.Toe.Med"]}[landmark]
    points = [trial.markers.select([label.format(side) for label in labels]).positions.mean(axis=1) for side in "RL"]
    return np.stack(points, axis=1) * [1.0, 0.0, 1.0]


@pytest.mark.parametrize(("rate_hz", "duration_s"), [(60.0, None), (100.0, 2.7), (200.0, 1.0)])
def test_root_equations_hold_at_every_frame(subject, rate_hz, duration_s):
    trial = walk(subject, duration_s, rate_hz)
    assert largest_residual(trial) < 1e-9
    assert np.diff(trial.time) == pytest.approx(1 / rate_hz)
    assert trial.deviation[:3].max() < 1e-3
    assert trial.deviation[3:].max() < 1e-2


def test_pelvis_is_the_trapezoid_integral_of_its_acceleration(trial):
    corrected = correct_pelvis(trial.skeleton, trial.bsp, trial.window)
    np.testing.assert_allclose(corrected.q, trial.motion.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(corrected.qd, trial.motion.qd, rtol=0, atol=1e-11)
    np.testing.assert_allclose(corrected.qdd, trial.motion.qdd, rtol=0, atol=1e-9)


def test_walk_is_periodic_and_advances(subject):
    stride = walk(subject, rate_hz=1000.0)
    joints = stride.motion.q[:, 6:]
    np.testing.assert_allclose(joints[-1], joints[0], atol=0.01)
    assert 1.0 < stride.motion.q[-1, 0] - stride.motion.q[0, 0] < 2.0
    assert not set(STATIC_ONLY) & set(stride.markers.labels)


def test_everybody_walks_in_a_manner_of_his_own(subject):
    manner = Manner.draw(np.random.default_rng(4))
    walked, usual = walk(subject, 2.0, trapezoid=False, manner=manner), walk(subject, 2.0, trapezoid=False)
    assert largest_residual(walked) < 1e-9
    swing = {name: np.ptp(walked.motion.q[:, k]) for k, name in enumerate(walked.skeleton.coordinates)}
    before = {name: np.ptp(usual.motion.q[:, k]) for k, name in enumerate(usual.skeleton.coordinates)}
    for name in ("arm_flex_r", "arm_flex_l"):
        assert swing[name] == pytest.approx(manner.swing["arm_flex"] * before[name], rel=0.02)
    assert swing["knee_angle_r"] == pytest.approx(before["knee_angle_r"], rel=0.02)
    assert swing["pelvis_tx"] == pytest.approx(manner.pace * before["pelvis_tx"], rel=0.02)
    fast = walk(subject, trapezoid=False, manner=Manner(pace=1.25))
    assert fast.time[-1] == pytest.approx(walk(subject).time[-1] / 1.25, abs=0.01)


def test_start_moves_along_the_stride(subject):
    early, late = walk(subject, 1.0), walk(subject, 0.5, start=0.5)
    assert np.abs(early.motion.q[0, 6:] - late.motion.q[0, 6:]).max() > 0.1


def test_ground_carries_the_body_weight(trial):
    weight = trial.bsp.total_mass_kg * 9.80665
    vertical = trial.foot_loads[:, :, 1]
    assert vertical.sum(axis=1)[:-1].mean() == pytest.approx(weight, rel=0.005)
    assert vertical.min() > -1e-9


def test_centre_of_pressure_stays_under_the_foot(subject):
    trial = walk(subject, 2.7)
    pressure = centre_of_pressure(trial.foot_loads)
    heel, forefoot = on_foot(trial, "heel"), on_foot(trial, "forefoot")
    length = np.linalg.norm(forefoot - heel, axis=-1)
    along = (forefoot - heel) / length[..., None]
    share = np.einsum("nfi,nfi->nf", pressure - heel, along) / length
    aside = np.linalg.norm(pressure - heel - (share * length)[..., None] * along, axis=-1)
    loaded = trial.foot_loads[:, :, 1] > 100.0
    assert loaded.any(axis=0).all()
    assert share[loaded].min() > -0.1
    assert share[loaded].max() < 1.3
    assert aside[loaded].max() < 0.06


def test_shares_of_the_feet_are_continuous(subject):
    """Halving the time step halves the largest jump; a jump that stayed would be a discontinuity."""
    jumps = [np.abs(np.diff(walk(subject, rate_hz=rate).foot_loads, axis=0)).max() for rate in (500.0, 1000.0)]
    assert jumps[1] < 0.6 * jumps[0]


def test_markers_are_those_of_the_motion(trial):
    pose = trial.skeleton.pose(trial.motion.q[5:6])
    np.testing.assert_array_equal(trial.skeleton.marker_positions(pose)[0], trial.markers.positions[5])


def scaled_singular_values(trial, bsp) -> np.ndarray:
    """Singular values of the 49 columns of the root regressor, each column in units of its own norm."""
    vector = ParameterVector(bsp, True)
    columns = root_regressor(trial.skeleton, bsp.segments, trial.motion) @ vector.jacobian(vector.values(bsp))
    columns = columns.reshape(-1, len(vector.names))
    return np.linalg.svd(columns / np.linalg.norm(columns, axis=0), compute_uv=False)


def test_masses_are_found_only_with_centres_of_mass_off_the_segment_axes(subject, trial):
    """full rank off axis; on axis the last singular values fall to rounding, with a gap above."""
    off_axis = symmetric_truth(subject.bsp)
    table = off_axis.table()
    table[:, [1, 3]] = 0.0
    on_axis = BodySegmentParameters.from_table(off_axis.segments, table)
    full, deficient = (scaled_singular_values(trial, bsp) for bsp in (off_axis, on_axis))
    assert len(full) == 49
    assert full[-1] > 1e-8 * full[0]
    rank = int((deficient > 1e-12 * deficient[0]).sum())
    assert rank < 49
    assert deficient[rank - 1] > 1e4 * deficient[rank]


def test_people_differ_from_the_literature_by_what_is_said(subject):
    people = [unlike_literature(subject, np.random.default_rng(seed)) for seed in range(60)]
    literature = subject.literature
    mass = np.array([p.bsp.mass_kg / literature.mass_kg for p in people])
    com = np.array([p.bsp.com_m - literature.com_m for p in people])
    assert mass[:, 1:].std() == pytest.approx(0.1, rel=0.15)
    assert com.std() == pytest.approx(0.01, rel=0.1)
    assert np.abs(com.mean()) < 0.001
    for person in people[:5]:
        assert person.bsp.total_mass_kg == pytest.approx(literature.total_mass_kg)
        assert person.bsp.physically_consistent().all()
        left = [segment.endswith("_l") for segment in person.bsp.segments]
        np.testing.assert_allclose(person.bsp.mirrored().table()[left], person.bsp.table()[left], atol=1e-12)


def test_a_consistent_trial_is_its_own_consistent_trial(trial):
    again = consistent_trial(trial.skeleton, trial.bsp, trial.time, trial.motion, trial.foot_loads)
    np.testing.assert_allclose(again.motion.q, trial.motion.q, atol=1e-10)
    assert again.deviation.max() < 1e-10


def test_inconsistent_loads_bend_the_pelvis_until_they_hold(trial):
    loads = trial.foot_loads * 1.01
    bent = consistent_trial(trial.skeleton, trial.bsp, trial.time, trial.motion, loads)
    assert largest_residual(bent) < 1e-9
    assert bent.deviation[1] > 1e-3
    np.testing.assert_array_equal(bent.motion.q[:, 6:], trial.motion.q[:, 6:])


def test_loads_that_cannot_be_balanced_are_refused(trial):
    upside_down = trial.foot_loads * -50.0
    with pytest.raises(KinertiaError, match="window"):
        consistent_trial(trial.skeleton, trial.bsp, trial.time, trial.motion, upside_down)


@pytest.mark.parametrize("name", [name for name, (files, *_) in CONSISTENT.items() if is_here(files)])
def test_a_recorded_walk_becomes_consistent(file_of, tmp_path, name):
    files, mass_kg, height_m, window_s = CONSISTENT[name]
    static, markers, forces = (file_of(part) for part in files)
    file = tmp_path / "subject.toml"
    file.write_text(
        f'[subject]\nsex = "male"\nmass_kg = {mass_kg}\nheight_m = {height_m}\n'
        f'[model]\nstatic = "{static.as_posix()}"\n'
        f'[[trial]]\nmarkers = "{markers.as_posix()}"\nforces = "{forces.as_posix()}"\n'
    )
    trial, name = measured_trial(read_subject(file))
    assert largest_residual(trial) < 1e-9
    assert name.startswith(f"{markers.stem}, {window_s[0]:.1f}")
    assert np.ptp(trial.time) == pytest.approx(window_s[1] - window_s[0], abs=0.02)
    assert 0.0 < trial.deviation[:3].max() < 0.02
    assert 0.0 < trial.deviation[3:].max() < np.radians(10)
