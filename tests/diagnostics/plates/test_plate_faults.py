"""What plates read while nobody stands on them: zeros and drift; loads too small for a person."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.plates.plate_faults import loads_doubts, loads_trouble
from kinertia.trial.data import PlateLoads
from kinertia.trial.idle_plate import without_idle

TIME = np.arange(3000) / 1000


def plates(offset=(0.0, 0.0, 0.0), drift_n=0.0, factor=1.0):
    """A plate that is stood on from 1 to 1.6 s, with noise, as the readers leave it."""
    vertical = np.where((TIME > 1) & (TIME < 1.6), 700.0 * np.sin(np.pi * (TIME - 1) / 0.6), 0.0)
    force = np.outer(vertical, [0.0, 1.0, 0.0]) + np.array(offset) + np.outer(TIME / TIME[-1], [0.0, drift_n, 0.0])
    force = factor * (force + np.random.default_rng(3).normal(0.0, 1.0, (len(TIME), 3)))
    load = without_idle(TIME, force, np.zeros_like(force))
    twist = np.outer(0.01 * load.force[:, 1], [0.0, 1.0, 0.0])
    each = (load.force[:, None], (load.moment + twist)[:, None])
    return PlateLoads(TIME, ("plate 1",), *each, declared_feet=(None,), idle=(load.idle,))


def test_a_sound_plate():
    plate = plates()
    assert loads_trouble(plate) == ""
    assert loads_doubts(plate) == []
    assert plate.idle[0].peak_n == pytest.approx(700, abs=5)


@pytest.mark.parametrize(
    ("axis", "words"), [(0, "+25 N along X"), (1, "+25 N along Y"), (2, "+25 N along Z")], ids="XYZ"
)
def test_zeros(axis, words):
    (sentence,) = loads_doubts(plates(offset=25.0 * np.eye(3)[axis]))
    assert words in sentence
    assert ("its vertical force" if axis == 1 else "that axis") in sentence


@pytest.mark.parametrize("drift_n", [-40.0, 25.0, 60.0])
def test_drift(drift_n):
    (sentence, *_) = [one for one in loads_doubts(plates(drift_n=drift_n)) if "drifts" in one]
    drift = float(sentence.partition("changes by ")[2].partition(" N")[0])
    assert drift == pytest.approx(drift_n, rel=0.1)


def test_forces_in_kilonewtons():
    assert "in kN" in loads_trouble(plates(factor=1e-3))


def test_a_plate_that_nobody_stands_on():
    idle = plates(factor=1e-9)
    assert loads_trouble(idle) == ""
    assert loads_doubts(idle) == []


@pytest.mark.parametrize(("top_n", "lost"), [(600.0, True), (690.0, True), (900.0, False)])
def test_an_amplifier_at_the_end_of_its_range(top_n, lost):
    plate = plates()
    force = plate.force.copy()
    force[..., 1] = np.minimum(force[..., 1], top_n)
    doubts = loads_doubts(replace(plate, force=force))
    assert [f"stays at {top_n:.1f} N, its largest value" in doubt for doubt in doubts] == [True] * lost


@pytest.mark.parametrize("digits", [0, -1])
def test_rounded_forces_are_not_cut(digits):
    vertical = np.where((TIME > 1) & (TIME < 1.6), 700.0 * np.sin(np.pi * (TIME - 1) / 0.6), 0.0).round(digits)
    force = np.outer(vertical, [0.1, 1.0, 0.02])[:, None]
    doubts = loads_doubts(PlateLoads(TIME, ("plate 1",), force, 0.01 * force, (None,)))
    assert [one for one in doubts if "stays at" in one] == []


@pytest.mark.parametrize(("axis", "name"), [(0, "X"), (2, "Z")])
def test_a_dead_channel_is_named(axis, name):
    plate = plates()
    force = plate.force.copy()
    force[..., axis] = 0.0
    (sentence,) = loads_doubts(replace(plate, force=force))
    assert f"shows no force along {name} in any sample: a channel is dead" in sentence


def test_torques_that_were_not_exported_are_named():
    """At any place on the plate, which gives a moment about the origin, but none about the centre of pressure."""
    plate = plates()
    moment = np.cross([0.4, 0.02, -0.3], plate.force)
    (sentence,) = loads_doubts(replace(plate, moment=moment))
    assert "no free moment (torque about the vertical) is in the loads of plate 1" in sentence
    moment[..., 1] += 0.002 * plate.force[..., 1]
    assert loads_doubts(replace(plate, moment=moment)) == []


def test_zeros_in_the_middle_of_stance_are_named():
    plate = plates()
    force = plate.force.copy()
    force[1200:1300] = 0.0
    sentence = loads_trouble(replace(plate, force=force))
    assert sentence.startswith("all plates read zero from 1.200 to 1.299 s, between samples of ")
    assert "samples were lost" in sentence


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_horizontal_amplifier_at_the_end_of_its_range(sign):
    plate = plates()
    force = plate.force.copy()
    loaded = force[:, 0, 1] > 0
    push = sign * 150.0 * np.sin(2 * np.pi * (TIME - 1) / 0.6)
    force[loaded, 0, 0] = push[loaded]
    assert loads_doubts(replace(plate, force=force)) == []
    force[..., 0] = sign * np.minimum(sign * force[..., 0], 90.0)
    (sentence,) = loads_doubts(replace(plate, force=force))
    assert f"the force along X of plate 1 stays at {sign * 90.0:.1f} N" in sentence


@pytest.mark.parametrize(("samples", "said"), [(10, 0), (60, 1), (200, 1)])
def test_samples_that_are_held(samples, said):
    plate = plates()
    force, moment = plate.force.copy(), plate.moment.copy()
    for values in (force, moment):
        values[1200 : 1200 + samples] = values[1200]
    held = replace(plate, force=force, moment=moment)
    doubts = loads_doubts(held)
    assert len(doubts) == said
    # long ones are refused: they shift where loads begin and end
    assert bool(loads_trouble(held)) == (samples > 100)
    if said:
        assert f"reads exactly the same in all its channels from 1.200 to {1.199 + samples / 1000:.3f} s" in doubts[0]


def test_late_forces_that_begin_with_copies_of_the_first_are_not_held():
    plate, rows = plates(), slice(1200, 1500)
    force, moment = (values[rows][np.maximum(np.arange(300) - 100, 0)] for values in (plate.force, plate.moment))
    late = replace(plate, time=plate.time[rows], force=force, moment=moment)
    assert loads_doubts(late) == []
    assert loads_trouble(late) == ""
