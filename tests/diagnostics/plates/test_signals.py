"""What plates show by themselves: lost samples, saturation, zeros and drift; loads too small for a person."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.plates.signals import mains_interference
from kinertia.diagnostics.registry import SIGNAL_CHECKS, STANDING_CHECKS
from kinertia.diagnostics.runner import asked, explained
from kinertia.findings.finding import Severity
from kinertia.trial.data import PlateLoads
from kinertia.trial.plate_loading import with_unloaded_levels, without_unloaded_level
from kinertia.trial.plate_signals import without_spikes
from plate_findings import codes, plates_alone
from recordings import LONG_WALKS, RUNS, SQUATS, WALKS, named_here

TIME = np.arange(3000) / 1000


def plates(offset=(0.0, 0.0, 0.0), drift_n=0.0, factor=1.0, weight_n=700.0, zeroed=False, extra=0.0):
    """A plate that is stood on from 1 to 1.6 s, with noise, as the readers leave it, or where it is stated `zeroed`."""
    vertical = np.where((TIME > 1) & (TIME < 1.6), weight_n * np.sin(np.pi * (TIME - 1) / 0.6), 0.0)
    force = np.outer(vertical, [0.0, 1.0, 0.0]) + np.array(offset) + np.outer(TIME / TIME[-1], [0.0, drift_n, 0.0])
    force = factor * (force + extra + np.random.default_rng(3).normal(0.0, 1.0, (len(TIME), 3)))
    force, moment, spikes = without_spikes(TIME, force, np.zeros_like(force))
    load = without_unloaded_level(TIME, force, moment)
    twist = np.outer(0.01 * load.force[:, 1], [0.0, 1.0, 0.0])
    loads = (load.force[:, None], (load.moment + twist)[:, None])
    read = PlateLoads(TIME, ("plate 1",), *loads, declared_feet=(None,), unloaded=(load.unloaded,), spikes=(spikes,))
    return with_unloaded_levels(read) if zeroed else read


def found(plates, **stated):
    return explained(asked(SIGNAL_CHECKS, plates_alone(plates, **stated)))


def only(plates, **stated):
    (finding,) = found(plates, **stated)
    return finding


def test_a_fault_free_plate():
    plate = plates()
    assert found(plate) == []
    assert plate.unloaded[0].peak_n == pytest.approx(700, abs=5)


@pytest.mark.parametrize(
    ("axis", "level_n", "severity"),
    [(0, 25.0, "WARNING"), (1, 25.0, "WARNING"), (2, -25.0, "WARNING"), (1, 50.0, "ERROR"), (0, 50.0, "WARNING")],
)
def test_zeros(axis, level_n, severity):
    """They are taken off, unless the laboratory states that there are none."""
    there = plates_alone(plates()).at(plate="plate 1", **plates_alone(plates()).along(axis))
    for zeroed, expected in ((False, ("P216", "CORRECTED")), (True, ("P213", severity))):
        wrong = plates(offset=level_n * np.eye(3)[axis], zeroed=zeroed)
        zero = only(wrong)
        assert (zero.code, zero.severity.name, zero.where) == (*expected, there)
        assert zero.evidence["level_n"].value == pytest.approx(level_n, abs=0.5)
        loaded = plates().force[..., 1] > 50.0
        remaining_n = (wrong.force - plates().force)[loaded].mean(axis=0)
        np.testing.assert_allclose(remaining_n, zeroed * level_n * np.eye(3)[axis], atol=0.1)


def test_all_zeros_that_are_wrong_are_found():
    """D22: of every axis."""
    assert only(plates(offset=(30.0, 60.0, -30.0))).evidence["levels_n"].value == pytest.approx((30, 60, -30), abs=0.5)
    zeros = found(plates(offset=(30.0, 60.0, -30.0), zeroed=True))
    assert [(finding.code, finding.where.axis) for finding in zeros] == [
        ("P213", axis) for axis in ("fore-aft", "vertical", "mediolateral")
    ]
    assert [zero.severity for zero in zeros] == [Severity.WARNING, Severity.ERROR, Severity.WARNING]


@pytest.mark.parametrize("level_n", [30.0, 50.0, 100.0])
def test_a_plate_that_is_never_unloaded(level_n):
    plate = plates()
    zero = only(replace(plate, force=plate.force + level_n * np.eye(3)[1], unloaded=None))
    assert (zero.code, zero.severity) == ("P213", Severity.ERROR)
    assert (zero.evidence["level_n"].value, zero.evidence["method"].value) == (pytest.approx(level_n), "minimum")


@pytest.mark.parametrize("drift_n", [-40.0, 25.0, 60.0])
def test_drift(drift_n):
    drift = only(plates(drift_n=drift_n))
    assert drift.code == "P211"
    assert drift.evidence["drift_n"].value == pytest.approx(drift_n, rel=0.1)


def test_forces_in_kilonewtons():
    unit = only(plates(factor=1e-3))
    assert (unit.code, unit.severity) == ("P202", Severity.ERROR)


def test_feet_that_stay_in_kilonewtons():
    """As in squats, or on a belt: the plate is never unloaded."""
    vertical = 0.35 + 0.06 * np.sin(2 * np.pi * TIME)
    noise = np.random.default_rng(100).normal(0.0, 0.001, (len(TIME), 3))
    load = without_unloaded_level(TIME, np.outer(vertical, [0.0, 1.0, 0.0]) + noise, np.zeros((len(TIME), 3)))
    loads = (load.force[:, None], load.moment[:, None])
    assert only(PlateLoads(TIME, ("plate 1",), *loads, declared_feet=(None,), unloaded=(load.unloaded,))).code == "P202"


def test_a_plate_that_nobody_stands_on():
    assert found(plates(factor=1e-9)) == []


@pytest.mark.parametrize("noise_n", [0.5, 1.5, 3.0])
@pytest.mark.parametrize(
    "extra",
    [
        0.0 * TIME,
        4.0 + 0.0 * TIME,
        5.0 * TIME / TIME[-1],
        3.0 * np.sin(2 * np.pi * 50 * TIME),
        5.0 * np.sin(np.pi * TIME),
    ],
    ids=["noise", "zero", "drift", "hum", "wander"],
)
def test_an_unloaded_plate_is_not_in_kilonewtons(noise_n, extra):
    """D4: noise, a zero, a drift or a hum reach some newtons, and do not come and go as loads do."""
    for steps in (1, 50):
        noise = np.random.default_rng(100).normal(0.0, noise_n, (len(TIME) // steps + 1, 3))
        force = np.repeat(noise, steps, axis=0)[: len(TIME)] + np.outer(extra, [0.0, 1.0, 0.0])
        load = without_unloaded_level(TIME, force, np.zeros_like(force))
        assert 0.3 < load.unloaded.peak_n < 20.0
        loads = (load.force[:, None], load.moment[:, None])
        assert found(PlateLoads(TIME, ("plate 1",), *loads, declared_feet=(None,), unloaded=(load.unloaded,))) == []


@pytest.mark.parametrize("mass_kg", [None, 20.0])
def test_a_child_is_examined_like_an_adult(mass_kg):
    """D14: limits are shares of body weight, stated or by the plates."""
    child = plates(weight_n=210.0)
    assert found(child, mass_kg=mass_kg) == []
    for axis in (0, 1):
        zero = only(plates(weight_n=210.0, offset=8.0 * np.eye(3)[axis], zeroed=True), mass_kg=mass_kg)
        assert (zero.code, zero.where.axis) == ("P213", ("fore-aft", "vertical")[axis])
    far = plates(weight_n=210.0, offset=(0.0, 14.0, 0.0), zeroed=True)
    assert only(far, mass_kg=mass_kg).severity == Severity.ERROR
    dead = replace(child, force=child.force * [0.0, 1.0, 1.0])
    assert only(dead, mass_kg=mass_kg).code == "P101"
    assert only(replace(child, moment=np.cross([0.4, 0.02, -0.3], child.force)), mass_kg=mass_kg).code == "P264"
    # the same is noise on an adult's plates
    assert found(plates(offset=(8.0, 8.0, 8.0), zeroed=True)) == []


@pytest.mark.parametrize(("top_n", "lost"), [(600.0, True), (690.0, True), (900.0, False)])
def test_an_amplifier_at_the_end_of_its_range(top_n, lost):
    plate = plates()
    force = plate.force.copy()
    force[..., 1] = np.minimum(force[..., 1], top_n)
    cut = found(replace(plate, force=force))
    assert [finding.code for finding in cut] == ["P104"] * lost
    assert [finding.evidence["level_n"].value for finding in cut] == [top_n] * lost


def test_each_plate_is_judged_by_itself():
    """Rounding of plate 1 does not hide the saturation of plate 2."""
    plate = plates()
    force = np.concatenate([plate.force, plate.force], axis=1)
    force[:, 0] = np.round(force[:, 0] / 20.0) * 20.0
    force[:, 1, 1] = np.minimum(force[:, 1, 1], 600.0)
    moment = np.concatenate([plate.moment, plate.moment], axis=1)
    both = found(PlateLoads(TIME, ("plate 1", "plate 2"), force, moment, (None, None)))
    of_plates = [
        (finding.code, finding.where.plate) for finding in both if finding.is_open and finding.code in ("P104", "P105")
    ]
    assert of_plates == [("P104", "plate 2"), ("P105", "plate 1")]


@pytest.mark.parametrize("digits", [0, -1])
def test_rounded_forces_are_not_cut(digits):
    vertical = np.where((TIME > 1) & (TIME < 1.6), 700.0 * np.sin(np.pi * (TIME - 1) / 0.6), 0.0).round(digits)
    force = np.outer(vertical, [0.1, 1.0, 0.02])[:, None]
    assert "P104" not in codes(found(PlateLoads(TIME, ("plate 1",), force, 0.01 * force, (None,))))


@pytest.mark.parametrize("axis", [0, 2])
def test_a_dead_channel(axis):
    plate = plates()
    force = plate.force.copy()
    force[..., axis] = 0.0
    dead, context = only(replace(plate, force=force)), plates_alone(plate)
    assert (dead.code, dead.where) == ("P101", context.at(plate="plate 1", **context.along(axis)))


def test_torques_that_were_not_exported():
    """At any place on the plate, which gives a moment about the origin, but none about the centre of pressure."""
    plate = plates()
    moment = np.cross([0.4, 0.02, -0.3], plate.force)
    absent = only(replace(plate, moment=moment))
    assert (absent.code, absent.where.plate) == ("P264", "plate 1")
    moment[..., 1] += 0.002 * plate.force[..., 1]
    assert found(replace(plate, moment=moment)) == []


def test_zeros_in_mid_stance():
    """All of them."""
    plate = plates()
    force = plate.force.copy()
    force[1200:1300] = force[1400:1420] = 0.0
    lost = [finding for finding in found(replace(plate, force=force)) if finding.code == "P102"]
    assert [finding.where.span_s for finding in lost] == [pytest.approx((1.2, 1.299)), pytest.approx((1.4, 1.419))]


@pytest.mark.parametrize(("samples", "code"), [(50, "P102"), (100, None)])
def test_one_of_two_plates_reads_zero_in_mid_stance(samples, code):
    """For longer it may be two steps on one plate."""
    plate = plates()
    force, moment = (np.repeat(load, 2, axis=1) for load in (plate.force, plate.moment))
    force[1200 : 1200 + samples, 0] = moment[1200 : 1200 + samples, 0] = 0.0
    both = PlateLoads(TIME, ("plate 1", "plate 2"), force, moment, declared_feet=(None, None))
    lost = [(finding.code, finding.where.plate) for finding in found(both) if finding.code == "P102"]
    assert lost == ([] if code is None else [(code, "plate 1")])


def pulse(samples, size_n, axis=1, start=1300):
    extra = np.zeros((len(TIME), 3))
    extra[start : start + samples, axis] = size_n
    return extra


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("samples", [1, 2])
@pytest.mark.parametrize("start", [500, 1300])
def test_a_spike_is_bridged_and_reported(axis, samples, start):
    spiked, sound = plates(extra=pulse(samples, -600.0, axis, start)), plates()
    finding = only(spiked)
    there = plates_alone(sound).along(axis)["axis"]
    assert (finding.code, finding.severity, finding.where.axis) == ("P109", Severity.CORRECTED, there)
    assert finding.evidence["size_n"].value == pytest.approx(-600.0, abs=5.0)
    assert finding.evidence["spikes"].value == 1
    assert finding.where.span_s[0] == pytest.approx(TIME[start + samples // 2], abs=0.0011)
    np.testing.assert_allclose(spiked.force, sound.force, atol=6.0)


def test_a_spike_while_somebody_stands_is_reported():
    spiked = plates(extra=pulse(1, 900.0))
    assert codes(asked(STANDING_CHECKS, plates_alone(spiked))) == ["P109"]


def test_what_is_no_spike_stays():
    """A load of 3 ms, a step, ringing after a heel has landed, hard landings, and noise."""
    ringing = np.zeros((len(TIME), 3))
    ringing[1100:1130, 1] = 250.0 * np.cos(2 * np.pi * 250.0 * TIME[:30]) * np.exp(-TIME[:30] / 0.02)
    landings = [np.zeros((len(TIME), 3)) for _ in range(4)]
    for landing, lasts_ms in zip(landings, (5, 8, 12, 20), strict=True):
        landing[1100 : 1100 + lasts_ms, 1] = 2500.0 * np.sin(np.pi * (np.arange(lasts_ms) + 0.5) / lasts_ms)
    for extra in (pulse(3, 400.0), np.cumsum(pulse(1, 300.0), axis=0), ringing, *landings):
        assert plates(extra=extra).spikes == ((),)
        assert [finding for finding in found(plates(extra=extra)) if finding.code == "P109"] == []


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_horizontal_amplifier_at_the_end_of_its_range(sign):
    plate = plates()
    force = plate.force.copy()
    loaded = force[:, 0, 1] > 0
    push = sign * 150.0 * np.sin(2 * np.pi * (TIME - 1) / 0.6)
    force[loaded, 0, 0] = push[loaded]
    assert found(replace(plate, force=force)) == []
    force[..., 0] = sign * np.minimum(sign * force[..., 0], 90.0)
    cut = only(replace(plate, force=force))
    assert (cut.code, cut.where.axis, cut.evidence["level_n"].value) == ("P104", "fore-aft", sign * 90.0)


@pytest.mark.parametrize(("samples", "severity"), [(10, None), (60, Severity.WARNING), (200, Severity.ERROR)])
def test_repeated_samples(samples, severity):
    plate = plates()
    force, moment = plate.force.copy(), plate.moment.copy()
    for values in (force, moment):
        values[1200 : 1200 + samples] = values[1200]
    repeated = [reported for reported in found(replace(plate, force=force, moment=moment)) if reported.is_open]
    assert [(finding.code, finding.severity) for finding in repeated] == (
        [] if severity is None else [("P103", severity)]
    )
    for finding in repeated:
        assert finding.where.span_s == pytest.approx((1.2, 1.199 + samples / 1000))


def test_late_forces_that_begin_with_copies_of_the_first_are_not_repeated():
    plate, rows = plates(), slice(1200, 1500)
    force, moment = (values[rows][np.maximum(np.arange(300) - 100, 0)] for values in (plate.force, plate.moment))
    assert found(replace(plate, time=plate.time[rows], force=force, moment=moment)) == []


def test_a_child_who_stands_on_two_plates_is_no_zero():
    """Each carries 98 N, as steadily as an unloaded plate."""
    vertical = 98.0 + 20.0 * np.sin(np.pi * TIME) ** 2
    noise = np.random.default_rng(100).normal(0.0, 1.0, (len(TIME), 3))
    load = without_unloaded_level(TIME, np.outer(vertical, [0.0, 1.0, 0.0]) + noise, np.zeros((len(TIME), 3)))
    force = np.repeat(load.force[:, None], 2, axis=1)
    force[:, 1, 1] = 2.0 * vertical.mean() - force[:, 0, 1]  # sways from one to the other
    moment = 0.01 * force * [0.0, 1.0, 0.0]
    plate = PlateLoads(TIME, ("plate 1", "plate 2"), force, moment, (None, None), unloaded=(load.unloaded,) * 2)
    assert found(plate, mass_kg=20.0) == []


def test_a_dead_moment_channel_keeps_the_centre_of_pressure_on_a_line(recording_of):
    """No channel of forces was dead, and joint moments were 8 SD off."""
    recording = recording_of("synthetic/walk.c3d")
    plates = recording.plates
    about = np.cross(plates.corners.mean(axis=1)[None], plates.force)
    moment = plates.moment - about
    moment[:, 0] *= [0.0, 1.0, 1.0]
    dead = replace(recording, plates=replace(plates, moment=moment + about))
    assert [(finding.code, finding.where.plate) for finding in found(dead.plates) if finding.code == "P111"] == [
        ("P111", "plate 1")
    ]
    assert [finding for finding in found(plates) if finding.code == "P111"] == []
    # a depth of the transducers, which readers account for, brings it to life only for horizontal forces
    deep = moment + np.cross([0.0, 0.04, 0.0], plates.force) * [1.0, 1.0, 1.0]
    assert "P111" in {finding.code for finding in found(replace(plates, moment=deep + about))}
    # deeper than any, the force of a tilted vertical goes with the moment
    tilted = moment + np.cross([0.0, 0.15, 0.0], plates.force)
    assert "P111" not in {finding.code for finding in found(replace(plates, moment=tilted + about))}


OTHERS = {
    "long walk, synthetic": LONG_WALKS["synthetic"],
    **{f"run, {name}": files for name, files in RUNS.items()},
    **{f"squats at 100 Hz, {name}": files for name, files in SQUATS.items()},
    **named_here(
        {
            "drop jump": ("field/laiarnold5_jump/DJ1.trc", "field/laiarnold5_jump/DJ1_forces.mot"),
            "100 samples a second": ("subject4/walking1.trc", "subject4/walking1_grf.mot"),
            "BTS": ("c3d_variety/bts.c3d", None),
            "AMTI": ("c3d_variety/ist.c3d", None),
        }
    ),
}


@pytest.mark.parametrize("name", [*WALKS, *OTHERS])
def test_fault_free_forces(name, recording_of):
    assert [*mains_interference(plates_alone(recording_of(*{**WALKS, **OTHERS}[name]).plates))] == []


@pytest.mark.parametrize("name", WALKS)
@pytest.mark.parametrize("mains_hz", [50.0, 60.0])
@pytest.mark.parametrize("axis", [0, 1])
def test_interference(name, mains_hz, axis, recording_of):
    plates = recording_of(*WALKS[name]).plates
    hum = np.sin(2 * np.pi * mains_hz * plates.time + 1.0)
    for size, severity in ((8.0, Severity.WARNING), (25.0, Severity.ERROR)):
        force = plates.force.copy()
        loaded = force[:, 0, 1] > 0
        force[loaded, 0, axis] += size * hum[loaded]
        context = plates_alone(replace(plates, force=force))
        (found,) = mains_interference(context)
        assert (found.code, found.severity) == ("P107", severity)
        assert found.where == context.at(plate=plates.names[0], **context.along(axis))
        assert found.evidence["amplitude_n"].value == pytest.approx(size, rel=0.15)
        assert found.evidence["frequency_hz"].value == mains_hz


def test_interference_that_the_unloaded_plate_shows_is_filtered(recording_of):
    """Its noise says from which force on the plate is loaded, and how far forces are low-passed."""
    plates = recording_of(*WALKS["synthetic"]).plates
    hum = np.outer(25.0 * np.sin(2 * np.pi * 50.0 * plates.time), [0.0, 1.0, 0.0])
    force = plates.force + (plates.force[..., 1:2] > 0) * hum[:, None]
    for noise_n, severity in ((18.0, Severity.WARNING), (1.0, Severity.ERROR)):
        known = replace(plates, force=force, noise_n=(noise_n,) * len(plates.names))
        assert {finding.severity for finding in mains_interference(plates_alone(known))} == {severity}
