"""Torques of a force file that are not free moments at the points beside them are named; those that are never are."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.doubts import trial_doubts
from kinertia.io.ground_forces import read_forces
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.io.sto import read_table, write_table
from kinertia.trial.exchanged_torques import exchanged_torques_doubts
from kinertia.trial.torque_columns import torque_columns_doubts
from recordings import WALKS, here

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
GROUPS = here(COLUMNS)
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
SAID_OF = [name for name in ("synthetic", "gait2354") if name in WALKS]


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
        was = [[table.values[:, one] for one in group] for group in places]
        for group, became in zip(places, how(was), strict=True):
            for columns, new in zip(group, became, strict=True):
                values[:, columns] = new
        write_table(path, replace(table, values=values), "grf")
        return read_forces(path)

    return change


@pytest.mark.parametrize("name", SOUND)
def test_sound_files(file_of, name):
    plates = read_forces(file_of(name))
    assert torque_columns_doubts(plates) == []
    assert exchanged_torques_doubts(plates) == []


@pytest.mark.parametrize("name", WITHOUT_COLUMNS)
def test_plates_of_a_c3d_file_have_no_torque_columns(recording_of, name):
    assert torque_columns_doubts(recording_of(*WALKS[name]).plates) == []


@pytest.mark.parametrize("axis", [0, 2])
@pytest.mark.parametrize("name", GROUPS)
def test_moments_about_another_point(changed, name, axis):
    """As about the sensors of a plate, which are some cm from where the foot stands."""

    def other_point(groups):
        arm = np.zeros(3)
        arm[axis] = 0.02
        return [(force, point, torque + np.cross(arm, force)) for force, point, torque in groups]

    (doubt,) = torque_columns_doubts(changed(name, other_point))
    assert doubt.startswith("the torques of the force file do not go with the points of application beside them: those")
    assert doubt.count("20 mm times the vertical force") == 2
    assert "about another point" in doubt


@pytest.mark.parametrize(("axis", "named"), [(0, "along X"), (2, "along Z")])
@pytest.mark.parametrize("name", GROUPS)
def test_free_moment_in_another_column(changed, name, axis, named):
    def exchange(groups):
        order = [0, 1, 2]
        order[1], order[axis] = axis, 1
        return [(force, point, torque[:, order]) for force, point, torque in groups]

    (doubt,) = torque_columns_doubts(changed(name, exchange))
    assert doubt.startswith("the torques of the force file are about a horizontal axis: those of")
    assert doubt.count(named) == 2
    assert "not turned with the forces" in doubt


@pytest.mark.parametrize("name", GROUPS)
def test_torques_of_the_other_plate(changed, name):
    def exchange(groups):
        (force, point, torque), (other_force, other_point, other_torque) = groups
        return [(force, point, other_torque), (other_force, other_point, torque)]

    plates = changed(name, exchange)
    assert torque_columns_doubts(plates) == []
    (doubt,) = exchanged_torques_doubts(plates)
    assert doubt.startswith(f"the free moments (torques) of {plates.names[0]} and {plates.names[1]} are exchanged: ")


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

    assert exchanged_torques_doubts(changed(name, noisy)) == []


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

    moved, whole = changed(name, at_the_middle), read_forces(file_of(name))
    loaded = whole.force[..., 1] > 20.0
    np.testing.assert_allclose(moved.moment[loaded], whole.moment[loaded], atol=1e-3)
    assert torque_columns_doubts(moved) == []


@pytest.mark.parametrize("name", SAID_OF)
def test_said_of_a_trial(changed, recording_of, name):
    """By `check` and by every fit: both ask for these."""
    recording = recording_of(*WALKS[name])
    marker_set = choose_marker_set(recording.markers.labels)
    feet = {
        side: [one for one in own if one in recording.markers.labels] for side, own in marker_set.foot_labels().items()
    }

    def said(arm):
        plates = changed(
            WALKS[name][1],
            lambda groups: [(f, p, torque + np.cross([arm, 0.0, 0.0], f)) for f, p, torque in groups],
        )
        return trial_doubts(replace(recording, plates=plates), marker_set, None, feet)

    (doubt,) = said(0.02)
    assert "do not go with the points of application" in doubt.sentence
    assert not doubt.refused
    # far off the feet the trial is refused, and told why
    (doubt,) = said(0.5)
    assert doubt.refused
    assert "do not go with the points of application" in doubt.sentence
