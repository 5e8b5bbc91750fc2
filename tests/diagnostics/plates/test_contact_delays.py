"""A wrong rate of the forces is told from a late clock by a delay that grows, where there are contacts enough."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.plates import contact_delays
from kinertia.trial.data import Markers
from loads_and_feet import context_of, doubted, error_of, feet_of
from person_limits import late as late_contacts
from recordings import LONG_WALKS, QUICK_WALKS, RUNS, WALKS, slow_beside
from walk_on_plates import ALL_STEPS, FEET, STRIDE_M
from walk_on_plates import walk as simple_walk


def found_in(recording, rate=1.0, delay_s=0.0):
    """What is found in forces whose time goes at this rate, and which are later."""
    plates = recording.plates
    time = plates.time[0] + rate * (plates.time - plates.time[0]) + delay_s
    return error_of(replace(recording, plates=replace(plates, time=time)), feet_of(recording))


@pytest.fixture(params=slow_beside(("synthetic", "hamner"), RUNS))
def run(request, recording_of):
    return recording_of(*RUNS[request.param])


@pytest.fixture(params=slow_beside(QUICK_WALKS, WALKS))
def walk(request, recording_of):
    return recording_of(*WALKS[request.param])


@pytest.mark.parametrize("rate", [0.95, 0.99, 1.01, 1.05])
def test_a_wrong_rate_of_a_run(run, rate):
    found = found_in(run, rate)
    assert found.code == "T201"
    assert found.evidence["ratio"].value == pytest.approx(rate, abs=0.003)


@pytest.mark.parametrize("delay_s", [-0.03, 0.03])
def test_a_run_at_its_rate(run, delay_s):
    assert code_of(found_in(run, delay_s=delay_s)) != "T201"


def code_of(found):
    return None if found is None else found.code


@pytest.mark.parametrize("delay_s", [-0.07, 0.07])
def test_a_delay_over_many_contacts(run, delay_s):
    found = found_in(run, delay_s=delay_s)
    assert found.code == "T211"
    assert "rate_alternative" not in found.evidence


@pytest.mark.parametrize("share", [0.05, 0.2])
def test_markers_that_flicker_do_not_change_how_long_feet_stand(walk, share):
    markers = walk.markers
    positions = markers.positions.copy()
    positions[np.random.default_rng(5).random(positions.shape[:2]) < share] = np.nan
    assert found_in(replace(walk, markers=replace(markers, positions=positions))) is None


@pytest.mark.parametrize("side", ["r", "l"])
def test_a_foot_that_is_hidden_while_it_stands(walk, side):
    """For a third of a second in the middle of its longest load, with all its markers."""
    markers, plates = walk.markers, walk.plates
    columns = [markers.labels.index(label) for label in feet_of(walk)[side]]
    for vertical in plates.force[..., 1].T:
        middle = float(np.average(plates.time, weights=vertical > 200.0))
        positions = markers.positions.copy()
        hidden = np.abs(markers.time - middle) < 0.17
        positions[np.ix_(hidden, columns)] = np.nan
        assert code_of(found_in(replace(walk, markers=replace(markers, positions=positions)))) != "T201"


def test_few_contacts_hardly_distinguish_a_small_rate_error_from_a_delay(walk):
    """Then both are identified."""
    found = found_in(walk, 1.05)
    assert found.code in ("T201", "T211")
    if found.code == "T211":
        assert found.evidence["rate_alternative"].value == pytest.approx(0.05, abs=0.025)


@pytest.mark.parametrize(("rate", "delay_s", "expected"), [(0.9, 0.0, "T201"), (1.1, 0.0, "T201"), (1.0, 0.1, "T211")])
def test_few_contacts_distinguish_a_rate_from_a_delay(walk, rate, delay_s, expected):
    single = len(context_of(walk, feet_of(walk)).whole_contacts) < 2
    assert found_in(walk, rate, delay_s).code == ("T211" if single else expected)


def test_a_foot_on_two_plates_makes_one_step():
    """Its load begins on the first of them and ends on the second; each of both alone would end early or begin late."""
    whole = simple_walk([("r", 0), ("l", 0)])
    plates = whole.plates
    first, second = (plates.time[:, None, None] < 0.5), (plates.time[:, None, None] >= 0.45)
    parts = [
        np.concatenate([load[:, :1] * first, load[:, :1] * second, load[:, 1:]], axis=1)
        for load in (plates.force, plates.moment)
    ]
    split = replace(plates, names=("a", "b", "c"), force=parts[0], moment=parts[1], declared_feet=(None,) * 3)
    context = context_of(replace(whole, plates=split), FEET)
    delays = contact_delays.ContactDelays.of(context.whole_contacts, context.foot_trajectories)
    assert delays.time == pytest.approx(np.array([[0.2, 0.8], [0.7, 1.3]]), abs=0.01)


@pytest.mark.parametrize("name", LONG_WALKS)
def test_three_contacts_exclude_a_rate_that_is_far_off(recording_of, name):
    """To be 100 ms late in the middle of 2.4 s, forces would have to be 10 % slow."""
    found = found_in(recording_of(*LONG_WALKS[name]), delay_s=0.1)
    assert found.code == "T211"
    assert "rate_alternative" not in found.evidence


@pytest.mark.parametrize("noise_mm", [3.0, 5.0])
def test_markers_that_jitter_are_no_wrong_rate(walk, noise_mm):
    """Poses and markers from video do, by some millimetres in every frame."""
    noise = 1e-3 * noise_mm * np.random.default_rng(2).standard_normal(walk.markers.positions.shape)
    noisy = replace(walk, markers=replace(walk.markers, positions=walk.markers.positions + noise))
    assert found_in(noisy) is None
    assert found_in(noisy, 1.6).code == "T201"


def test_who_stands_on_a_box_before_the_walk_has_no_other_rate(walk):
    """Only while feet are loaded plates and markers can be compared."""
    markers = walk.markers
    still = np.repeat(markers.positions[:1], round(3.0 * markers.rate_hz), axis=0)
    positions = np.concatenate([still, markers.positions, np.repeat(markers.positions[-1:], len(still), axis=0)])
    step_s = float(np.median(np.diff(markers.time)))
    time = markers.time[0] + step_s * (np.arange(len(positions)) - len(still))
    before = replace(walk, markers=replace(markers, time=time, positions=positions))
    assert code_of(found_in(before)) != "T201"


FEW_STEPS = [("r", 0), ("l", 0)]


def c3d_lab(steps, edge_s=0.04, stance_s=0.6, belt_m_s=0.0, **more):
    """Loads as long as the feet look to stand: in the simple walk these are slow `edge_s` before and after."""
    markers = simple_walk(steps, stance_s - 2 * edge_s, belt_m_s=belt_m_s, **more).markers
    early = late(simple_walk(steps, stance_s, belt_m_s=belt_m_s, **more), -edge_s)
    back = np.cross([belt_m_s * edge_s, 0.0, 0.0], early.plates.force)
    return replace(early, markers=markers, plates=replace(early.plates, moment=early.plates.moment + back))


def marked_at(recording, factor):
    """The rate of the markers stated so many times too high."""
    markers = recording.markers
    time = markers.time[0] + (markers.time - markers.time[0]) / factor
    return replace(recording, markers=replace(markers, time=time))


def late(recording, by_s):
    plates = recording.plates
    rows = round(by_s / float(plates.time[1] - plates.time[0]))
    earlier = np.clip(np.arange(len(plates.time)) - rows, 0, len(plates.time) - 1)
    return replace(recording, plates=replace(plates, force=plates.force[earlier], moment=plates.moment[earlier]))


@pytest.mark.parametrize("steps", [FEW_STEPS, ALL_STEPS], ids=["two plates", "all steps"])
@pytest.mark.parametrize("factor", [1.2, 0.8, 2.0])
def test_a_wrong_rate_is_no_delay(steps, factor):
    found = error_of(marked_at(c3d_lab(steps), factor), FEET)
    assert found.code == "T201"
    assert found.evidence["ratio"].value == pytest.approx(factor, rel=0.02)


@pytest.mark.parametrize("delay_s", [-0.1, 0.1])
def test_a_delay_is_no_wrong_rate(delay_s):
    found = error_of(late(c3d_lab(FEW_STEPS), delay_s), FEET)
    assert found.code == "T211"
    assert found.evidence["delay_s"].value == pytest.approx(delay_s, abs=0.02)


def test_loads_that_a_belt_takes_along_are_late():
    """On a fast belt, loads that come late are under no foot."""
    run = c3d_lab(ALL_STEPS, 0.08, 0.2, stride_m=3 * STRIDE_M, belt_m_s=3 * STRIDE_M)
    assert error_of(run, FEET) is None
    assert error_of(late(run, 0.1), FEET).code == "T211"


def test_who_does_not_step_has_no_time_base_to_compare():
    standing = simple_walk(ALL_STEPS)
    still = np.repeat(standing.markers.positions[:1], len(standing.markers.time), axis=0)
    markers = Markers(standing.markers.time, standing.markers.labels, still)
    found = error_of(replace(standing, markers=markers), FEET)
    assert found is None or found.code != "T201"


@pytest.mark.parametrize("plate", [0, 1])
def test_points_of_one_plate_in_mm(plate):
    recording = simple_walk(FEW_STEPS)
    moment = recording.plates.moment.copy()
    moment[:, plate] *= 1000.0
    wrong = replace(recording, plates=replace(recording.plates, moment=moment))
    assert error_of(wrong, FEET).where.plate == f"plate {plate + 1}"
    assert "P204" in doubted(wrong, FEET)


def test_both_ends_of_loads_have_to_be_late(monkeypatch):
    """A plate that is left early, or a foot that drags, moves one end: of 60 ms on average 30 ms at least at each."""
    assert [finding.code for finding in late_contacts(0.06, monkeypatch, uneven_s=0.029)] == ["T211"]
    assert late_contacts(0.06, monkeypatch, uneven_s=0.031) == []
    assert late_contacts(-0.06, monkeypatch, uneven_s=0.031) == []


def test_contacts_are_not_late_where_forces_move_the_body_in_time(monkeypatch):
    """Feet that drag, of a person whose steps are all alike."""
    monkeypatch.setattr(contact_delays, "forces_keep_time", lambda context: True)
    assert late_contacts(0.06, monkeypatch) == []
    assert [finding.code for finding in late_contacts(0.3, monkeypatch)] == ["T212"]


@pytest.mark.parametrize("delay_s", [-0.05, 0.0, 0.05])
def test_forces_keep_time_or_do_not(walk, delay_s):
    """Where windows are too short, or a foot is not seen, nobody can say."""
    plates = walk.plates
    context = context_of(replace(walk, plates=replace(plates, time=plates.time + delay_s)))
    assert not (delay_s and contact_delays.forces_keep_time(context))


@pytest.mark.parametrize("walk_file", ["field/fmc/MH0222_BP06.c3d", "field/fmc/MH0222_BP15.c3d"])
@pytest.mark.measured
def test_feet_that_drag(recording_of, walk_file):
    """Loads begin 20 ms and end 65 ms after the markers say, and bodies follow them by 2 to 26 ms."""
    recording = recording_of(walk_file, None)
    assert contact_delays.forces_keep_time(context_of(recording))
    assert code_of(found_in(recording)) is None
    assert code_of(found_in(recording, delay_s=0.05)) == "T211"
