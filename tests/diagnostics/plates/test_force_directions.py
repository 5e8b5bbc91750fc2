"""Forces with wrong axes, directions and signs are found; fault-free ones never are."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.body_motion import force_velocities
from kinertia.diagnostics.plates.force_directions import force_directions, vertical_signs
from kinertia.findings.finding import finding
from kinertia.findings.quantity import Where
from kinertia.io.marker_set_file import choose_marker_set
from loads_and_feet import on_one_plate
from plate_findings import codes, context_of, found_in, with_force
from recordings import QUICK_WALKS, RUNS, SQUATS, WALKS, here, marker_set_for, named_here, slow_beside


@pytest.fixture(params=slow_beside(QUICK_WALKS, WALKS))
def walk(request, recording_of):
    return recording_of(*WALKS[request.param])


@pytest.fixture(params=[name for name in RUNS if name != "hamner"])
def run(request, recording_of):
    """Limbs swing so much that the pelvis does not move as the centre of mass."""
    return recording_of(*RUNS[request.param])


def loaded(walk, marker_set=None):
    """What is found of its loads, P22 to P23 and P212, P214, T20: the vertical moment has tests of its own."""
    families = ("P21", "P22", "P23", "T20", "M13", "P20")
    return [reported for reported in found_in(context_of(walk, marker_set)) if reported.code.startswith(families)]


@pytest.mark.parametrize("axis", [0, 2])
@pytest.mark.parametrize("plate", [0, 1])
def test_the_sign_of_one_plate(walk, axis, plate):
    signs = np.ones((2, 3))
    signs[plate, axis] = -1.0
    wrong = context_of(with_force(walk, lambda force: force * signs))
    (found,) = [*force_directions(wrong)]
    assert found.code == "P233"
    assert found.where == wrong.at(plate=walk.plates.names[plate], **wrong.along(axis))
    before, after = found.evidence["velocity_residual_m_s"].value
    assert after < min(0.65 * before, 0.85 * min(found.evidence["rivals_m_s"].value[:-1]))
    everywhere = [*force_directions(context_of(with_force(walk, lambda force: force * np.prod(signs, axis=0))))]
    assert [reported.code for reported in everywhere] == ["P232"]


@pytest.mark.parametrize("axis", [0, 2])
@pytest.mark.parametrize("plate", [0, 1])
def test_the_sign_of_one_plate_in_a_run(run, plate, axis):
    assert [*force_directions(context_of(run))] == []
    signs = np.ones((2, 3))
    signs[plate, axis] = -1.0
    wrong = context_of(with_force(run, lambda force: force * signs))
    (found,) = [*force_directions(wrong)]
    assert (found.code, found.where) == ("P233", wrong.at(plate=run.plates.names[plate], **wrong.along(axis)))


def misread(recording, plate, kind):
    """The recording with the axes of one plate exchanged, or rotated."""

    def change(force):
        wrong = force.copy()
        wrong[:, plate, 0], wrong[:, plate, 2] = force[:, plate, 2], force[:, plate, 0]
        if kind == "rotated":
            wrong[:, plate, 2] *= -1.0
        return wrong

    return with_force(recording, change)


@pytest.mark.parametrize("plate", [0, 1])
@pytest.mark.parametrize("kind", ["exchanged", "rotated"])
def test_the_axes_of_one_plate_in_a_run(run, plate, kind):
    found = [*force_directions(context_of(misread(run, plate, kind)))]
    assert [(reported.code, reported.evidence["plate"].value) for reported in found] == [
        ("P236", run.plates.names[plate])
    ]


@pytest.mark.parametrize("plate", [0, 1])
@pytest.mark.parametrize("kind", ["exchanged", "rotated"])
def test_the_axes_of_one_plate(walk, plate, kind):
    context = context_of(misread(walk, plate, kind))
    found = [*force_directions(context)]
    if not found:  # a plate that hardly counts in the frames that do, such as one of subject A
        apart = context.velocity_changes.by_forces - context.velocity_changes.centre
        assert np.linalg.norm(apart[:, [0, 2]].std(axis=0)) < 0.1
        return
    assert [(reported.code, reported.evidence["plate"].value) for reported in found] == [
        ("P236", walk.plates.names[plate])
    ]
    before, after = found[0].evidence["velocity_residual_m_s"].value
    assert after < 0.8 * before


@pytest.mark.parametrize("plate", [0, 1])
def test_both_signs_of_one_plate(walk, plate):
    """As of a plate whose corners are in the wrong order: one finding for each axis."""
    signs = np.ones((2, 3))
    signs[plate, [0, 2]] = -1.0
    found = [*force_directions(context_of(with_force(walk, lambda force: force * signs)))]
    assert [(reported.code, reported.where.plate) for reported in found] == [("P233", walk.plates.names[plate])] * 2


@pytest.mark.parametrize(
    ("plates", "axis", "newton"),
    [([0], 2, 50.0), ([0], 2, -50.0), ([1], 2, 50.0), ([1], 2, -50.0), ([0, 1], 2, 50.0), ([0, 1], 0, -50.0)],
)
def test_a_wrong_zero_is_not_called_a_wrong_sign(walk, newton, plates, axis):
    """Across the walk a foot pushes to one side all the time: reversed, it is nearly another zero, the runner-up; so
    is a gain of that axis.
    """
    zero = np.zeros((2, 3))
    zero[plates, axis] = newton
    wrong = context_of(with_force(walk, lambda force: force + zero * (force[..., 1:2] > 0.0)))
    along = [
        reported
        for reported in loaded(wrong.recording)
        if reported.where.axis == wrong.along(axis)["axis"] and reported.is_open
    ]
    assert len(along) == 1
    assert along[0].code in ("P212", "P214", "P222", "P233")
    if along[0].code in ("P222", "P233"):
        assert len(plates) == 1
    if along[0].code == "P233":
        assert along[0].where.plate == walk.plates.names[plates[0]]
        assert along[0].evidence["zero_offset_n"].value == pytest.approx(newton, abs=10)
        assert "the zero of the plate" in along[0].causes


def test_signs_over_two_windows(walk):
    """Each window has its own trend, and the number of samples that it has."""
    context = context_of(walk)
    trial = context.trial
    (start, end), *_ = trial.windows()
    cut = np.abs(trial.markers.time - (start + 0.45 * (end - start))) < 1.5 / trial.markers.rate_hz
    parted = replace(trial, measured=trial.measured & ~cut)
    assert len([window for window in parted.windows() if window[1] <= end]) == 2
    context.__dict__["velocities"] = force_velocities(parted, context.segment_of_label)
    assert [*force_directions(context)] == []


def test_fault_free_walks_on_one_belt(walk):
    """Of both feet only the sum is known, which is all that moves the body."""
    belt = context_of(on_one_plate(walk)).trial
    assert max(b - a for a, b in belt.windows()) < 0.7
    assert belt.total_force_windows()[0] == pytest.approx(context_of(walk).trial.windows()[0], abs=0.25)
    assert loaded(on_one_plate(walk)) == []


@pytest.mark.parametrize("axis", [0, 2])
def test_signs_on_one_belt(walk, axis):
    wrong = context_of(with_force(on_one_plate(walk), lambda force: force * (1.0 - 2.0 * np.eye(3)[axis])))
    (found,) = [*force_directions(wrong)]
    assert (found.code, found.where) == ("P232", wrong.at(**wrong.along(axis)))
    assert found.evidence["correlation"].value < -0.4


SIGNS = [([-1, 1, 1], "P232", 0), ([1, 1, -1], "P232", 2), ([-1, 1, -1], "P231", None)]


@pytest.mark.parametrize(("signs", "code", "axis"), SIGNS)
def test_signs(walk, signs, code, axis):
    wrong = with_force(walk, lambda force: force * signs)
    context = context_of(wrong)
    (found,) = [*force_directions(context)]
    assert (found.code, found.where) == (code, context.at(**({} if axis is None else context.along(axis))))
    # what it explains is not said twice
    assert codes(loaded(wrong)) == [code]
    if code == "P231":
        assert found.evidence["angle_rad"].value == pytest.approx(np.pi)
        assert sum("P232" in cause for cause in found.causes) == 2


@pytest.mark.parametrize(("signs", "code", "axis"), SIGNS)
def test_signs_in_a_run(run, signs, code, axis):
    context = context_of(with_force(run, lambda force: force * signs))
    (found,) = [*force_directions(context)]
    assert (found.code, found.where) == (code, context.at(**({} if axis is None else context.along(axis))))


@pytest.mark.parametrize("angle", [90, -90])
def test_rotated_forces(walk, angle):
    turn = Rotation.from_euler("y", angle, degrees=True).as_matrix()
    (found,) = [*force_directions(context_of(with_force(walk, lambda force: force @ turn.T)))]
    assert found.code == "P231"
    assert np.degrees(found.evidence["angle_rad"].value) == pytest.approx(angle)


CLINICS = named_here({"fmc": ("field/fmc/MH0222_BP06.c3d", None), "sydney": ("field/sydney/S4-AMGait03.c3d", None)})


@pytest.mark.parametrize("name", CLINICS)
@pytest.mark.parametrize("angle", [90, -90])
def test_rotated_forces_where_sideways_and_forward_velocities_go_together(recording_of, name, angle):
    """Of rotated forces, one axis opposes the motion there, and the other agrees with it."""
    turn = Rotation.from_euler("y", angle, degrees=True).as_matrix()
    recording = recording_of(*CLINICS[name])
    assert [*force_directions(context_of(recording))] == []
    (found,) = [*force_directions(context_of(with_force(recording, lambda force: force @ turn.T)))]
    assert found.code == "P231"
    assert np.degrees(found.evidence["angle_rad"].value) == pytest.approx(angle)


def test_forces_with_another_axis_up(walk):
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    plates = walk.plates
    up = replace(walk, plates=replace(plates, force=plates.force @ turn.T, moment=plates.moment @ turn.T))
    context = context_of(up)
    (found,) = [reported for reported in found_in(context) if reported.is_open]
    assert (found.code, found.where) == ("P201", context.at(**context.along(2)))
    assert found.evidence["peak_n"].value[2] == np.abs(plates.force[..., 1]).max()


def test_torques_in_newton_millimetres(walk):
    wrong = found_in(context_of(with_force(walk, lambda force: force, torque=1000.0)))
    found = [reported for reported in wrong if reported.code == "P203"]
    assert {reported.where.plate for reported in found} == set(walk.plates.names)
    assert min(reported.evidence["lever_arm_m"].value for reported in found) > 0.15


@pytest.mark.parametrize("name", SQUATS)
def test_fault_free_squats(recording_of, name):
    """The marker-based centre goes back where the centre of mass does not: the trunk bends."""
    squats = recording_of(*SQUATS[name])
    assert loaded(squats, marker_set_for(squats.markers.labels)) == []


def test_loads_that_no_foot_carries_are_not_judged(recording_of):
    """Without labels of feet there is no trial."""
    walk = recording_of(*WALKS["synthetic"])
    wrong = with_force(walk, lambda force: force * [-1, 1, -1])
    assert [*force_directions(RecordingContext(wrong))] == []
    marker_set = choose_marker_set(walk.markers.labels)
    assert [*force_directions(RecordingContext(replace(wrong, plates=None), marker_set))] == []


MEASURED_PLATES = here(["pig_c3d/subject_a_walk.c3d", "pig_c3d/subject_b_walk.c3d"])


def about_middles(plates):
    """Moments about the middles of the plates."""
    return plates.moment - np.cross(plates.corners.mean(axis=1)[None], plates.force)


@pytest.mark.parametrize("name", MEASURED_PLATES)
def test_a_force_and_the_vertical_moment_reversed_together(recording_of, name):
    """With the force alone put right, joint moments were 10 SD off."""
    recording = recording_of(name)
    plates = recording.plates
    force = plates.force * [1.0, 1.0, -1.0]
    for moment_sign, beside in ((-1.0, " and the vertical moment"), (1.0, "")):
        moment = about_middles(plates) * [1.0, moment_sign, 1.0]
        moment += np.cross(plates.corners.mean(axis=1)[None], force)
        (found,) = force_directions(context_of(replace(recording, plates=replace(plates, force=force, moment=moment))))
        assert (found.code, found.evidence["beside"].value) == ("P232", beside)


@pytest.mark.parametrize("name", ["synthetic/walk.c3d", *MEASURED_PLATES])
@pytest.mark.parametrize("plate", [0, 1])
def test_a_vertical_force_with_the_wrong_sign(recording_of, name, plate):
    """The reader turns the whole plate round, whose horizontal forces and corners were then accused."""
    recording = recording_of(name)
    plates = recording.plates
    turned = np.where(np.arange(len(plates.names)) == plate, -1.0, 1.0)[:, None]
    read_as = finding("F157", Where(plate=plates.names[plate]))
    force = plates.force * np.where(turned < 0.0, [-1.0, 1.0, -1.0], 1.0)
    moment = about_middles(plates) * turned + np.cross(plates.corners.mean(axis=1)[None], force)
    wrong = replace(recording, plates=replace(plates, force=force, moment=moment), findings=(read_as,))
    (found,) = vertical_signs(context_of(wrong))
    assert (found.code, found.where.plate) == ("P238", plates.names[plate])
    whole = replace(recording, findings=(read_as,))  # all channels had the other sign
    assert [*vertical_signs(context_of(whole))] == []
