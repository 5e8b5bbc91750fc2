"""Torques of a force file that are not free moments at the points beside them are found; those that are never are."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.plates.free_moments import free_moments
from kinertia.findings.quantity import Quantity
from kinertia.io.ground_forces import read_forces
from kinertia.io.text.sto import read_table, write_table
from plate_findings import plates_alone
from recordings import WALKS, here, slow_beside

MADE = (
    ("1_ground_force_v", "1_ground_force_p", "1_ground_torque_"),
    ("2_ground_force_v", "2_ground_force_p", "2_ground_torque_"),
)
COLUMNS = {
    "synthetic/walk_grf.mot": MADE,
    "synthetic/long_grf.mot": MADE,
    "synthetic/run_grf.mot": MADE,
    "gait2354/subject01_walk1_grf.mot": (
        ("ground_force_v", "ground_force_p", "ground_torque_"),
        ("1_ground_force_v", "1_ground_force_p", "1_ground_torque_"),
    ),
    "rajagopal_walk/grf_walk.mot": (
        ("ground_force_r_v", "ground_force_r_p", "ground_torque_r_"),
        ("ground_force_l_v", "ground_force_l_p", "ground_torque_l_"),
    ),
    "subject4/walking1_grf.mot": (
        ("ground_force_1_v", "ground_force_1_p", "ground_force_1_m"),
        ("ground_force_2_v", "ground_force_2_p", "ground_force_2_m"),
    ),
}
GROUPS = slow_beside(("synthetic/walk_grf.mot", "gait2354/subject01_walk1_grf.mot"), here(COLUMNS))
SOUND = here(
    [
        *COLUMNS,
        "synthetic/other_grf.mot",
        "synthetic/squats_grf.mot",
        "subject4/walking2_grf.mot",
        "subject4/squats1_grf.mot",
        "subject4/static1_grf.mot",
        "field/rajagopal_run/grf_run.mot",
        "field/laiarnold5_jump/DJ1_forces.mot",
        "field/laiarnold6_walk/walking1_forces.mot",
        "field/hamner_treadmill_run/run200_grf.mot",
        "field/hamner_run/subject02_running_grf.mot",
    ]
)
WITHOUT_COLUMNS = [name for name in ("synthetic c3d", "plug-in gait a", "plug-in gait b") if name in WALKS]


@pytest.fixture
def changed(file_of, tmp_path):
    """Loads of a force file whose forces, points and torques, (k, 3) of each plate, a function replaced."""

    def change(name, how):
        table, path = read_table(file_of(name)), tmp_path / "grf.mot"
        values = table.values.copy()
        places = [
            [[table.labels.index(identifier + axis) for axis in "xyz"] for identifier in group]
            for group in COLUMNS[name]
        ]
        was = [[table.values[:, column] for column in group] for group in places]
        for group, became in zip(places, how(was), strict=True):
            for columns, new in zip(group, became, strict=True):
                values[:, columns] = new
        write_table(path, replace(table, values=values), "grf")
        return read_forces(path)[0]

    return change


def columns(plates):
    """What is found of torque columns: not of free moments that a file does not have."""
    found = free_moments(plates_alone(plates))
    return [
        finding
        for finding in found
        if finding.code != "P264" and finding.evidence.get("method") != Quantity("fixed point")
    ]


@pytest.mark.parametrize("name", SOUND)
def test_fault_free_files(file_of, name):
    assert columns(read_forces(file_of(name))[0]) == []


@pytest.mark.parametrize("name", WITHOUT_COLUMNS)
def test_plates_of_a_c3d_file_have_no_torque_columns(recording_of, name):
    assert columns(recording_of(*WALKS[name]).plates) == []


@pytest.mark.parametrize("axis", [0, 2])
@pytest.mark.parametrize("name", GROUPS)
def test_moments_about_another_point(changed, name, axis):
    """As about the sensors of a plate, which are some cm from where the foot stands."""

    def other_point(groups):
        arm = np.zeros(3)
        arm[axis] = 0.02
        return [(force, point, torque + np.cross(arm, force)) for force, point, torque in groups]

    found = columns(changed(name, other_point))
    assert [finding.code for finding in found] == ["P261"] * 2
    assert [finding.evidence["lever_arm_m"].value for finding in found] == pytest.approx([0.02] * 2, abs=0.002)


@pytest.mark.parametrize("axis", [0, 2])
@pytest.mark.parametrize("name", GROUPS)
def test_free_moment_in_another_column(changed, name, axis):
    def exchange(groups):
        order = [0, 1, 2]
        order[1], order[axis] = axis, 1
        return [(force, point, torque[:, order]) for force, point, torque in groups]

    plates = changed(name, exchange)
    named = plates_alone(plates).along(axis)["axis"]
    assert [(finding.code, finding.where.axis) for finding in columns(plates)] == [("P262", named)] * 2


@pytest.mark.parametrize("name", GROUPS)
def test_torques_of_the_other_plate(changed, name):
    def exchange(groups):
        (force, point, torque), (other_force, other_point, other_torque) = groups
        return [(force, point, other_torque), (other_force, other_point, torque)]

    plates = changed(name, exchange)
    (found,) = columns(plates)
    assert found.code == "P263"
    assert (found.evidence["plate"].value, found.evidence["other"].value) == plates.names


@pytest.mark.parametrize("size_nm", [0.3, 3.0, 5.0, 8.0, 15.0, 3000.0])
@pytest.mark.parametrize("name", GROUPS)
def test_what_an_unloaded_plate_reads_is_no_torque_of_the_other(changed, name, size_nm):
    """Exports divide by next to no force there, so that torques and points may be anything."""
    rng = np.random.default_rng(0)

    def noisy(groups):
        return [
            (force, point, torque + np.where(force[:, 1:2] < 20.0, size_nm * rng.standard_normal(torque.shape), 0.0))
            for force, point, torque in groups
        ]

    assert "P263" not in [finding.code for finding in columns(changed(name, noisy))]


@pytest.mark.parametrize("middle", [(0.0, 0.0, 0.0), (0.9, 0.0, 0.3)])
@pytest.mark.parametrize("name", GROUPS)
def test_forces_at_a_point_that_stays_with_all_their_moments(changed, file_of, name, middle):
    """They are the same loads, and nothing is wrong with them."""

    def at_the_middle(groups):
        place = np.array(middle)
        return [
            (force, np.tile(place, (len(force), 1)), torque + np.cross(point - place, force))
            for force, point, torque in groups
        ]

    moved, whole = changed(name, at_the_middle), read_forces(file_of(name))[0]
    loaded = whole.force[..., 1] > 20.0
    np.testing.assert_allclose(moved.moment[loaded], whole.moment[loaded], atol=1e-3)
    assert columns(moved) == []
