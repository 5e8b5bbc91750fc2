"""A treadmill's belt that does not keep its speed: stated, the feet are told to stand as on a floor."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.evidence.foot_trajectories import foot_trajectories
from kinertia.diagnostics.plates.force_timing import belt_speed
from kinertia.io.subject.person_recordings import read_belt
from kinertia.trial.file_contents import Belt
from kinertia.trial.plate_assignment import build_trial
from loads_and_feet import context_of
from refusals import refused
from walk_on_plates import ALL_STEPS, FEET, walk

STEPS = [("r", 0), ("l", 0), ("r", 1)]


@pytest.fixture(scope="module")
def faster():
    """A walk of 1.2 m/s over ground, and the same on a belt that speeds up from 0.4 to 2.0 m/s."""
    on_floor = walk(STEPS)
    time = on_floor.markers.time
    speed = 0.4 + 1.6 * time / time[-1]
    belt = Belt(time, speed)
    way = np.array([belt.distance_m(0.0, t) for t in time])
    positions = on_floor.markers.positions - way[:, None, None] * [1.0, 0.0, 0.0]
    # the loads travel with the feet
    plates = on_floor.plates
    under = np.interp(plates.time, time, way)
    moment = plates.moment - np.cross(under[:, None, None] * [1.0, 0.0, 0.0], plates.force)
    on_belt = replace(
        on_floor, markers=replace(on_floor.markers, positions=positions), plates=replace(plates, moment=moment)
    )
    return on_floor, on_belt, belt


def test_measured_frames_are_those_of_the_floor(faster):
    on_floor, on_belt, belt = faster
    expected = build_trial(on_floor, FEET).measured
    stated = build_trial(replace(on_belt, belt=belt), FEET)
    np.testing.assert_array_equal(stated.measured, expected)
    assert stated.belt is belt
    # one speed for all is not what this belt has
    assert (build_trial(on_belt, FEET).measured != expected).any()


def contradicted(recording, belt):
    """Stated and standing feet's speed, foot and causes that depend on them, of T301; None where there is none."""
    found = list(belt_speed(context_of(replace(recording, belt=belt), FEET)))
    assert [finding.code for finding in found] in ([], ["T301"])
    shown = (
        [quantity.value for name, quantity in found[0].evidence.items() if name != "belt_speed_m_s"] if found else []
    )
    return (*shown, *found[0].causes) if found else None


@pytest.mark.parametrize(("factor", "cause"), [(1.0, None), (3.6, ("a speed in km/h",)), (0.5, ())])
def test_a_speed_that_is_not_the_belts_is_found(faster, factor, cause):
    _, on_belt, belt = faster
    found = contradicted(on_belt, replace(belt, speed_m_s=factor * belt.speed_m_s))
    assert (found if found is None else found[3:]) == cause
    if found is not None:
        assert found[0] / found[1] == pytest.approx(factor, rel=0.25)


@pytest.mark.parametrize("kind", ["csv", "semicolons", "mot"])
def test_files(tmp_path, kind):
    if kind == "mot":
        path = tmp_path / "grf.mot"
        path.write_text("grf\nnRows=2\nnColumns=3\nendheader\ntime\tground_force_vx\tbelt_speed\n0\t1\t1\n2\t1\t2\n")
    else:
        path = tmp_path / "speed.csv"
        text = "time_s,speed_m_s\n0,1.0\n2,2.0\n"
        path.write_text(text if kind == "csv" else text.replace(",", ";").replace(".", ","))
    belt = read_belt(path)
    assert belt.distance_m(0.0, 2.0) == pytest.approx(3.0)
    assert belt.velocity(np.array([1.0, 9.0]), np.array([0.0, 0.0, -3.0])).tolist() == [[0, 0, -1.5], [0, 0, -2]]


@pytest.mark.parametrize("kind", ["csv", "mot"])
def test_files_of_two_belts(tmp_path, kind):
    path = tmp_path / f"speeds.{kind}"
    if kind == "mot":
        rows = "time\tbelt_speed_left\tbelt_speed_right\n0\t0.5\t1\n2\t0.5\t2\n"
        path.write_text(f"grf\nnRows=2\nnColumns=3\nendheader\n{rows}")
    else:
        path.write_text("left_m_s;time_s;right_m_s\n0,5;0;1,0\n0,5;2;2,0\n")
    belt = read_belt(path)
    assert [belt.under(foot).distance_m(0.0, 2.0) for foot in range(2)] == pytest.approx([3.0, 1.0])


@pytest.mark.parametrize(
    ("name", "text", "code", "evidence"),
    [
        ("a.csv", "time_s,right_m_s\n0,1\n", "F103", {"found": "time_s, right_m_s", "expected": "speed_m_s"}),
        ("a.csv", "time_s,right_m_s,left_m_s\n0,1,50\n", "F181", {"speed_m_s": (1.0, 50.0)}),
        ("a.csv", "time_s,speed_m_s\n1,1\n1,1\n", "F181", {"problem": "increase"}),
        ("a.mot", "grf\nendheader\ntime\tbelt_speed_left\n0\t1\n1\t1\n", "F181", {"problem": "belt_speed_right and"}),
    ],
)
def test_files_without_speeds(tmp_path, name, text, code, evidence):
    (tmp_path / name).write_text(text)
    with refused(code, **evidence):
        read_belt(tmp_path / name)


def test_a_constant():
    belt = read_belt(1.5)
    assert belt.distance_m(3.0, 5.0) == pytest.approx(3.0)
    assert read_belt(None) is None


@pytest.fixture(scope="module")
def split():
    """A walk over ground, and the same with a belt of 1.4 m/s under the right foot and of 0.6 under the left."""
    on_floor = walk(ALL_STEPS)
    speed = {"r": 1.4, "l": 0.6}
    markers, plates = on_floor.markers, on_floor.plates
    side = np.array(["r" if label in FEET["r"] else "l" for label in markers.labels])
    way = np.stack([speed[s] * markers.time for s in side], axis=1)
    positions = markers.positions - way[..., None] * [1.0, 0.0, 0.0]
    moment = plates.moment.copy()
    for p, (foot, _) in enumerate(ALL_STEPS):
        moment[:, p] -= np.cross(speed[foot] * plates.time[:, None] * [1.0, 0.0, 0.0], plates.force[:, p])
    on_belts = replace(on_floor, markers=replace(markers, positions=positions), plates=replace(plates, moment=moment))
    return on_floor, on_belts


@pytest.mark.parametrize("stated", [None, (1.4, 0.6)])
def test_two_belts(split, stated):
    """Each foot stands on its own, whether their speeds are stated or told by the feet."""
    on_floor, on_belts = split
    trial = build_trial(replace(on_belts, belt=read_belt(stated)), FEET)
    np.testing.assert_array_equal(trial.measured, build_trial(on_floor, FEET).measured)
    feet = foot_trajectories(on_belts.markers, FEET, read_belt(stated))
    for foot, expected in zip(feet, foot_trajectories(on_floor.markers, FEET), strict=True):
        spans, known = ([stance_span[:2] for stance_span in trajectory.stance_spans] for trajectory in (foot, expected))
        np.testing.assert_allclose(spans, known, atol=0.011)


@pytest.mark.parametrize(
    ("stated", "found"),
    [
        ((1.4, 0.6), None),
        ((0.6, 1.4), (1.4, 0.6, "left", "right and left belt interchanged")),
        ((1.4, 2.2), (2.2, 0.6, "left", "a speed in km/h")),
        (1.4, (1.4, 0.6, "either")),
    ],
)
def test_two_speeds_that_are_not_the_belts_are_found(split, stated, found):
    said = contradicted(split[1], read_belt(stated))
    assert (said is None) == (found is None)
    if said is not None:
        assert said[:2] == pytest.approx(found[:2], abs=0.05)
        assert said[2:] == found[2:]
