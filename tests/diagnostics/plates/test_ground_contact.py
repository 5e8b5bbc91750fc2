"""Feet beside their plate, both feet on one, and the known false alarms of recordings from other laboratories."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.plates.cop_positions import cop_on_plate
from kinertia.diagnostics.plates.ground_contact import (
    compared_with_motion,
    complete_contact,
    coverage_of,
    plate_edges,
    stance_coverage,
)
from kinertia.findings.finding import Severity
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import Recording
from kinertia.trial.ground_contact import centre_of_pressure
from kinertia.trial.sampled_data import within
from loads_and_feet import context_of, doubted, place_findings
from people import person
from recordings import here
from walk_on_plates import FEET, walk

HALF_M = np.array([[1, 0, 1], [-1, 0, 1], [-1, 0, -1], [1, 0, -1]]) * [0.3, 0.0, 0.09]


def on_plates(behind_m=0.0, steps=(("r", 0), ("l", 0))):
    """A walk over plates of 0.6 m, which begin so much in front of where the first foot's heel marker stands."""
    recording = walk(list(steps))
    plates = recording.plates
    point = centre_of_pressure(np.concatenate((plates.force, plates.moment), axis=2))
    loaded = plates.force[..., 1] > 0
    middle = np.array([point[loaded[:, p], p].mean(axis=0) for p in range(len(plates.names))])
    middle[0, 0] += 0.2 + behind_m
    return replace(recording, plates=replace(plates, corners=middle[:, None] + HALF_M))


def marker_set(toes=False):
    """Heel and toe, or heel and metatarsals, of both feet."""
    front = "toe" if toes else "metatarsal"
    ends = {("heel", "Heel"), (front, "Toe")}
    landmarks = {f"{name}_{side}": (f"{side.upper()}.{label}",) for name, label in ends for side in "rl"}
    return MarkerSet("feet", landmarks, {f"foot_{side}": tuple(FEET[side]) for side in "rl"}, {})


def test_a_foot_on_its_plate():
    assert list(plate_edges(context_of(on_plates(), FEET))) == []
    assert list(plate_edges(context_of(walk([("r", 0)]), FEET))) == []  # nobody knows where that plate ends


def test_a_heel_behind_its_plate():
    context = context_of(on_plates(0.06), FEET)
    (found,) = plate_edges(context)
    assert (found.code, found.severity, found.where.plate) == ("P282", Severity.WARNING, "plate 1")
    assert found.evidence["overhang_m"].value == pytest.approx(0.06, abs=0.002)
    assert found.evidence["foot"].value == "right"
    (overhang,) = context.overhangs
    assert overhang.span_s == overhang.unmeasured_s == found.where.span_s
    span = overhang.span_s
    assert 0.15 <= span[0] < span[1] <= 0.85, "the markers of that foot are slow so long"


@pytest.mark.parametrize(("window_s", "count"), [((0.5, 1.5), 1), ((1.0, 1.5), 0)])
def test_a_step_that_a_stated_window_leaves_out_is_not_reported(window_s, count):
    assert len([*plate_edges(replace(context_of(on_plates(0.06), FEET), window_s=window_s))]) == count


@pytest.mark.parametrize(("lost_s", "lands_or_leaves_s"), [((0.0, 0.3), 0.2), ((0.7, 1.0), 0.8)])
def test_a_foot_that_lands_or_leaves_beside_its_plate(lost_s, lands_or_leaves_s):
    """The plate bears nothing before, or after; the foot stands all the same."""
    recording = on_plates(0.06 if lands_or_leaves_s == 0.2 else -0.2 - 0.24)
    lost = (recording.plates.time >= lost_s[0]) & (recording.plates.time < lost_s[1])
    plates = replace(
        recording.plates,
        force=np.where(lost[:, None, None], 0.0, recording.plates.force),
        moment=np.where(lost[:, None, None], 0.0, recording.plates.moment),
    )
    context = replace(context_of(replace(recording, plates=plates), FEET), marker_set=marker_set())
    (overhang,) = context.overhangs
    assert overhang.unmeasured_s[0] <= lands_or_leaves_s <= overhang.unmeasured_s[1]
    measured = context.trial_on_plates.measured
    there = np.abs(context.recording.markers.time - lands_or_leaves_s) < 0.01
    assert not measured[there].any()
    legs, before = context.trial_on_plates.known_legs, context.trial.known_legs
    assert not legs[there, overhang.foot].any()
    np.testing.assert_array_equal(legs[:, 1 - overhang.foot], before[:, 1 - overhang.foot])
    assert overhang.plate not in {whole.plate for whole in context.whole_contacts}


def test_a_heel_is_on_the_ground_where_it_is_low_under_load():
    """Its marker is lower while the foot lands; under load it stays on the ground all the same."""
    recording = on_plates(0.06)
    plates, time = recording.plates, recording.markers.time
    lost = (plates.time < 0.3)[:, None, None]
    plates = replace(plates, force=np.where(lost, 0.0, plates.force), moment=np.where(lost, 0.0, plates.moment))
    positions = recording.markers.positions.copy()
    positions[(time > 0.2) & (time < 0.28), 0, 1] -= 0.04
    landing = replace(recording, plates=plates, markers=replace(recording.markers, positions=positions))
    (overhang,) = context_of(landing, FEET).overhangs
    assert overhang.unmeasured_s[1] == pytest.approx(0.8, abs=0.05)


def test_a_foot_that_is_never_seen_under_load_is_over_no_edge():
    recording = on_plates(0.06)
    positions = recording.markers.positions.copy()
    positions[within(recording.markers.time, 0.19, 0.81), :2] = np.nan
    assert not context_of(replace(recording, markers=replace(recording.markers, positions=positions)), FEET).overhangs


def test_a_foot_on_two_plates_is_measured():
    recording = on_plates(0.06)
    corners = recording.plates.corners.copy()
    corners[1] = corners[0] - [0.6, 0.0, 0.0]
    together = replace(recording, plates=replace(recording.plates, corners=corners))
    assert list(plate_edges(context_of(together, FEET))) == []


@pytest.mark.parametrize(("inside_m", "found"), [(0.005, ["P282"]), (0.012, ["P282"]), (0.018, []), (0.035, [])])
def test_a_centre_of_pressure_nearer_to_an_edge_than_a_whole_foot(inside_m, found):
    """The markers are inside, the foot around them is not."""
    recording = on_plates()
    corners = recording.plates.corners.copy()
    corners[0, :, 2] += np.ptp(corners[0, :, 2]) / 2 - inside_m
    context = context_of(replace(recording, plates=replace(recording.plates, corners=corners)), FEET)
    assert [finding.code for finding in plate_edges(context)] == found
    if found:
        (overhang,) = context.overhangs
        assert overhang.overhang_m == pytest.approx(0.035 - inside_m, abs=0.002)
        assert overhang.unmeasured_s == overhang.span_s == (pytest.approx(0.2, abs=0.05), pytest.approx(0.8, abs=0.05))


def lifting_heels(recording, rise_s=0.15):
    """The same walk; heels rise to 60 mm in the last part of each stance of the right foot."""
    positions = recording.markers.positions.copy()
    before_off = np.mod(recording.markers.time - 0.2, 1.0) - (0.6 - rise_s)
    positions[:, 0, 1] += np.where((before_off > 0) & (before_off < rise_s), 0.06 * before_off / rise_s, 0.0)
    return replace(recording, markers=replace(recording.markers, positions=positions))


@pytest.mark.parametrize("toes", [True, False])
def test_a_toe_bears_load_once_the_heel_is_lifted(toes):
    """In front of its plate by 40 mm; the ball of a foot does all the time."""
    context = replace(context_of(lifting_heels(on_plates(-0.2 - 0.24)), FEET), marker_set=marker_set(toes))
    (found,) = plate_edges(context)
    (overhang,) = context.overhangs
    assert found.evidence["overhang_m"].value == pytest.approx(0.04, abs=0.002)
    begins = 0.2 + 0.6 - 0.15 * 5 / 6 if toes else overhang.span_s[0]
    assert overhang.unmeasured_s == (pytest.approx(begins, abs=0.02), pytest.approx(0.8, abs=0.05))
    time, measured = context.recording.markers.time, context.trial.measured
    lost = measured & ~context.trial_on_plates.measured
    assert time[lost].min() == pytest.approx(max(begins, time[measured].min()), abs=0.02)


def test_a_toe_without_marker():
    """The metatarsal heads are 20 mm from the edge, the big toe 10 mm or more beyond it."""
    recording = lifting_heels(on_plates(-0.2 - 0.18))
    context = replace(context_of(recording, FEET, height_m=1.82), marker_set=marker_set())
    (found,) = plate_edges(context)
    assert (found.code, found.where.plate) == ("P282", "plate 1")
    assert found.evidence["overhang_m"].value == pytest.approx(0.132 * 1.82 - 0.2 - 0.02, abs=0.002)
    assert context.overhangs[0].unmeasured_s[0] > 0.66
    assert list(plate_edges(replace(context, marker_set=marker_set(toes=True)))) == []
    assert list(plate_edges(replace(context, height_m=1.5))) == []


def test_nobody_is_weighed_by_a_foot_beyond_its_plate():
    context = context_of(on_plates(0.06), FEET)
    assert context.trial_on_plates.measured.sum() < context.trial.measured.sum()
    assert replace(context, window_s=(0.3, 0.9)).trial_on_plates.measured.sum() == pytest.approx(61, abs=1)


def test_centres_of_pressure_beside_their_plate():
    recording = on_plates()
    assert list(cop_on_plate(context_of(recording, FEET))) == []
    corners = recording.plates.corners + np.array([[[0.5, 0.0, 0.0]], [[0.05, 0.0, 0.0]]])
    (found,) = cop_on_plate(context_of(replace(recording, plates=replace(recording.plates, corners=corners)), FEET))
    assert (found.code, found.severity, found.where.plate) == ("P245", Severity.ERROR, "plate 1")
    assert found.evidence["share"].value == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(("light_n", "found"), [(110.0, []), (700.0, ["P245"])])
def test_what_counts_beside_the_plate_is_load_not_time(light_n, found):
    """110 N of a child's toes was 13 mm beyond an edge for 5.02 % of a contact, and 2.3 % of its load."""
    recording = on_plates()
    plates = recording.plates
    first = np.flatnonzero(plates.force[:, 0, 1] > 0)
    early = first[: len(first) // 12]
    force, moment = plates.force.copy(), plates.moment.copy()
    force[early, 0, 1] = light_n
    moment[early, 0] = np.cross(plates.corners[0].max(axis=0) + np.array([0.05, 0.0, 0.0]), force[early, 0])
    light = replace(recording, plates=replace(plates, force=force, moment=moment))
    assert [finding.code for finding in cop_on_plate(context_of(light, FEET))] == found


def test_no_forces_and_one_frame():
    """D7: one severity wherever it is asked."""
    recording = walk([("r", 0), ("l", 0)])
    for wrong, code in (
        (replace(recording, plates=None), "P271"),
        (replace(recording, markers=recording.markers.cut(0.5, 0.5)), "T104"),
    ):
        (found,) = [finding for finding in place_findings(wrong, FEET) if finding.severity is Severity.ERROR]
        assert found.code == code
        assert doubted(wrong, FEET, is_static=True) == []


def test_a_window_that_is_too_short():
    (found,) = place_findings(walk([("r", 0), ("l", 0)]), FEET, window_s=(0.5, 0.55))[1:]
    assert (found.code, found.evidence["frames"].value) == ("P279", 6)


def of_field(recording, feet, **landmarks):
    """A context with these markers on each foot ("HEEL" for "RHEEL" and "LHEEL")."""
    sides = {"r": "R", "l": "L"}
    named = {f"{name}_{s}": (sides[s] + label,) for name, label in landmarks.items() for s in sides}
    segments = {f"foot_{s}": tuple(sides[s] + label for label in feet) for s in sides}
    return replace(context_of(recording, {"r": [], "l": []}), marker_set=MarkerSet("feet", named, segments, {}))


def errors_and_warnings(context):
    return [
        finding.code
        for finding in place_findings(context.recording, context=context)
        if finding.severity > Severity.CORRECTED
    ]


@pytest.mark.parametrize("name", here(["field/lasem/walk01.c3d"]))
def test_feet_without_a_toe_marker_at_foot_off(recording_of, name):
    """The other foot is on the floor, half a metre ahead."""
    assert errors_and_warnings(of_field(recording_of(name), ["HEEL", "P5MT"], heel="HEEL", metatarsal="P5MT")) == []


@pytest.mark.parametrize("name", here(["field/lasem/sldj01.c3d", "field/lasem/sldj03.c3d"]))
def test_a_landing_from_a_box_has_no_other_rate(recording_of, name):
    context = of_field(recording_of(name), ["HEEL", "TOE", "P5MT", "P1MT"], heel="HEEL", toe="TOE")
    assert not set(errors_and_warnings(context)) & {"T201", "T211", "T212", "P252", "P243"}


@pytest.mark.parametrize("name", here([f"field/unipd/walking{k}.c3d" for k in (1, 3, 5)]))
def test_feet_that_are_hidden_for_a_while_are_not_displaced(recording_of, name):
    codes = errors_and_warnings(of_field(recording_of(name), ["CA", "VMH"], heel="CA", metatarsal="VMH"))
    assert set(codes) <= {"M104"}


BESIDE = {
    "field/biomechzoo/HC002D/turn.c3d": [("plate 2", "right", 0.018)],
    "field/biomechzoo/HC032A/turn.c3d": [("plate 1", "left", 0.084)],
    "field/biomechzoo/HC038A/turn.c3d": [("plate 1", "left", 0.036)],
    "field/biomechzoo/HC036A/turn.c3d": [],
    "field/biomechzoo/HC036A/straight.c3d": [],
    "pig_c3d/subject_a_walk.c3d": [],
    "pig_c3d/subject_b_walk.c3d": [("plate 1", "right", 0.045)],
}


@pytest.mark.parametrize("name", here(BESIDE))
def test_feet_of_other_laboratories(recording_of, name):
    found = [finding for finding in place_findings(recording_of(name)) if finding.code == "P282"]
    expected = BESIDE[name]
    assert [(finding.where.plate, finding.evidence["foot"].value) for finding in found] == [
        wanted[:2] for wanted in expected
    ]
    assert [finding.evidence["overhang_m"].value for finding in found] == pytest.approx(
        [wanted[2] for wanted in expected], abs=0.01
    )


@pytest.mark.parametrize("name", here([f"field/opensim_core/{name}.c3d" for name in ("walking2", "test_walking")]))
def test_a_heel_that_lands_before_the_plate_is_no_other_trial(recording_of, name):
    recording = recording_of(name)
    context = of_field(recording, ["CAL", "MT1", "MT2"], heel="CAL", metatarsal="MT2")
    assert set(errors_and_warnings(context)) == {"P282"}
    assert max(overhang.overhang_m for overhang in context.overhangs) > 0.12
    # with the heel alone nobody knows when a foot leaves the ground
    heel = of_field(recording, ["CAL"], heel="CAL", metatarsal="MT5")
    assert not set(errors_and_warnings(heel)) & {"T211", "T212", "T201", "P243", "P244"}


def test_toes_without_a_marker_are_still_the_foot():
    """At foot off the load is under them."""
    foot = context_of(on_plates(), FEET).foot_trajectories[0]
    time = np.array([0.6])
    end = foot.front[60] + 0.3 * (foot.front[60] - foot.back[60])
    assert np.linalg.norm(foot.offset_m(time, end[None])) == pytest.approx(0.06, abs=1e-3)
    assert np.linalg.norm(foot.with_toes().offset_m(time, end[None])) == pytest.approx(0.0, abs=1e-6)


def test_single_legs_are_known_where_contact_is_never_complete():
    """P290, a WARNING; without enough frames of a leg P279."""
    slow = walk([("r", 0)], stance_s=0.95)
    found = list(complete_contact(context_of(replace(slow, markers=slow.markers.cut(0.25, 0.60)), FEET)))
    (finding,) = [reported for reported in found if reported.code == "P290"]
    assert (finding.severity.name, finding.evidence["foot"].value, finding.evidence["frames"].value) == (
        "WARNING",
        "right",
        36,
    )
    few = list(complete_contact(context_of(replace(slow, markers=slow.markers.cut(0.25, 0.33)), FEET)))
    assert [reported.code for reported in few] == ["P279"]


@pytest.mark.parametrize(("until_s", "expected"), [((0.62,), ["P291"]), ((0.68,), []), ((0.62, 0.68), [])])
def test_forces_are_compared_with_motion_where_contact_is_measured_for_long_enough(until_s, expected):
    """P291 below 0.4 s in all trials."""
    short = walk([("r", 0)], stance_s=0.55)
    trials = [context_of(replace(short, markers=short.markers.cut(0.0, end_s)), FEET) for end_s in until_s]
    assert [finding.code for finding in compared_with_motion(replace(person(), trials=trials))] == expected


def found(*recordings: Recording):
    """Code, severity, side and phase of what is found in walks."""
    contexts = [context_of(recording, FEET) for recording in recordings]
    rows = list(stance_coverage(replace(person(), trials=contexts)))
    phases = [finding.evidence["phase"].value if "phase" in finding.evidence else "" for finding in rows]
    return [
        (finding.code, finding.severity, finding.evidence["side"].value, phase)
        for finding, phase in zip(rows, phases, strict=True)
    ]


def until(recording: Recording, end_s: float) -> Recording:
    """The recording with plates that measure nothing after this time."""
    plates = recording.plates
    late = plates.time > end_s
    force, moment = plates.force.copy(), plates.moment.copy()
    force[late] = moment[late] = 0.0
    return replace(recording, plates=replace(plates, force=force, moment=moment))


BOTH = walk([("r", 1), ("l", 1)])


CUT = until(BOTH, 2.1)
"""The left foot stands from 1.7 to 2.3 s."""


def test_two_whole_stances_are_enough():
    assert found(BOTH) == []


def test_a_stance_without_push_off():
    assert found(CUT) == [("P272", Severity.WARNING, "left", "push-off")]


def test_another_walk_has_it():
    assert found(CUT, replace(walk([("l", 1)]), name="walk 2")) == []


def test_a_window_that_the_user_states_is_meant():
    windowed = context_of(CUT, FEET, window_s=(1.2, 1.9))
    assert list(stance_coverage(replace(person(), trials=[windowed]))) == []
    assert found(CUT) != []


def test_a_leg_that_no_plate_measures_is_no_warning():
    assert found(walk([("r", 1)])) == [("P289", Severity.INFO, "left", "")]


def test_recordings_without_strides_have_none(recording_of):
    squats = recording_of("synthetic/squats.trc", "synthetic/squats_grf.mot")
    context = RecordingContext(squats, choose_marker_set(squats.markers.labels))
    assert coverage_of(context) == ()
    assert list(stance_coverage(replace(person(), trials=[context]))) == []


MEASURED = {
    "pig_c3d/subject_a_walk.c3d": [],
    "pig_c3d/subject_b_walk.c3d": [("right", ("loading response", "mid-stance"))],
    "field/biomechzoo/HC030A/straight.c3d": [],
    "field/biomechzoo/HC002D/straight.c3d": [],
    "field/biomechzoo/HC038A/turn.c3d": [("left", ("mid-stance", "push-off"))],
    "field/biomechzoo/HC036A/turn.c3d": [("left", ("loading response", "mid-stance", "push-off"))],
}


@pytest.mark.parametrize("name", here(MEASURED))
def test_measured_walks(recording_of, name):
    recording = recording_of(name)
    legs = coverage_of(RecordingContext(recording, choose_marker_set(recording.markers.labels)))
    assert [(leg.word, leg.missing) for leg in legs if leg.missing] == MEASURED[name]
