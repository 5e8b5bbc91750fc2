from dataclasses import replace

import numpy as np
import pytest

from kinertia.errors import MarkerSetError, TrialError
from kinertia.findings.finding import finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.trial.data import FootLoads, Markers, PlateLoads, Recording
from kinertia.trial.file_contents import StatedContact
from kinertia.trial.ground_contact import CONTACT_MARGIN_S, CONTACT_SLACK_S, ground_contact
from kinertia.trial.plate_assignment import assign_plates, build_trial
from kinertia.trial.sampled_data import runs, within
from recordings import is_here
from walk_on_plates import ALL_STEPS, FEET, walk


def expect_window(trial, start_s, end_s):
    assert len(trial.windows()) == 1
    start, end = trial.windows()[0]
    assert start == pytest.approx(start_s, abs=0.02)
    assert end == pytest.approx(end_s, abs=0.02)


def test_which_plate_a_foot_stands_on():
    """Between two steps it is the plate nearest in time; a step of the right foot is on plates 1, 3, 5, 7."""
    loads = build_trial(walk(ALL_STEPS), FEET).loads
    assert loads.plates[2] == "plate 3"
    for plate, (side, number) in enumerate(ALL_STEPS[2:6], start=2):
        begin = (0.2 if side == "r" else 0.7) + number
        near = (loads.time > begin - 0.15) & (loads.time < begin + 0.75)
        assert (loads.plate_index[near, "rl".index(side)] == plate).all()


def test_a_foot_on_two_plates_counts_for_the_one_that_carries_more():
    recording = walk([("r", 0), ("l", 0)])
    share = np.array([0.7, 0.3])[:, None]
    double = replace(
        recording.plates,
        names=("a", "b", "c"),
        force=np.concatenate([recording.plates.force[:, :1] * share, recording.plates.force[:, 1:]], axis=1),
        moment=np.concatenate([recording.plates.moment[:, :1] * share, recording.plates.moment[:, 1:]], axis=1),
        declared_feet=(None,) * 3,
    )
    loads, _ = assign_plates(replace(recording, plates=double), FEET)
    assert (loads.plate_index[:, 0] == 0).all()
    assert (loads.plate_index[:, 1] == 2).all()
    np.testing.assert_allclose(loads.force[:, 0], recording.plates.force[:, 0])


def test_every_step_on_a_plate():
    trial = build_trial(replace(walk(ALL_STEPS), vertical="+Z"), FEET)
    assert trial.measured.all()
    assert trial.notes == ()
    assert trial.vertical == "+Z"
    sides = trial.loads.force[:, :, 1] > 0
    assert sides[:, 0].mean() == pytest.approx(0.6, abs=0.05)
    assert sides[:, 1].mean() == pytest.approx(0.6, abs=0.05)


def test_each_load_goes_to_the_foot_above_it():
    trial = build_trial(walk([("r", 0), ("l", 0), ("r", 1)]), FEET)
    right, left = (trial.loads.force[:, foot, 1] > 0 for foot in range(2))
    assert runs(right) == [(200, 799), (1200, 1799)]
    assert runs(left) == [(700, 1299)]
    recording = walk([("r", 0), ("l", 0), ("r", 1)])
    np.testing.assert_allclose(trial.loads.moment.sum(axis=1), recording.plates.moment.sum(axis=1))


@pytest.mark.parametrize("belt_m_s", [0.0, 0.6, 1.2])
def test_window_ends_where_a_foot_is_off_the_plates(belt_m_s):
    """On the floor, and on a treadmill."""
    trial = build_trial(walk(ALL_STEPS, belt_m_s=belt_m_s), FEET)
    assert trial.measured.all()
    trial = build_trial(walk([("r", 0), ("l", 0), ("r", 1)], belt_m_s=belt_m_s), FEET)
    expect_window(trial, 0.3 + CONTACT_MARGIN_S, 1.7 - CONTACT_MARGIN_S)


def test_a_leg_in_the_air_or_on_its_plate_is_known_whatever_the_other_does():
    """Right steps at 0.2 and 1.2 s for 0.6 s, left ones half a second later; one of each is on a plate."""
    trial = build_trial(walk([("r", 0), ("l", 0)]), FEET)
    time = trial.markers.time
    for foot, (landed_s, beside_s) in enumerate((((0.2, 0.8), (1.2, 1.8)), ((0.7, 1.3), (1.7, 2.3)))):
        assert trial.leg_known[within(time, landed_s[0], landed_s[1] + 0.35), foot].all(), "stance and swing"
        assert not trial.leg_known[within(time, beside_s[0] + 0.03, beside_s[1] - 0.05), foot].any()
        assert trial.on_ground[within(time, beside_s[0] + 0.03, beside_s[1] - 0.05), foot].all()
    np.testing.assert_array_equal(trial.measured & ~trial.leg_known.all(axis=1), False)
    assert (trial.leg_known.any(axis=1) & ~trial.measured).sum() > 50
    stated = build_trial(walk([("r", 0), ("l", 0)]), FEET, (0.5, 0.9))
    np.testing.assert_array_equal(stated.known_legs, np.repeat(stated.measured[:, None], 2, axis=1))


@pytest.mark.parametrize("step_m", [0.0, 0.1, 0.17, 0.25])
def test_level_ground_and_stairs(step_m):
    """A foot that stands on a step without a plate is on the ground, however high; all steps on plates are measured,
    two measure one step, and a missed one splits the window.
    """
    trial = build_trial(walk(ALL_STEPS, step_m=step_m), FEET)
    assert trial.measured.all()
    trial = build_trial(walk([step for step in ALL_STEPS if step != ("l", 0)], step_m=step_m), FEET)
    first, second = sorted(trial.windows())
    assert first == pytest.approx((0.0, 0.7 - CONTACT_MARGIN_S), abs=0.021)
    assert second == pytest.approx((1.3 + CONTACT_MARGIN_S, 2.99), abs=0.021)
    trial = build_trial(walk([("r", 0), ("l", 0)], step_m=step_m), FEET)
    expect_window(trial, 0.3 + CONTACT_MARGIN_S, 1.2 - CONTACT_MARGIN_S)


def standing(raised_m, weight_n=700.0, share=1.0, sway_m=0.0):
    """The right foot on a plate with this share of the weight from 1 s on, the left one beside it raised this much."""
    time, load_time = np.arange(0, 3, 0.01), np.arange(0, 3, 0.001)
    up = raised_m * np.clip((time - 0.5) / 0.5, 0, 1) + sway_m * np.sin(7 * time)
    places = [np.column_stack([0 * time + x, height, 0 * time + z])
              for z, height in ((0.1, 0 * time), (-0.1, up)) for x in (-0.1, 0.1)]  # fmt: skip
    right = np.where(load_time < 0.5, 0.5, np.where(load_time < 1.0, 1.0, share))
    force = np.zeros((len(load_time), 2, 3))
    force[:, 0, 1], force[:, 1, 1] = weight_n * right, weight_n * np.where(load_time < 0.5, 0.5, 0.0)
    moment = np.cross(np.array([[0.0, 0.0, 0.1], [0.0, 0.0, -0.1]]), force)
    markers = Markers(time, ("R.Heel", "R.Toe", "L.Heel", "L.Toe"), np.stack(places, axis=1))
    return Recording("standing", markers, PlateLoads(load_time, ("a", "b"), force, moment, (None, None)))


def test_a_foot_on_a_box_is_not_measured():
    trial = build_trial(standing(0.3, share=0.6), FEET)
    expect_window(trial, 0.0, 1.0 - CONTACT_MARGIN_S)


def test_a_foot_that_rolls_on_a_box_is_not_measured():
    """Its toes stay where they are: somebody about to step down from a landing without a plate lifts the heel."""
    recording = standing(0.3, share=0.6)
    rolling = recording.markers.positions.copy()
    rolling[:, 2, 1] += 0.04 * np.cos(7 * recording.markers.time)
    trial = build_trial(replace(recording, markers=replace(recording.markers, positions=rolling)), FEET)
    expect_window(trial, 0.0, 1.0 - CONTACT_MARGIN_S)


def test_a_marker_that_is_hidden_on_the_box_hides_no_other_frame():
    recording = without(standing(0.3, share=0.6), "L.Toe", 1.0, 3.0)
    trial = build_trial(replace(recording, markers=recording.markers.cut(0.0, 1.95)), FEET)
    expect_window(trial, 0.0, 1.0 - CONTACT_MARGIN_S)


@pytest.mark.parametrize("sway_m", [0.0, 0.02])
def test_a_foot_held_still_in_the_air_is(sway_m):
    assert build_trial(standing(0.3, share=1.0, sway_m=sway_m), FEET).measured.all()


def test_flight_between_measured_contacts_is_measured():
    running = walk(ALL_STEPS, stance_s=0.3, stride_m=3.0)
    trial = build_trial(running, FEET)
    flight = (trial.loads.force[:, :, 1] == 0).all(axis=1)
    assert flight.mean() > 0.3
    expect_window(trial, 0.2, 2.99)
    trial = build_trial(walk([("r", 0), ("l", 0), ("r", 1)], stance_s=0.3, stride_m=3.0), FEET)
    expect_window(trial, 0.2, 1.5)


def test_frames_without_forces_are_not_measured():
    recording = walk(ALL_STEPS)
    plates = recording.plates
    kept = (plates.time >= 0.5) & (plates.time < 2.0)
    cut = PlateLoads(plates.time[kept], plates.names, plates.force[kept], plates.moment[kept], plates.declared_feet)
    expect_window(build_trial(replace(recording, plates=cut), FEET), 0.5, 2.0)


def test_wrong_declared_foot_is_corrected():
    recording = walk([("r", 0), ("l", 0)])
    declared = replace(recording, plates=replace(recording.plates, declared_feet=("r", "r")))
    loads, (found,) = assign_plates(declared, FEET)
    assert (loads.force[800:1200, 1, 1] > 0).all()
    assert (found.code, found.where.trial, found.where.plate) == ("P277", "walk", "plate 2")
    assert found.where.span_s == pytest.approx((0.7, 1.299))
    assert [found.evidence[name].value for name in ("contacts", "declared", "foot")] == [1, "right", "left"]
    right = replace(recording, plates=replace(recording.plates, declared_feet=("r", "l")))
    assert assign_plates(right, FEET)[1] == ()


def merged(recording, columns):
    """The recording with these plates as one."""
    plates = recording.plates
    force, moment = (array[:, columns].sum(axis=1, keepdims=True) for array in (plates.force, plates.moment))
    return replace(recording, plates=PlateLoads(plates.time, ("belt",), force, moment, (None,)))


def test_plate_that_carries_both_feet_is_divided():
    recording = walk([("r", 0), ("l", 0)])
    loads, (found,) = assign_plates(merged(recording, [0, 1]), FEET)
    assert (loads.force[200:650, 0, 1] > 0).all()
    assert (loads.force[850:1300, 1, 1] > 0).all()
    np.testing.assert_allclose(loads.force.sum(axis=1), recording.plates.force.sum(axis=1))
    assert (found.code, found.where.plate) == ("P275", "belt")
    assert found.where.span_s == pytest.approx((0.2, 1.299))


def test_double_support_on_one_plate_is_not_measured():
    """The right foot stands to 0.8 s, the left one from 0.7 s on."""
    recording = walk(ALL_STEPS)
    trial = build_trial(merged(recording, range(8)), FEET)
    both = np.array([(recording.plates.force[:, [a, b], 1] > 0).all(axis=1) for a in range(8) for b in range(a)])
    double = np.interp(trial.markers.time, recording.plates.time, both.any(axis=0)) > 0.5
    assert double.any()
    assert not (trial.measured & double).any()
    assert trial.measured[~double].mean() > 0.6


def test_both_feet_on_one_plate_all_the_time_is_said():
    """Somebody who squats, swaying from foot to foot."""
    standing = walk([("r", 0)], stride_m=0.0, stance_s=0.99)
    markers = replace(standing.markers, positions=standing.markers.positions[[25]].repeat(300, axis=0))
    plates = standing.plates
    force = np.tile([0.0, 700.0, 0.0], (len(plates.time), 1, 1))
    sway = np.zeros_like(force)
    sway[:, 0, 2] = 0.05 * np.sin(2 * np.pi * 0.7 * plates.time)
    squats = replace(standing, markers=markers, plates=replace(plates, force=force, moment=np.cross(sway, force)))
    found = refused(squats)
    assert found.code == "P278"
    assert found.evidence["shared"].value > 0.5
    assert found.causes


def refused(recording, **more):
    """The finding of the error that no trial can be made of this recording."""
    with pytest.raises(TrialError) as caught:
        build_trial(recording, FEET, **more)
    return caught.value.finding


def test_noise_is_no_contact_and_short_gaps_are_none():
    recording = walk([("r", 0), ("l", 0)])
    force, moment = recording.plates.force.copy(), recording.plates.moment.copy()
    force[1500:1510, 0, 1] = 25.0
    force[400:410, 0] = moment[400:410, 0] = 0.0
    noisy = replace(recording, plates=replace(recording.plates, force=force, moment=moment))
    loads, (found,) = assign_plates(noisy, FEET)
    assert (found.code, found.where.plate, found.evidence["count"].value) == ("P273", "plate 1", 1)
    assert not loads.force[1400:].any()
    trial = build_trial(noisy, FEET)
    expect_window(trial, 0.3 + CONTACT_MARGIN_S, 1.2 - CONTACT_MARGIN_S)


def without(recording, label, start_s, end_s):
    markers = recording.markers
    positions = markers.positions.copy()
    gap = (markers.time >= start_s) & (markers.time <= end_s)
    positions[gap, markers.labels.index(label)] = np.nan
    return replace(recording, markers=Markers(markers.time, markers.labels, positions))


def test_lost_foot_markers():
    recording = walk([("r", 0), ("l", 0), ("r", 1)])
    expect_window(build_trial(without(recording, "L.Toe", 0.9, 1.0), FEET), 0.32, 1.68)
    expect_window(build_trial(without(recording, "R.Heel", 0.85, 0.95), FEET), 0.32, 1.68)
    lost = build_trial(without(without(recording, "R.Heel", 0.85, 1.15), "R.Toe", 0.85, 1.15), FEET)
    assert not lost.measured[88:112].any()
    with pytest.raises(MarkerSetError) as caught:
        build_trial(without(without(recording, "R.Heel", 0, 2), "R.Toe", 0, 2), FEET)
    assert caught.value.finding.code == "M104"


def test_users_window():
    recording = walk([("r", 0), ("l", 0)])
    trial = build_trial(recording, FEET, window_s=(0.1, 1.6))
    expect_window(trial, 0.1, 1.6)
    (found,) = trial.findings
    assert (found.code, found.where.span_s) == ("P274", (0.1, 1.6))
    assert found.evidence["spans"].value.startswith("0.3")
    beside = refused(recording, window_s=(7.0, 8.0))
    assert (beside.code, beside.where.span_s) == ("P278", (7.0, 8.0))
    assert beside.evidence["forces"].value.startswith("0.000 to ")


def test_nothing_measured_tells_when_feet_were_where():
    idle = walk([("r", 0)])
    idle = replace(idle, plates=replace(idle.plates, force=0 * idle.plates.force, moment=0 * idle.plates.moment))
    idle = replace(idle, findings=(finding("F151", Where(plate="plate 2"), reason=Quantity("it has no samples")),))
    found = refused(idle)
    assert found.code == "P278"
    assert found.evidence["right_plate"].value == "no frame"
    assert {"right_ground", "left_ground", "left_plate"} < set(found.evidence)
    assert "it has no samples" in found.evidence["left_out"].value


def test_a_leg_is_known_though_contact_is_never_complete():
    """The other foot stands beside the plate all the time."""
    slow = walk([("r", 0)], stance_s=0.95)
    trial = build_trial(replace(slow, markers=slow.markers.cut(0.25, 0.60)), FEET)
    assert not trial.measured.any()
    assert trial.leg_known[:, 0].all()
    assert not trial.leg_known[:, 1].any()
    assert trial.on_ground.all()


@pytest.mark.parametrize(("share", "known"), [(0.0, True), (0.2, True), (0.5, False)])
def test_not_if_the_centre_of_pressure_is_between_the_feet(share, known):
    """Then the plate may carry both; a foot that pushes off presses some way in front of its foremost marker."""
    slow = walk([("r", 0)], stance_s=0.95)
    markers, plates = slow.markers.cut(0.25, 0.60), slow.plates
    toe, heel = (markers.positions[:, markers.labels.index(label)].mean(axis=0) for label in ("R.Toe", "L.Heel"))
    place = toe + share * (heel - toe)
    moment = np.where(plates.force.any(axis=2, keepdims=True), np.cross(place * [1, 0, 1], plates.force), 0.0)
    moved = replace(slow, markers=markers, plates=replace(plates, moment=moment))
    if known:
        assert build_trial(moved, FEET).leg_known[:, 0].all()
    else:
        assert refused(moved).code == "P278"


def test_measured_frames_of_loads_that_are_sorted_already():
    recording = walk([("r", 0), ("l", 0)])
    loads, _ = assign_plates(recording, FEET)
    trial = build_trial(recording, FEET)
    np.testing.assert_array_equal(
        ground_contact(recording.markers, loads, FEET).measured(recording.markers.time), trial.measured
    )


def test_what_is_missing_is_named():
    recording = walk([("r", 0)])
    assert refused(replace(recording, plates=None)).code == "P271"
    assert refused(replace(recording, markers=recording.markers.cut(0.5, 0.5))).code == "T104"
    with pytest.raises(MarkerSetError, match=r"'R.Hel' \(nearest: R.Heel"):
        build_trial(recording, {**FEET, "r": ["R.Hel"]})


def clinic(side):
    return [f"{side}.Heel", f"{side}.Toe.Tip", f"{side}.Midfoot.Lat"]


PLUG_IN_GAIT = {"r": ["RHEE", "RTOE", "RANK"], "l": ["LHEE", "LTOE", "LANK"]}

CLINIC = {"r": clinic("R"), "l": clinic("L")}
WHOLE = {
    "synthetic": (("synthetic/walk.trc", "synthetic/walk_grf.mot", "synthetic/walk_grf.xml"), CLINIC, (1.09, 2.16)),
    "synthetic c3d": (("synthetic/walk.c3d",), PLUG_IN_GAIT, (1.09, 2.16)),
    "synthetic long": (("synthetic/long.trc", "synthetic/long_grf.mot"), CLINIC, (0.0, 3.7)),
    "synthetic run": (("synthetic/run.trc", "synthetic/run_grf.mot"), CLINIC, (0.0, 4.93)),
    "synthetic squats": (("synthetic/squats.trc", "synthetic/squats_grf.mot"), CLINIC, (0.0, 5.0)),
    "gait2354": (
        ("gait2354/subject01_walk1.trc", "gait2354/subject01_walk1_grf.mot", "gait2354/subject01_walk1_grf.xml"),
        CLINIC,
        (0.0, 2.5),
    ),
    "rajagopal": (
        ("rajagopal_walk/motion_capture_walk.trc", "rajagopal_walk/grf_walk.mot", "rajagopal_walk/grf_walk.xml"),
        {"r": ["R.Heel", "R.MT5", "R.Toe"], "l": ["L.Heel", "L.MT5", "L.Toe"]},
        (0.47, 1.96),
    ),
    "pig a": (("pig_c3d/subject_a_walk.c3d",), PLUG_IN_GAIT, (2.75, 3.59)),
    "pig b": (("pig_c3d/subject_b_walk.c3d",), PLUG_IN_GAIT, (2.63, 3.53)),
    **{
        name: (
            (f"subject4/{name}.trc", f"subject4/{name}_grf.mot", f"subject4/{name}_external_forces.xml"),
            {"r": ["r_calc", "r_5meta", "r_toe"], "l": ["L_calc", "L_5meta", "L_toe"]},
            window,
        )
        for name, window in {"walking1": (0.12, 1.3), "walking2": (0.12, 1.31), "squats1": (0.0, 13.45)}.items()
    },
}  # fmt: skip
"""Files, markers of the feet, and when all ground contact is measured: of the package's walk, which knows when feet
land and leave (`data/walk.csv`), between steps beside the plates; of the run up to its last flight."""
REAL = {name: files for name, files in WHOLE.items() if is_here(files[0])}


@pytest.fixture(scope="module")
def real(recording_of):
    def read(name):
        files, feet, window = REAL[name]
        return recording_of(*files), feet, window

    return read


@pytest.mark.parametrize("name", REAL)
def test_window_of_whole_trials(real, name):
    recording, feet, window = real(name)
    trial = build_trial(recording, feet)
    assert len(trial.windows()) == 1
    assert trial.windows()[0] == pytest.approx(window, abs=0.025)
    wrong = [reported for reported in trial.findings if reported.code == "P277"]
    assert len(wrong) == (1 if name in ("walking1", "walking2", "squats1") else 0)


MASSES = {
    "synthetic long": (0.5, 1.7325, 72.6),
    "gait2354": (0.62, 1.85, 72.6),
    "rajagopal": (0.6, 1.75, 85.0),
    "walking1": (0.13, 1.08, 60.0),
}
WALKS = ("synthetic c3d", "synthetic long", "gait2354", "rajagopal", "pig a", "pig b", "walking1", "walking2")


@pytest.mark.parametrize("name", [name for name in MASSES if name in REAL])
def test_measured_stride_carries_the_body(real, name):
    recording, feet, _ = real(name)
    start, end, mass_kg = MASSES[name]
    loads = build_trial(recording, feet).loads
    stride = (loads.time >= start) & (loads.time <= end)
    mean = loads.force[stride, :, 1].sum(axis=1).mean() / 9.80665
    assert mean == pytest.approx(mass_kg, rel=0.05)


@pytest.mark.parametrize("name", [name for name in WALKS if name in REAL])
def test_markers_find_contacts_whose_force_is_hidden(real, name):
    """Take the load away from one contact at a time and find it again from what the others taught."""
    recording, feet, _ = real(name)
    loads, _ = assign_plates(recording, feet)
    time = recording.markers.time
    loaded = ground_contact(recording.markers, loads, feet).loaded
    for foot in range(2):
        for first, last in runs(loaded[:, foot]):
            force = loads.force.copy()
            force[(loads.time >= time[first] - 0.02) & (loads.time <= time[last] + 0.02), foot] = 0.0
            ground = ground_contact(recording.markers, FootLoads(loads.time, force, loads.moment), feet).ground
            (contact,) = [run for run in runs(ground[:, foot]) if run[0] <= (first + last) // 2 <= run[1]]
            limit = CONTACT_SLACK_S + CONTACT_MARGIN_S + 1e-6
            assert abs(time[contact[0]] - time[first]) <= limit
            assert abs(time[contact[1]] - time[last]) <= limit


def test_a_stated_foot_goes_before_the_nearest_one():
    recording = walk([("r", 0), ("l", 0), ("r", 1)])
    plate = recording.plates.names[0]
    plain, _ = assign_plates(recording, FEET)
    stated = replace(recording, stated_contacts=(StatedContact(plate, 1, (0.1, 0.9)),))
    loads, findings = assign_plates(stated, FEET)
    first = (loads.time > 0.2) & (loads.time < 0.68)
    assert not loads.force[first, 0].any()
    np.testing.assert_allclose(loads.force[first, 1], plain.force[first, 0])
    later = loads.time > 1.3
    np.testing.assert_allclose(loads.force[later], plain.force[later])
    assert [(reported.code, reported.where.plate, reported.where.span_s) for reported in findings] == [
        ("P286", plate, (0.1, 0.9))
    ]


def test_a_load_that_is_stated_to_be_of_no_foot_is_not_used():
    recording = walk([("r", 0), ("l", 0)])
    plain, _ = assign_plates(recording, FEET)
    loads, _ = assign_plates(
        replace(recording, stated_contacts=(StatedContact(recording.plates.names[1], None),)), FEET
    )
    assert loads.force[:, 0].any()
    np.testing.assert_array_equal(loads.force[:, 0], plain.force[:, 0])
    assert not loads.force[:, 1].any()
