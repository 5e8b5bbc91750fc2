from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinertia.motion.gait_cycle import (
    FeetUnderPelvis,
    Stride,
    feet_under_pelvis,
    found_events,
    strides_of,
    turning_points,
)
from kinertia.motion.kinematics import Kinematics, solve_kinematics
from kinertia.motion.spatiotemporal import _double_support, spatiotemporal
from kinertia.synthetic.walk import walk, walking_subject
from kinertia.trial.data import FEET, LOAD_THRESHOLD_N, FootLoads, Trial
from kinertia.trial.file_contents import Belt, FileEvent
from kinertia.trial.sampled_data import rms, runs
from kinertia.trial.stances import contradicted_events, sides_exchanged

RATE = 100.0
FRAME = 1.0 / RATE


@pytest.fixture(scope="module")
def walked():
    return walk(walking_subject(), rate_hz=RATE, duration_s=4.0)


@pytest.fixture(scope="module")
def trial(walked) -> Trial:
    """Everything measured, but by markers and plates only."""
    loads = FootLoads(walked.time, walked.foot_loads[:, :, :3], walked.foot_loads[:, :, 3:])
    return Trial("walk", walked.markers, loads, np.ones(len(walked.time), dtype=bool))


def kinematics_of(walked, trial) -> Kinematics:
    return solve_kinematics(walked.skeleton, trial, 0.0, 12.0)


@pytest.fixture(scope="module")
def measured(walked, trial) -> Kinematics:
    return kinematics_of(walked, trial)


def contacts(walked, side) -> list[tuple[float, float]]:
    loaded = walked.foot_loads[:, FEET.index(side), 1] > LOAD_THRESHOLD_N
    spans = [(walked.time[a], walked.time[b]) for a, b in runs(loaded)]
    return [span for span in spans if span[0] > walked.time[0] and span[1] < walked.time[-1]]


def test_strides_run_from_contact_to_contact(walked, measured):
    strides = strides_of(walked.skeleton, measured)
    assert {stride.side for stride in strides} == set(FEET)
    for stride in strides:
        assert stride.on_plates
        starts = [start for start, _ in contacts(walked, stride.side)]
        assert min(abs(stride.start_s - start) for start in starts) < 1e-9
        ((_, off),) = [span for span in contacts(walked, stride.side) if span[0] == stride.start_s]
        assert stride.toe_off_s == off
        assert stride.opposite_toe_off_s < stride.opposite_strike_s < stride.toe_off_s < stride.end_s
    for side in FEET:
        of_side = [stride for stride in strides if stride.side == side]
        assert [stride.number for stride in of_side] == list(range(1, len(of_side) + 1))
        assert all(a.end_s == b.start_s for a, b in pairwise(of_side))


def test_where_no_plate_sees_a_contact_the_motion_tells_it(walked, trial, measured):
    """Plates for the first contact of each foot only; the other strides begin and end nearly where they did."""
    blind = trial.loads.time > 1.6
    force, moment = (np.where(blind[:, None, None], 0.0, part) for part in (trial.loads.force, trial.loads.moment))
    few = replace(trial, loads=replace(trial.loads, force=force, moment=moment), measured=trial.markers.time < 1.5)
    strides, known = (strides_of(walked.skeleton, k) for k in (kinematics_of(walked, few), measured))
    assert [(s.side, s.number) for s in strides] == [(s.side, s.number) for s in known]
    assert not all(stride.on_plates for stride in strides)
    gaps = [
        getattr(a, name) - getattr(b, name)
        for a, b in zip(strides, known, strict=True)
        for name in ("start_s", "end_s", "toe_off_s")
    ]
    assert np.abs(gaps).max() < 2.5 * FRAME
    assert rms(np.array(gaps)) > 0


def test_a_foot_without_markers_tells_no_events(walked, trial):
    """Its markers end at 2.0 s but for the heel's, and no plate sees a contact after 1.6 s."""
    blind = trial.loads.time > 1.6
    force, moment = (np.where(blind[:, None, None], 0.0, part) for part in (trial.loads.force, trial.loads.moment))
    positions = trial.markers.positions.copy()
    leg = {m.label for m in walked.skeleton.markers if m.segment in ("thigh_r", "shank_r", "foot_r")} - {"R_HEEL"}
    columns = [k for k, label in enumerate(trial.markers.labels) if label in leg]
    positions[np.ix_(trial.markers.time > 2.0, columns)] = np.nan
    few = replace(
        trial,
        markers=replace(trial.markers, positions=positions),
        loads=replace(trial.loads, force=force, moment=moment),
        measured=trial.markers.time < 1.5,
    )
    events = found_events(walked.skeleton, kinematics_of(walked, few))
    assert max(event.event.time_s for event in events if event.event.side == "r") < 2.0 + 2 * FRAME
    assert max(event.event.time_s for event in events if event.event.side == "l") > 3.0


def test_one_who_squats_takes_no_strides(walked, trial):
    """Both feet move back and forth under the pelvis, together."""
    time = walked.time
    q = np.tile(walked.motion.q[0], (len(time), 1))
    deep = 0.5 - 0.5 * np.cos(2 * np.pi * 0.5 * time)
    for name, range_rad in (("hip_flexion", 1.5), ("knee_angle", 1.7), ("ankle_angle", 0.4)):
        for side in FEET:
            q[:, walked.skeleton.coordinates.index(f"{name}_{side}")] = range_rad * deep
    positions = walked.skeleton.marker_positions(walked.skeleton.pose(q))
    squat = replace(trial, markers=replace(trial.markers, positions=positions))
    kinematics = kinematics_of(walked, squat)
    feet = feet_under_pelvis(walked.skeleton, kinematics)
    assert np.ptp(feet.ahead(feet.heel["r"])) > 0.15
    assert strides_of(walked.skeleton, kinematics) == ()


def test_lengths_on_a_belt_that_speeds_up(walked, trial):
    """Standing feet tell one speed for all strides; the stated one is each stride's."""
    time = walked.time
    belt = Belt(time, 0.6 + 0.5 * time)
    way = np.array([belt.distance_m(0.0, t) for t in time])
    slid = trial.markers.positions - way[:, None, None] * [1.0, 0.0, 0.0]
    kinematics = kinematics_of(walked, replace(trial, markers=replace(trial.markers, positions=slid)))
    strides = strides_of(walked.skeleton, kinematics)
    feet = feet_under_pelvis(walked.skeleton, kinematics)
    expected = [float(np.diff(np.interp([s.start_s, s.end_s], time, walked.motion.q[:, 0]))[0]) for s in strides]
    stated = [of_stride.stride_length_m for of_stride in spatiotemporal(feet, strides, belt)]
    np.testing.assert_allclose(stated, expected, rtol=0.01)
    by_feet = [of_stride.stride_length_m for of_stride in spatiotemporal(feet, strides)]
    assert np.abs(np.array(by_feet) / expected - 1).max() > 0.03


def test_lengths_on_two_belts(walked, measured, monkeypatch):
    """Each stride is as long as over ground, whether the speeds are stated or told by each foot."""
    strides, feet = strides_of(walked.skeleton, measured), feet_under_pelvis(walked.skeleton, measured)
    expected = [of_stride.stride_length_m for of_stride in spatiotemporal(feet, strides)]
    speeds = (1.4, 0.7)
    under = {side: speed * feet.time[:, None] * [1.0, 0.0, 0.0] for side, speed in zip(FEET, speeds, strict=True)}
    heel, toe = ({side: points[side] - under[side] for side in FEET} for points in (feet.heel, feet.toe))
    slid = replace(feet, heel=heel, toe=toe)
    with monkeypatch.context() as patched:  # this walker's standing feet slide, which cannot be told from a belt
        patched.setattr("kinertia.motion.spatiotemporal._BELT_M_S", 0.0)
        sliding = [of_stride.stride_length_m for of_stride in spatiotemporal(feet, strides)]
    np.testing.assert_allclose(sliding, expected, rtol=0.05)
    for belt, lengths in ((None, sliding), (Belt(np.zeros(1), np.array([speeds])), expected)):
        found = [of_stride.stride_length_m for of_stride in spatiotemporal(slid, strides, belt)]
        np.testing.assert_allclose(found, lengths, rtol=0.001)
    exchanged = [
        of_stride.stride_length_m
        for of_stride in spatiotemporal(slid, strides, Belt(np.zeros(1), np.array([speeds[::-1]])))
    ]
    assert np.abs(np.array(exchanged) / expected - 1).min() > 0.3


@pytest.mark.parametrize(("speed_m_s", "stance", "flat"), [(4.0, 0.35, 0.4), (1.2, 0.62, 0.6)])
def test_speed_on_a_belt_of_runners_whose_heels_rise_early(speed_m_s, stance, flat):
    """The toes stay on the belt until toe off; the heel turns about them from a share of stance on."""
    stride_s, length_m = 0.7, 0.2
    time = np.arange(0.0, 3 * stride_s, 0.005)

    def foot(phase):
        share = (time / stride_s + phase) % 1.0
        back = share / stance
        forth = -1.0 + 2.0 * (share - stance) / (1 - stance)
        on_ground = share < stance
        way = speed_m_s * stance * stride_s
        toe = np.where(on_ground, 0.5 - back, 0.5 * forth) * way
        lifted = 1.2 * np.clip((back - flat) / (1 - flat), 0.0, 1.0) * on_ground
        return toe, toe - length_m * np.cos(lifted)

    (right_toe, right_heel), (left_toe, left_heel) = foot(0.0), foot(0.5)
    line = [np.c_[x, 0 * x, 0 * x] for x in (right_heel, left_heel, right_toe, left_toe)]
    ahead = np.tile([1.0, 0.0, 0.0], (len(time), 1))
    feet = FeetUnderPelvis(
        time, ahead, 0 * ahead, dict(zip(FEET, line[:2], strict=True)), dict(zip(FEET, line[2:], strict=True))
    )
    half = stride_s / 2
    strides = [
        Stride("r", 1, 0.0, stride_s, stance * stride_s, np.nan, half, False),
        Stride("l", 1, half, half + stride_s, np.nan, np.nan, stride_s, False),
    ][: 1 if stance < 0.5 else 2]
    for of_stride in spatiotemporal(feet, strides):
        assert of_stride.speed_m_s == pytest.approx(speed_m_s, rel=0.01)


@pytest.mark.parametrize("turned", [0.0, 30.0])
@pytest.mark.parametrize("belt_m_s", [0.0, 1.2])
def test_lengths_and_speed_whatever_the_heading_and_on_a_belt(walked, trial, belt_m_s, turned):
    turn = Rotation.from_euler("y", turned, degrees=True).as_matrix()
    rotated = trial.rotated(turn)
    slid = rotated.markers.positions - (turn @ [belt_m_s, 0.0, 0.0]) * walked.time[:, None, None]
    kinematics = kinematics_of(walked, replace(rotated, markers=replace(rotated.markers, positions=slid)))
    strides = strides_of(walked.skeleton, kinematics)
    measures = spatiotemporal(feet_under_pelvis(walked.skeleton, kinematics), strides)
    assert len(measures) >= 4
    pelvis = walked.motion.q[:, 0]
    for stride, of_stride in zip(strides, measures, strict=True):
        start, end = np.interp([stride.start_s, stride.end_s], walked.time, pelvis)
        speed = (end - start) / (stride.end_s - stride.start_s)
        # this walker's standing toes slide by some cm/s, which on a belt cannot be told from the belt
        assert of_stride.speed_m_s == pytest.approx(speed, rel=0.03 if belt_m_s else 0.005)
        assert of_stride.stride_length_m == pytest.approx(of_stride.speed_m_s * of_stride.stride_time_s)
        assert of_stride.cadence_steps_min == pytest.approx(120 / of_stride.stride_time_s)
        assert 0.4 * of_stride.stride_length_m < of_stride.step_length_m < 0.6 * of_stride.stride_length_m
        assert 0.02 < of_stride.step_width_m < 0.25
    by_end = {stride.end_s: of_stride for stride, of_stride in zip(strides, measures, strict=True)}
    steps = [
        (by_end[stride.opposite_strike_s].step_length_m + of_stride.step_length_m, of_stride.stride_length_m)
        for stride, of_stride in zip(strides, measures, strict=True)
        if stride.opposite_strike_s in by_end
    ]
    assert len(steps) >= 2
    np.testing.assert_allclose(*zip(*steps, strict=True), rtol=0.005)
    for side in FEET:
        of_side = [of_stride for stride, of_stride in zip(strides, measures, strict=True) if stride.side == side]
        loaded = [(end - start) for start, end in contacts(walked, side)]
        assert of_side[0].stance_percent == pytest.approx(100 * loaded[0] / of_side[0].stride_time_s, abs=1.5)
    both = (walked.foot_loads[:, :, 1] > LOAD_THRESHOLD_N).all(axis=1)
    first = strides[0]
    inside = (walked.time >= first.start_s) & (walked.time < first.end_s)
    assert measures[0].double_support_percent == pytest.approx(100 * both[inside].mean(), abs=3.0)


def test_turning_points_are_maxima_that_rise_enough():
    time = np.arange(0, 10, 0.01)
    wave = np.sin(2 * np.pi * 0.5 * time) + 0.04 * np.sin(2 * np.pi * 9 * time)
    maxima = turning_points(wave, 0.5)
    np.testing.assert_allclose(time[maxima], [0.5, 2.5, 4.5, 6.5, 8.5], atol=0.06)
    assert turning_points(wave, 3.0) == []
    assert turning_points(np.arange(5.0), 0.5) == []  # still rising at its end


def stated(walked, delay_s=0.0, exchanged=False) -> tuple[FileEvent, ...]:
    """Every contact of both feet as a file states it."""
    other = {"r": "l", "l": "r"}
    events = []
    for side in FEET:
        for first, last in contacts(walked, side):
            for time, kind in ((first, "heel strike"), (last, "toe off")):
                events.append(FileEvent(time + delay_s, other[side] if exchanged else side, kind, "", kind))
    return tuple(sorted(events, key=lambda event: event.time_s))


def with_half_of_the_loads(trial) -> Trial:
    """Plates end in the middle of the recording."""
    half = trial.loads.time < trial.loads.time.mean()
    loads = replace(trial.loads, force=trial.loads.force * half[:, None, None])
    return replace(trial, loads=loads, measured=half)


def test_a_file_tells_the_events_that_plates_do_not_see(walked, trial):
    half = with_half_of_the_loads(trial)
    known = {round(first, 6) for side in FEET for first, _ in contacts(walked, side)}
    without = strides_of(walked.skeleton, kinematics_of(walked, half))
    given = strides_of(walked.skeleton, kinematics_of(walked, replace(half, events=stated(walked, delay_s=0.004))))
    assert len(given) >= len(without) > 2
    by_file, by_motion = (
        [stride for stride in strides if min(abs(stride.end_s - time - 0.004) for time in known) < 1e-9]
        for strides in (given, without)
    )
    assert len(by_file) >= 2
    assert not any(stride.on_plates for stride in by_file)
    assert by_motion == []


def test_events_that_a_cropped_file_kept_from_outside_its_frames_begin_no_stride(walked, trial):
    events = stated(walked)
    strikes = {side: [event for event in events if (event.side, event.kind) == (side, "heel strike")] for side in FEET}
    first, second, *_ = max(strikes.values(), key=lambda of_side: of_side[0].time_s)
    before = replace(first, time_s=2.0 * first.time_s - second.time_s)
    after = replace(first, time_s=walked.time[-1] + 0.5)
    assert before.time_s < walked.time[0]
    expected = strides_of(walked.skeleton, kinematics_of(walked, replace(trial, events=events)))
    found = strides_of(walked.skeleton, kinematics_of(walked, replace(trial, events=(before, *events, after))))
    assert found == expected
    assert min(stride.start_s for stride in found) >= walked.time[0]


@pytest.mark.parametrize("fault", [{"delay_s": 0.05}, {"exchanged": True}])
def test_events_that_forces_contradict_are_not_used(walked, trial, fault):
    half = with_half_of_the_loads(trial)
    contradicted = replace(half, events=stated(walked, **fault))
    assert bool(contradicted_events(contradicted)) == ("delay_s" in fault)
    assert sides_exchanged(contradicted) == ("exchanged" in fault)
    expected = strides_of(walked.skeleton, kinematics_of(walked, half))
    assert strides_of(walked.skeleton, kinematics_of(walked, contradicted)) == expected


def test_one_event_of_the_wrong_side_costs_no_stride(walked, trial):
    half = with_half_of_the_loads(trial)
    events = stated(walked)
    expected = strides_of(walked.skeleton, kinematics_of(walked, half))
    for k, event in enumerate(events[1:-1], start=1):
        wrong = replace(event, side="l" if event.side == "r" else "r")
        one_off = replace(half, events=(*events[:k], wrong, *events[k + 1 :]))
        assert strides_of(walked.skeleton, kinematics_of(walked, one_off)) == expected


def test_both_feet_are_on_the_ground_at_the_beginning_and_before_toe_off():
    """The other foot leaves at 0.12 s and lands at 0.55 s; the own foot leaves at 0.74 s, of 1.2 s."""
    stride = Stride("r", 1, 0.0, 1.2, 0.74, 0.12, 0.55, True)
    assert _double_support(stride) == pytest.approx(100.0 * (0.12 + 0.19) / 1.2)
    assert _double_support(replace(stride, toe_off_s=0.5)) == 0.0, "one who runs"
