"""Loads that are not under the feet, or not when they stand, are named by their cause; fault-free ones never are."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.diagnostics.plates import cop_positions, steps
from kinertia.diagnostics.plates.steps import shows_feet_equally
from kinertia.findings.finding import Severity
from kinertia.findings.quantity import Where
from kinertia.trial.data import Markers
from kinertia.trial.ground_contact import centre_of_pressure
from kinertia.trial.sampled_data import runs
from loads_and_feet import context_of, doubted, error_of, feet_of, on_one_plate, place_findings
from recordings import NEEDS_MEASURED, QUICK_WALKS, RUNS, SQUATS, WALKS, slow_beside
from walk_on_plates import ALL_STEPS
from walk_on_plates import FEET as SIMPLE_FEET
from walk_on_plates import walk as simple_walk

ON_BELTS = {
    **{f"run, {name}": RUNS[name] for name in RUNS if name != "hamner"},
    **{f"walk, {name}": WALKS[name] for name in ("synthetic", "gait2354") if name in WALKS},
}


BESIDE_M = {"synthetic": -0.008, "synthetic c3d": -0.010}
"""Along Z, from the line between heel and toe to the centres of pressure of the package's walk."""


@pytest.fixture(params=slow_beside(QUICK_WALKS, WALKS))
def name(request):
    return request.param


@pytest.fixture
def walk(name, recording_of):
    """A walk and the labels of its feet."""
    recording = recording_of(*WALKS[name])
    return recording, feet_of(recording)


def moved(recording, offset_m, factor=1.0):
    """Centres of pressure times a factor, and somewhere else."""
    plates = recording.plates
    point = centre_of_pressure(np.concatenate((plates.force, plates.moment), axis=2))
    to = factor * point + np.array(offset_m)
    return replace(recording, plates=replace(plates, moment=plates.moment + np.cross(to - point, plates.force)))


def shifted(recording, by_s):
    """Forces later by so much."""
    plates = recording.plates
    rows = round(by_s / float(plates.time[1] - plates.time[0]))
    earlier = np.clip(np.arange(len(plates.time)) - rows, 0, len(plates.time) - 1)
    late = replace(plates, force=plates.force[earlier], moment=plates.moment[earlier])
    return replace(recording, plates=late)


@pytest.mark.parametrize("offset_m", [0.05, -0.05])
def test_offsets_across_the_walk(name, walk, offset_m):
    recording, feet = walk
    (found,) = [
        finding for finding in place_findings(moved(recording, (0.0, 0.0, offset_m)), feet) if finding.code == "P243"
    ]
    assert found.severity is Severity.WARNING
    assert found.evidence["offset_m"].value[1] == pytest.approx(offset_m + BESIDE_M.get(name, 0.0), abs=0.01)


@pytest.mark.parametrize(
    ("lacking", "alike"), [((), True), (("R.Toe.Lat",), False), (("R.Toe.Tip", "L.Toe.Tip"), True)]
)
def test_a_foot_that_lacks_a_marker_is_no_measure_of_the_laboratory(lacking, alike):
    """Its line from heel to toe is another one than the other foot's: by 63 mm in a walk that was seen."""
    landmarks = {
        f"{name}_{side}": tuple(f"{side.upper()}.{label}" for label in labels)
        for side in "rl"
        for name, labels in (("heel", ("Heel",)), ("metatarsal", ("Toe.Lat", "Toe.Med")), ("toe", ("Toe.Tip",)))
    }
    seen = frozenset(label for labels in landmarks.values() for label in labels if label not in lacking)
    context = SimpleNamespace(marker_set=SimpleNamespace(landmarks=landmarks), seen_labels=seen)
    assert shows_feet_equally(context) is alike


@pytest.mark.parametrize("offset_m", [0.3, -0.3])
def test_other_origins(walk, offset_m):
    recording, feet = walk
    assert set(doubted(moved(recording, (offset_m, 0.0, 0.0)), feet)) & {"P243", "P244"}


@pytest.mark.parametrize("offset_m", [0.1, -0.1])
def test_offsets_along_the_walk(name, walk, offset_m):
    """As long as loads lie along the foot: where they begin and end tells. Synthetic ones begin at the heel itself."""
    recording, feet = walk
    ahead_m = 0.02 if name.startswith("synthetic") and offset_m > 0 else 0.0
    found = place_findings(moved(recording, (offset_m + ahead_m, 0.0, 0.0)), feet)
    assert "P243" in [finding.code for finding in found if finding.is_open]
    along = [finding.evidence["offset_m"].value for finding in found if "begin_m" in finding.evidence]
    assert all(np.sign(offset) == np.sign(offset_m * direction(recording)) for offset in along)


@pytest.mark.parametrize(("offset_m", "expected"), [(0.033, []), (-0.033, []), (0.037, ["P243"]), (-0.037, ["P243"])])
def test_the_load_of_the_only_measured_foot_is_near_its_axis(offset_m, expected):
    """Heel and second metatarsal are the axis; with other markers nobody knows where it is."""
    recording = moved(simple_walk([("r", 0)]), (0.0, 0.0, offset_m))
    assert doubted(recording, SIMPLE_FEET) == expected
    one_marker_more = {"r": (*SIMPLE_FEET["r"], SIMPLE_FEET["l"][0]), "l": SIMPLE_FEET["l"]}
    assert "P243" not in doubted(recording, one_marker_more)


STATURES_M = {"gait2354": 1.803, "plug-in gait a": 1.61}


def of_one_foot(recording, feet, height_m):
    """Its right step alone on plates: no other foot shows where the plates are."""
    contacts = [contact for contact in context_of(recording, feet, height_m=height_m).contacts if contact.foot == 1]
    (start_s, end_s) = contacts[0].start_s, contacts[0].end_s
    plates = recording.plates
    kept = ((plates.time > start_s - 0.02) & (plates.time < end_s + 0.02))[:, None, None]
    kept = kept & (np.arange(len(plates.names)) == contacts[0].plate)[None, :, None]
    return replace(recording, plates=replace(plates, force=plates.force * kept, moment=plates.moment * kept))


@pytest.mark.parametrize("name", [name for name in STATURES_M if name in WALKS])
@pytest.mark.parametrize("one_foot", [False, True])
def test_offsets_of_50_mm_along_the_walk(name, recording_of, one_foot):
    """Loads then lie farther back, or forward, than feet of this person are long; on one plate with one step, too."""
    recording, height_m = recording_of(*WALKS[name]), STATURES_M[name]
    feet = feet_of(recording)
    recording = of_one_foot(recording, feet, height_m) if one_foot else recording
    assert "P243" not in doubted(recording, feet, height_m=height_m)
    for offset_m in (0.05, -0.05):
        found = place_findings(moved(recording, (offset_m, 0.0, 0.0)), feet, height_m=height_m)
        (along,) = [answer for answer in found if answer.code == "P243" and answer.is_open]
        assert np.size(along.evidence["offset_m"].value) == 2 or (
            along.evidence["offset_m"].value == pytest.approx(offset_m * direction(recording), abs=0.025)
        )


@pytest.mark.skipif("gait2354" not in WALKS, reason=NEEDS_MEASURED)
def test_how_far_loads_may_lie_along_feet(recording_of):
    recording = recording_of(*WALKS["gait2354"])
    feet = feet_of(recording)
    recording = of_one_foot(recording, feet, 1.803)

    def excess_m(offset_m):
        found = place_findings(moved(recording, (offset_m, 0.0, 0.0)), feet, height_m=1.803)
        return [answer.evidence["offset_m"].value for answer in found if answer.code == "P243"]

    (ahead,), (behind,) = excess_m(0.06), excess_m(-0.06)
    assert not excess_m(0.06 - ahead + 0.0415)
    assert excess_m(0.06 - ahead + 0.0425)
    assert not excess_m(-0.06 - behind - 0.0255)
    assert excess_m(-0.06 - behind - 0.0265)
    assert not place_findings(moved(recording, (-0.06, 0.0, 0.0)), feet)


@pytest.mark.parametrize(
    ("begin_mm", "push_off_mm", "found"), [(-58, -14, True), (-58, -12, False), (20, 65, False), (22, 65, True)]
)
def test_an_offset_moves_both_where_loads_begin_and_where_they_push_off(monkeypatch, begin_mm, push_off_mm, found):
    """A person of 1.8 m on whose foot either lies so far in front of where it is on other people."""
    monkeypatch.setattr(steps, "_bears_elsewhere", lambda step, context: False)
    ahead_m = 1.8 * np.array([0.033, 0.107]) + 1e-3 * np.array([begin_mm, push_off_mm])
    step = SimpleNamespace(is_step=True, ahead_m=lambda shares: ahead_m)
    context = SimpleNamespace(height_m=1.8, whole_contacts=[step], at=lambda: Where())
    assert bool(list(cop_positions._along_feet(context, [step]))) is found


def direction(recording):
    """1 of somebody who walks along +X."""
    way = np.nanmedian(recording.markers.positions[-1, :, 0] - recording.markers.positions[0, :, 0])
    return 1.0 if abs(way) < 0.5 or way > 0 else -1.0


def test_points_in_mm(walk):
    recording, feet = walk
    found = [
        finding for finding in place_findings(moved(recording, (0.0, 0.0, 0.0), factor=1000.0), feet) if finding.is_open
    ]
    assert {finding.code for finding in found if finding.severity is Severity.ERROR} == {"P204"}
    assert min(finding.evidence["distance_m"].value for finding in found if finding.code == "P204") > 5.0


@pytest.mark.parametrize("by_s", [-0.12, 0.09, 0.2])
def test_delays(walk, by_s):
    recording, feet = walk
    found = error_of(shifted(recording, by_s), feet)
    assert found.code == "T211"
    assert found.evidence["delay_s"].value == pytest.approx(by_s, abs=0.035)


@pytest.mark.parametrize("delay_s", [-0.015, 0.015])
def test_what_the_estimate_corrects_is_no_error(walk, delay_s):
    recording, feet = walk
    assert error_of(shifted(moved(recording, (0.02, 0.0, 0.0)), delay_s), feet) is None


def slowed(recording, factor):
    """With times between frames that are so many times as long."""
    markers = recording.markers
    time = markers.time[0] + factor * (markers.time - markers.time[0])
    return replace(recording, markers=Markers(time, markers.labels, markers.positions))


@pytest.mark.parametrize("factor", [0.5, 1.5, 2.0])
def test_rates(name, walk, factor):
    """Where half the rate is not shown by when feet land and leave, it is by how long they stand."""
    recording, feet = walk
    found = error_of(slowed(recording, factor), feet)
    assert found.code == "T201"
    assert found.evidence["ratio"].value == pytest.approx(1 / factor, rel=0.08 if factor == 2.0 else 0.05)


def test_a_walk_on_one_long_plate(walk):
    """A load that goes from foot to foot is no long stance."""
    recording, feet = walk
    on_plate = on_one_plate(recording)
    assert error_of(on_plate, feet) is None


@pytest.mark.parametrize("name", SQUATS)
def test_squats_on_one_plate(recording_of, name):
    """The load is between the feet all the time: not of another trial, but both feet on one plate."""
    squats = recording_of(*SQUATS[name])
    feet = feet_of(squats)
    on_plate = on_one_plate(squats)
    assert error_of(on_plate, feet) is None
    assert "P276" in doubted(on_plate, feet)


@pytest.mark.parametrize("stride_m", [1.2, 0.9])
def test_a_made_up_walk(stride_m):
    assert doubted(simple_walk(ALL_STEPS, stride_m=stride_m), SIMPLE_FEET) == []


def on_plates(recording):
    """With plates of 0.6 m squared in the middle of each load."""
    plates = recording.plates
    point = centre_of_pressure(np.concatenate((plates.force, plates.moment), axis=2))
    loaded = plates.force[..., 1] > 0
    middle = [point[loaded[:, p], p].mean(axis=0) for p in range(len(plates.names))]
    size = 0.3 * np.array([[1, 0, 1], [-1, 0, 1], [-1, 0, -1], [1, 0, -1]])
    return replace(recording, plates=replace(plates, corners=np.array([place + size for place in middle])))


@pytest.mark.parametrize("steps", [2, 5])
def test_plates_that_are_interchanged(steps):
    """The first and the last; beside three sound ones these are no loads of somebody else."""
    recording = on_plates(simple_walk([("r", 0), ("l", 0), ("r", 1), ("l", 1), ("r", 2)][:steps]))
    assert doubted(recording, SIMPLE_FEET) == []
    plates = recording.plates
    middle = plates.corners.mean(axis=1)
    order = np.array([steps - 1, *range(1, steps - 1), 0])
    moment = plates.moment + np.cross(middle[order] - middle, plates.force)  # to the other plate's place
    wrong = replace(plates, force=plates.force[:, order], moment=moment[:, order])
    assert doubted(replace(recording, plates=wrong), SIMPLE_FEET) == ["P241"]
    found = error_of(replace(recording, plates=wrong), SIMPLE_FEET)
    assert [found.evidence[name].value for name in ("plate", "other")] == ["plate 1", f"plate {steps}"]
    assert found.evidence["after_m"].value < 0.08 < 0.15 < found.evidence["before_m"].value


@pytest.mark.parametrize("apart_m", [0.5, -0.4])
@pytest.mark.parametrize("name", slow_beside(("run, synthetic", "walk, gait2354"), ON_BELTS))
def test_belts_that_are_interchanged(recording_of, name, apart_m):
    """Each load lies on the other belt, and goes there as it would on its own."""
    run = recording_of(*ON_BELTS[name])
    feet = feet_of(run)
    offset_m = np.array([[0.0, 0.0, apart_m], [0.0, 0.0, -apart_m]])
    found = error_of(moved(run, offset_m), feet)
    assert found.code == "P241"
    assert found.evidence["before_m"].value == pytest.approx(abs(apart_m), abs=0.04)
    one_off = error_of(moved(run, np.array([[0.0, 0.0, apart_m], [0.0, 0.0, 0.0]])), feet)
    assert one_off is None or one_off.code != "P241"


def test_both_feet_on_a_plate():
    """The left foot lands on the right foot's plate, and comes to its own later."""
    recording = simple_walk([("r", 0), ("l", 0)])
    wrong = with_left_foot_on_first_plate(recording, 0.7, 0.78)  # both are down from 0.7 to 0.8 s
    (found,) = [finding for finding in place_findings(wrong, SIMPLE_FEET) if finding.severity > Severity.CORRECTED]
    assert (found.code, found.where.plate) == ("P276", "plate 1")
    assert found.where.span_s == pytest.approx((0.7, 0.78), abs=0.01)


def with_left_foot_on_first_plate(recording, from_s, to_s):
    """The recording with the load of the second plate on the first for a while."""
    plates = recording.plates
    force, moment = plates.force.copy(), plates.moment.copy()
    rows = (plates.time >= from_s) & (plates.time < to_s)
    for part in (force, moment):
        part[rows, 0] += part[rows, 1]
        part[rows, 1] = 0.0
    return replace(recording, plates=replace(plates, force=force, moment=moment))


def test_a_load_of_both_feet_is_no_measure_of_where_a_plate_is():
    """A child's second foot on the plate displaced it by 42 mm, and mirrored its centre of pressure."""
    shared = with_left_foot_on_first_plate(simple_walk([("r", 0), ("l", 0)]), 0.7, 0.85)
    context = context_of(shared, SIMPLE_FEET)
    assert not {"P243", "P252"} & {finding.code for finding in place_findings(shared, SIMPLE_FEET)}
    before, after = context.trial.windows(), context.trial_on_plates.windows()
    assert max(end for _, end in before) > 0.75
    assert max(end for _, end in after if end < 0.85) <= 0.71


def test_the_first_of_two_steps_in_turn_on_a_belt_is_not_shared():
    """The file begins late in it, so that most of the load is the second foot's, which swings until 0.7 s."""
    belt = on_one_plate(simple_walk([("r", 0), ("l", 0)]))
    plates = belt.plates
    late = plates.time > 0.45
    cut = replace(plates, time=plates.time[late], force=plates.force[late], moment=plates.moment[late])
    context = context_of(replace(belt, plates=cut), SIMPLE_FEET)
    (shared,) = context.shared_loads
    assert shared.contact.foot == 1
    assert 0.55 < shared.span_s[0] <= 0.7  # a foot may bear load just before it stands
    assert context.trial_on_plates.measured.any()


def on_the_toes(recording, rise_m):
    """The walk of somebody whose heels stay in the air by so much, and whose loads are under the toes."""
    places = recording.markers.positions.copy()
    places[:, [0, 2], 1] += rise_m
    return replace(moved(recording, (0.12, 0.0, 0.0)), markers=replace(recording.markers, positions=places))


def test_loads_under_the_toes_of_somebody_who_walks_on_them():
    """Loads that begin 170 mm in front of the heel were those of displaced plates."""
    walk = simple_walk([("r", 0), ("l", 0)])
    assert doubted(on_the_toes(walk, 0.0), SIMPLE_FEET) == ["P243"]
    assert doubted(on_the_toes(walk, 0.08), SIMPLE_FEET) == []
    assert "P243" in doubted(moved(on_the_toes(walk, 0.08), (0.0, 0.0, 0.05)), SIMPLE_FEET)


def test_both_feet_explain_feet_in_turn():
    """D20: one load is told once."""
    recording = simple_walk([("r", 0), ("l", 0)])
    on_plate = on_one_plate(recording)
    found = {finding.code: finding.muted_by for finding in place_findings(on_plate, SIMPLE_FEET)}
    assert found == {"P275": "P276", "P276": None}


@pytest.mark.parametrize("name", [name for name in RUNS if name != "hamner"])
def test_a_foot_that_swings_is_on_no_plate(recording_of, name):
    """A runner's centre of pressure that is off the foot is not the other foot's, which is in the air."""
    run = recording_of(*RUNS[name])
    feet = feet_of(run)
    codes = doubted(moved(run, (0.0, 0.0, 0.13)), feet)
    assert codes
    assert "P276" not in codes


def along(recording, plate, share):
    """The centre of pressure of one plate this many times as far from where it is on average under each step."""
    plates = recording.plates
    point = centre_of_pressure(np.concatenate((plates.force, plates.moment), axis=2))
    for first, last in runs(plates.force[:, plate, 1] > 0):
        step = point[first : last + 1, plate]
        point[first : last + 1, plate] = step.mean(axis=0) + share * (step - step.mean(axis=0))
    return replace(recording, plates=replace(plates, moment=np.cross(point, plates.force)))


@pytest.mark.parametrize(("share", "code", "size_m"), [(-1.5, "P252", -0.1), (0.0, "P251", 0.0)])
def test_a_load_that_does_not_progress(share, code, size_m):
    recording = simple_walk([("r", 0), ("l", 0)])
    (found,) = [finding for finding in place_findings(along(recording, 1, share), SIMPLE_FEET) if finding.is_open]
    assert (found.code, found.where.plate) == (code, "plate 2")
    assert next(iter(found.evidence.values())).value == pytest.approx(size_m, abs=0.03)
    assert doubted(along(recording, 1, 0.3), SIMPLE_FEET) == []


def test_a_mirrored_plate_under_short_feet():
    adult = along(simple_walk([("r", 0), ("l", 0)]), 1, -1.5)
    markers = replace(adult.markers, positions=0.6 * adult.markers.positions)
    child = replace(adult, markers=markers, plates=replace(adult.plates, moment=0.6 * adult.plates.moment))
    (found,) = [finding for finding in place_findings(child, SIMPLE_FEET) if finding.code == "P252"]
    assert found.evidence["progression_m"].value == pytest.approx(-0.06, abs=0.02)


def test_a_mirrored_plate_does_not_hide_both_feet_on_another():
    """Chain F of the precedence."""
    recording = along(simple_walk([("r", 0), ("l", 0), ("r", 1)]), 2, -1.5)
    wrong = with_left_foot_on_first_plate(recording, 0.7, 0.78)
    assert sorted(doubted(wrong, SIMPLE_FEET)) == ["P252", "P276"]


def test_a_static_trial_is_asked_nothing_and_somebody_who_stands_is(walk):
    """D10."""
    recording, feet = walk
    still = np.repeat(recording.markers.positions[:1], len(recording.markers.time), axis=0)
    standing = replace(
        moved(recording, (0.0, 0.0, 0.0), factor=1000.0), markers=replace(recording.markers, positions=still)
    )
    assert "P204" in doubted(standing, feet)
    assert "P204" not in doubted(standing, feet, is_static=True)
