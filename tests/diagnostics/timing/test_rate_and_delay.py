"""A wrong rate is told from a late clock by the one correction that puts all loads under standing feet."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.trial.data import Markers
from loads_and_feet import doubted, error_of
from walk_on_plates import ALL_STEPS, FEET, STRIDE_M
from walk_on_plates import walk as simple_walk

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
