"""The page next to OpenSim's pipelines: its pure functions, and that its page holds what was found."""

import numpy as np
import pandas as pd
import pytest

opensim = pytest.importorskip("opensim")

from kinertia.io.text.sto import write_sto  # noqa: E402
from validation import opensim_rra, opensim_runs, peers, truth_trials  # noqa: E402
from validation.peer_cases import Case, Result  # noqa: E402


def test_plate_rows_are_the_wrench_again():
    rng = np.random.default_rng(0)
    wrench = np.r_[50, 700, -30, rng.normal(0, 100, 3)]
    points = {side: rng.normal(size=3) for side in "rl"}
    row = truth_trials.plate_row(wrench, {"r": 0.3, "l": 0.7}, points)
    total = np.zeros(6)
    for side in "rl":
        force, place, free = (
            np.array([row[f"ground_{kind}{axis}"] for axis in "xyz"])
            for kind in (f"force_{side}_v", f"force_{side}_p", f"torque_{side}_")
        )
        assert place[1] == free[0] == free[2] == 0
        total += np.r_[force, np.cross(place, force) + free]
    np.testing.assert_allclose(total, wrench)


def test_unloaded_foot_has_no_force():
    row = truth_trials.plate_row(np.arange(1.0, 7), {"r": 1, "l": 0}, {"r": np.zeros(3), "l": np.ones(3)})
    assert all(value == 0 for column, value in row.items() if "_l_" in column)


def test_share_of_the_right_foot_is_that_of_its_plate():
    time = np.arange(3) / 10
    columns = ["1_vy", "2_vy", "1_px", "2_px", "1_pz", "2_pz"]
    measured = pd.DataFrame([[300, 0, 0, 1, 0, 0], [300, 100, 0, 1, 0, 0], [-5, 400, 0, 1, 0, 0]], time, columns)
    here, there = np.zeros((3, 3)), np.tile([1.0, 0, 0], (3, 1))
    np.testing.assert_allclose(truth_trials.right_share(measured, time, here, there), [1, 0.75, 0])
    np.testing.assert_allclose(truth_trials.right_share(measured, time, there, here), [0, 0.25, 1])


def test_faults_move_the_loaded_left_plate_and_delay_all():
    forces = pd.DataFrame(0.0, [0.0, 0.1], truth_trials.force_columns())
    forces.loc[0.1, "ground_force_l_vy"] = 400
    faulty = truth_trials.disturbed(forces, truth_trials.Faults(plate_m=0.02, lag_s=0.01))
    assert list(faulty["ground_force_l_px"]) == [0, 0.02]
    np.testing.assert_allclose(faulty.index, [0.01, 0.11])
    assert forces.index[0] == 0


def test_spline_repeats_a_smooth_motion():
    time = np.arange(0, 2, 0.01)
    values, speeds, _ = truth_trials.Spline(time, np.sin(6 * time)[:, None])(time[20:-20])
    np.testing.assert_allclose(values[:, 0], np.sin(6 * time[20:-20]), atol=1e-4)
    np.testing.assert_allclose(speeds[:, 0], 6 * np.cos(6 * time[20:-20]), atol=1e-2)


def test_recommended_masses_are_read_from_what_rra_prints():
    lines = (
        "Total mass change: -0.08",
        "pelvis: orig mass = 10.0, new mass = 9.9",
        "toes_r: orig mass = 2e-1, new mass = 0.3",
    )
    log = "".join(f"*  {line}\n" for line in lines)
    assert opensim_rra.recommended_masses(log) == pytest.approx({"pelvis": 0.99, "toes_r": 1.5})


def test_weights_go_by_the_beginning_of_a_name():
    assert opensim_rra.by_prefix("hip_flexion_l", opensim_rra.OPTIMAL_NM, 100) == 300
    assert opensim_rra.by_prefix("mtp_angle_l", opensim_rra.OPTIMAL_NM, 100) == 100


def test_loads_name_the_given_forces_only(tmp_path):
    truth_trials.write_loads(tmp_path / "loads.xml", "forces.mot")
    opensim_runs.with_forces_file(tmp_path / "loads.xml", tmp_path / "mine.mot", tmp_path / "copy.xml")
    text = (tmp_path / "copy.xml").read_text()
    assert text.count("datafile>") == 2
    assert f">{tmp_path / 'mine.mot'}<" in text
    assert text.count("calcn_") == 2


def test_stances_leave_out_short_contacts():
    time = np.arange(100) / 100
    vertical = np.where((time > 0.195) & (time < 0.605) | (time == 0.9), 500, 0)
    assert peers.stances(time, vertical) == [pytest.approx((0.2, 0.6))]


def test_errors_pool_sides_and_people_and_take_the_best_cutoff():
    time = np.arange(5.0)
    truth = pd.DataFrame(0.0, time, [f"{joint}{end}" for joint in peers.JOINTS for end in ("_r_moment", "_l_moment")])
    off = truth + 1
    off["knee_angle_r_moment"] = 7
    errors = peers.pooled([peers.joint_errors(off, truth, time), peers.joint_errors(truth, truth, time)])
    assert errors["knee_angle"] == pytest.approx(np.sqrt((49 + 1) / 2 / 2))
    assert errors["ankle_angle"] == pytest.approx(np.sqrt(0.5))


def test_spike_is_found_at_heel_strike():
    time = np.arange(0, 2, 0.01)
    moments = pd.DataFrame({"knee": 50 * np.sin(3 * time)}, time)
    quiet = peers.spikes(moments, "knee", [(0.5, 1.1)], time)
    moments.loc[moments.index[51], "knee"] += 40
    impact, rest = peers.spikes(moments, "knee", [(0.5, 1.1)], time)
    assert max(quiet) < 1
    assert impact > 20
    assert rest < 10


@pytest.fixture
def one_walk(tmp_path):
    """A truth walk that everybody computed, RRA excepted."""
    time = np.arange(0, 1, 0.01)
    names = [f"{joint}_{side}_moment" for joint in peers.JOINTS for side in "rl"]
    truth = pd.DataFrame(0.0, pd.Index(time), names)
    root = {f"pelvis_t{axis}_force": 2.0 for axis in "xyz"} | {"pelvis_tilt_moment": 5.0}
    write_sto(tmp_path / "moments.sto", truth, False, "moments")
    truth_trials.write_loads(tmp_path / "loads.xml", "forces.mot")
    forces = pd.DataFrame(0.0, pd.Index(time), truth_trials.force_columns())
    forces.loc[0.3:0.8, ["ground_force_r_vy", "ground_force_l_vy"]] = 600.0
    write_sto(tmp_path / "forces.mot", forces, False, "forces")
    files = [tmp_path / name for name in ("model.osim", "walk.trc", "forces.mot", "loads.xml")]
    case = Case("one walk", tmp_path, *files, 70.0, {"default": ()}, truth=tmp_path / "moments.sto")

    def result(off, cutoff):
        return Result(4.0, {cutoff: truth + off}, truth.assign(**root), 0.011)

    runs = {"time": time[5:-5], "opensim": result(4, 6), "rra": Result(failed="exit status 1"), "default": result(1, 0)}
    return case, runs


def test_page(one_walk, tmp_path):
    page = peers.document([one_walk], [one_walk], {"one": one_walk})
    assert "| OpenSim, IK + ID | 4.00 |" in page
    assert "| OpenSim, RRA | failed |" in page
    assert "| Kinertia / OpenSim, IK + ID | 0.25 |" in page
    assert "| one walk | Kinertia | 3.5 | 5.0 | 11.0 | 4 |" in page
    assert "one walk (exit status 1)" in page
    peers.draw(*one_walk, tmp_path / "figure.svg")
    assert "<svg" in (tmp_path / "figure.svg").read_text()
