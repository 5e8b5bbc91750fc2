"""Forces that were rounded, or cut off, are found; fault-free ones never are. The overshoot of a filter is measured."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from kinertia.diagnostics.plates.signals import quantisation, signals
from kinertia.trial.data import PlateLoads
from kinertia.trial.plate_loading import ringing_s, without_unloaded_level
from plate_findings import plates_alone

TIME = np.arange(2000) / 1000


def stance(width_s=0.65, start_s=0.6):
    """The two humps of a step, N."""
    after = np.clip((TIME - start_s) / width_s, 0.0, 1.0)
    return 900.0 * (np.sin(np.pi * after) + 0.35 * np.sin(3 * np.pi * after))


def plates(noise_n=1.0, force=None):
    """A step whose centre of pressure goes forwards by 0.2 m, with pushes along X and Z, as the readers leave it."""
    vertical = stance()
    if force is None:
        force = np.column_stack(
            [150.0 * np.sin(2 * np.pi * (TIME - 0.6) / 0.65) * (vertical > 0), vertical, 0.04 * vertical]
        )
    force = force + np.random.default_rng(1).normal(0.0, noise_n, force.shape)
    point = np.column_stack([1.0 + 0.3 * (TIME - 0.6), np.zeros_like(TIME), 0.4 + 0.05 * np.sin(TIME)])
    load = without_unloaded_level(TIME, force, np.cross(point, force))
    loads = (load.force[:, None], load.moment[:, None])
    return PlateLoads(TIME, ("plate 1",), *loads, declared_feet=(None,), unloaded=(load.unloaded,))


def low_passed(force, cutoff_hz, order=2):
    return sosfiltfilt(butter(order, cutoff_hz, fs=1000.0, output="sos"), force, axis=0)


def found(plates):
    """P105 and P106, with their headlines."""
    return [
        (finding.code, next(iter(finding.evidence.values())).value) for finding in quantisation(plates_alone(plates))
    ]


def cut(plates):
    return [
        (finding.code, finding.evidence["level_n"].value)
        for finding in signals(plates_alone(plates))
        if finding.code == "P104"
    ]


@pytest.mark.parametrize("noise_n", [0.0, 1.0, 3.0])
def test_a_fault_free_plate(noise_n):
    sound = plates(noise_n)
    assert found(sound) == []
    assert sound.unloaded[0].overshoot_s < 0.005  # single samples of noise


@pytest.mark.parametrize("step_n", [8.0, 20.0, 50.0])
def test_forces_in_coarse_steps(step_n):
    sound = plates()
    rounded = replace(sound, force=np.round(sound.force / step_n) * step_n)
    assert ("P105", pytest.approx(step_n)) in found(rounded)


def test_one_horizontal_axis_in_coarse_steps_that_do_not_begin_at_zero():
    force = plates().force.copy()
    force[..., 0] = np.round(force[..., 0] / 16.0) * 16.0 + 3.0
    assert ("P105", pytest.approx(16.0)) in found(replace(plates(), force=force))


@pytest.mark.parametrize("step_n", [0.5, 1.0, 2.0, 3.0, 5.0])
def test_finer_steps_are_neither_coarse_nor_cut(step_n):
    sound = plates(0.2)
    rounded = replace(sound, force=np.round(sound.force / step_n) * step_n)
    assert found(rounded) == cut(rounded) == []


def test_a_flat_hump_that_is_rounded_is_not_cut():
    """A kink, then nearly level: 27 samples at 47 N, 4 at 46 N on either side."""
    push = np.interp(TIME, [0.6, 0.65, 0.70, 0.73, 0.76, 0.81, 0.86], [0.0, 20.0, 46.0, 47.0, 46.0, 30.0, 0.0])
    force = plates(0.0).force.copy()
    force[:, 0, 2] = np.round(push)
    assert cut(replace(plates(0.0), force=force)) == []
    # an amplifier that ends there leaves the next steps out
    force[:, 0, 2] = np.minimum(np.round(3.0 * push), 47.0)
    assert cut(replace(plates(0.0), force=force)) == [("P104", 47.0)]


@pytest.mark.parametrize(("step_m", "said"), [(0.02, True), (0.01, True), (0.005, False), (0.001, False)])
def test_centres_of_pressure_in_coarse_steps(step_m, said):
    force = np.column_stack([0.1 * stance(), stance(), 0.02 * stance()])
    x = np.round((1.0 + 0.3 * (TIME - 0.6)) / step_m) * step_m
    point = np.column_stack([x, np.zeros_like(TIME), np.full_like(TIME, 0.4)])
    load = without_unloaded_level(TIME, force, np.cross(point, force))
    loads = PlateLoads(TIME, ("plate 1",), load.force[:, None], load.moment[:, None], (None,))
    assert found(loads) == [("P106", pytest.approx(step_m, rel=1e-3))] * said


@pytest.mark.parametrize(("cutoff_hz", "order"), [(4.0, 2), (5.0, 2), (5.0, 4), (6.0, 2)])
def test_how_long_a_filter_overshoots(cutoff_hz, order):
    (unloaded,) = plates(0.0, low_passed(plates().force[:, 0], cutoff_hz, order)).unloaded
    assert 0.45 / unloaded.overshoot_s == pytest.approx(cutoff_hz, abs=1.5)


@pytest.mark.parametrize("cutoff_hz", [10.0, 20.0, 50.0])
def test_a_filter_that_hardly_overshoots(cutoff_hz):
    (unloaded,) = plates(0.0, low_passed(plates().force[:, 0], cutoff_hz)).unloaded
    assert unloaded.overshoot_s < 0.06


def test_what_is_below_zero_for_another_cause():
    wrong_zero = np.where(stance() > 0, stance(), -12.0)
    other_load = stance() - 12.0 * (stance(0.4, 1.4) > 0) - 12.0 * (stance(0.45, 0.05) > 0)
    discharged = stance() - 20.0 * np.exp(-(TIME - 1.25) / 0.1) * (TIME > 1.25)
    for vertical in (wrong_zero, other_load, discharged):
        assert ringing_s(TIME, vertical) == 0.0
