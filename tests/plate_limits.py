"""Cases of limits of findings about force plates; `marker_limits` says what a case is."""

from types import SimpleNamespace

import numpy as np

from kinertia.diagnostics.evidence.ambiguous_loads import stray_contacts
from kinertia.diagnostics.plates import cop_positions, free_moments, plate_positions
from kinertia.diagnostics.plates import signals as plate_signals
from kinertia.diagnostics.plates.cop_positions import cop_on_plate, loads_and_feet
from kinertia.diagnostics.plates.force_directions import axes_and_units
from kinertia.diagnostics.plates.gains import gains
from kinertia.diagnostics.plates.ground_contact import stray_loads
from kinertia.diagnostics.plates.plate_positions import repeated_plates
from kinertia.diagnostics.plates.signals import dead_moments, low_passed, mains_interference, quantisation, signals
from kinertia.diagnostics.plates.zeros import zeros
from kinertia.findings.quantity import Where
from kinertia.trial.data import PlateLoads
from kinertia.trial.plate_signals import UnloadedReading
from plate_findings import plates_alone

FEW = np.arange(200)
STEADY = np.full(200, 500.0)


def at(**where):
    return Where(trial="walk", **where)


def plates(vertical, x_m, across_n=0.0, free_nm=0.01, z_m=0.5):
    """One plate of a square metre, loaded by these forces (k,) at this place (k,), with a free moment per newton."""
    force, place = np.zeros((len(x_m), 1, 3)), np.zeros((len(x_m), 1, 3))
    force[:, 0, 1], place[:, 0, 0], place[:, 0, 2], force[:, 0, 0] = vertical, x_m, z_m, across_n
    moment = np.cross(place, force)
    moment[..., 1] += free_nm * force[..., 1]
    corners = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 0.0, 1.0]]])
    return PlateLoads(np.arange(len(x_m)) / 1000, ("plate",), force, moment, (None,), corners)


def off_the_plate(share):
    beyond = np.arange(1000) < round(1000 * share)
    return cop_on_plate(plates_alone(plates(np.full(1000, 500.0), np.where(beyond, 1.1, 0.5))))


def unloaded(level_n=(0.0, 0.0, 0.0), drift_n=0.0, adult_share=1.0):
    reading = UnloadedReading(level_n, drift_n, 800.0, 0.0)
    seen = SimpleNamespace(names=("plate",), unloaded=(reading,), force=np.zeros((10, 1, 3)))
    return zeros(SimpleNamespace(plates=seen, adult_share=adult_share, at=at, along=lambda axis: {}))


def drifting(kg):
    """A plate that drifts by 14 N, under somebody of this mass."""
    loads = plates(STEADY, np.full(200, 0.5))
    object.__setattr__(loads, "unloaded", (UnloadedReading((0.0, 0.0, 0.0), 14.0, 800.0, 0.0),))
    return zeros(plates_alone(loads, mass_kg=kg))


def of_mass(kg, level_n=14.0):
    """A plate whose level is this, under somebody of this mass."""
    loads = plates(STEADY, np.full(200, 0.5))
    object.__setattr__(loads, "unloaded", (UnloadedReading((level_n, 0.0, 0.0), 0.0, 800.0, 0.0),))
    return zeros(plates_alone(loads, mass_kg=kg))


def overshooting(seconds):
    loads = plates(STEADY, np.full(200, 0.5))
    object.__setattr__(loads, "unloaded", (UnloadedReading((0.0, 0.0, 0.0), 0.0, 800.0, seconds),))
    return low_passed(plates_alone(loads))


def of_bandwidth(hz, patched):
    patched.setattr(plate_signals, "load_bandwidth_hz", lambda time, vertical: hz)
    return low_passed(plates_alone(plates(STEADY, np.full(200, 0.5))))


def weak(peak_n):
    """A plate whose loads come and go as under feet, with this peak."""
    loads = plates(np.zeros(200), np.full(200, 0.5))
    object.__setattr__(loads, "unloaded", (UnloadedReading((0.0, 0.0, 0.0), 0.0, peak_n, 0.0, like_steps=True),))
    return axes_and_units(plates_alone(loads))


def dead(across_n=0.0, vertical_n=700.0, **stated):
    loads = plates(np.full(200, vertical_n), 0.4 + FEW / 1e3, across_n)
    loads.force[..., 2] = 20.0
    return signals(plates_alone(loads, **stated))


def dead_moment(size_nm, vertical_n=700.0, **stated):
    """Of a load at the middle of a plate in one direction, but for this moment."""
    z_m = 0.5 + np.where(FEW % 2, 1.0, -1.0) * size_nm / vertical_n
    loads = plates(np.full(200, vertical_n), 0.4 + FEW / 1e3, 0.0, z_m=z_m)
    return dead_moments(plates_alone(loads, **stated))


def noisy_step(count=1000, swing_n=50.0):
    """Vertical forces (k,) of a load with a little noise."""
    return 600.0 + swing_n * np.sin(np.arange(count) / 100) + np.random.default_rng(100).normal(0.0, 1.0, count)


def lost(seconds=0.03, before_n=600.0):
    """A plate reads nothing for so long, after a load of this size; a second one is loaded all the time."""
    vertical = noisy_step(swing_n=0.0)
    vertical[480:500] = before_n
    plate = plates(vertical, np.full(1000, 0.5), across_n=10.0 + vertical / 100)
    force = np.concatenate([plate.force, plate.force[::-1]], axis=1)
    force[500 : 500 + round(1000 * seconds), 0] = 0.0
    moment = np.concatenate([plate.moment, plate.moment], axis=1)
    return signals(plates_alone(PlateLoads(plate.time, ("plate", "other"), force, moment, (None, None))))


def repeated(seconds):
    plate = plates(noisy_step(), np.full(1000, 0.5), across_n=noisy_step() / 10)
    span = slice(500, 501 + round(1000 * seconds))
    plate.force[span], plate.moment[span] = plate.force[500], plate.moment[500]
    return signals(plates_alone(plate))


def saturated(seconds):
    """A load that rises by 20 N a sample to the end of the range, stays there, and falls."""
    rise = np.arange(0.0, 800.0, 20.0)
    vertical = np.concatenate([np.zeros(50), rise, np.full(1 + round(1000 * seconds), 800.0), rise[::-1], np.zeros(50)])
    vertical[vertical > 0] += np.random.default_rng(100).normal(0.0, 1.0, (vertical > 0).sum()) * (
        vertical[vertical > 0] < 800.0
    )
    return signals(plates_alone(plates(vertical, np.full(len(vertical), 0.5), across_n=vertical / 40)))


def humming(amplitude_n):
    time = np.arange(1000) / 1000
    return mains_interference(
        plates_alone(plates(600.0 + amplitude_n * np.sin(2 * np.pi * 50 * time), np.full(1000, 0.5)))
    )


def twisting(lever_arm_m):
    return axes_and_units(plates_alone(plates(STEADY, np.full(200, 0.5), free_nm=lever_arm_m)))


def outside(distance_m):
    contact = SimpleNamespace(plate=0, distance_m=distance_m)
    context = SimpleNamespace(
        is_static=False,
        foot_trajectories=(),
        contacts=[contact],
        plates=SimpleNamespace(names=("plate",)),
        shows_whole_feet=False,
        at=at,
    )
    context.foot_trajectories = (object(),)
    return loads_and_feet(context)


def away_from_feet(distance_m):
    """Loads of one plate that are this far from the feet, each in another direction."""
    contacts = [
        SimpleNamespace(
            distance_m=distance_m, own_offset_m=np.array(offset_m), between=False, time=np.arange(3.0), plate=0
        )
        for offset_m in ((distance_m, 0.0), (0.0, distance_m))
    ]
    context = SimpleNamespace(plates=SimpleNamespace(names=("plate",)), contacts=contacts, at=at)
    return [hypothesis.finding for hypothesis in cop_positions._displaced(context)]


def weighing(ratio):
    """Two plates on which one body weighs differently."""
    return gains(
        SimpleNamespace(
            plates=SimpleNamespace(names=("one", "other")),
            trial=object(),
            plate_masses={"one": 70.0 * ratio, "other": 70.0},
            plates_reached_beyond=(),
            velocities=(),
            at=at,
            along=lambda axis: {},
        )
    )


def raised(height_m, patched):
    patched.setattr(plate_positions, "heights_on_plates", lambda trial: {"plate": (height_m, 0.0)})
    return plate_positions.plate_heights(SimpleNamespace(trials=[SimpleNamespace(at=at)]))


def progressing(patched, first=0.3, other=0.3, range_m=0.1):
    """Steps on two plates, with these shares of the foot from heel to toe, and this range of the first."""
    steps = [
        SimpleNamespace(plate=p, foot=p, is_step=True, place=np.array([[0.0, 0.0], [size, 0.0]]), share=share)
        for p, (share, size) in enumerate(((first, range_m), (other, 0.1)))
    ]
    patched.setattr(cop_positions, "heel_steps", lambda context: steps)
    patched.setattr(cop_positions, "_progression_m", lambda step, foot: 0.2 * step.share)
    feet = (SimpleNamespace(length_m=0.2), SimpleNamespace(length_m=0.2))
    named = SimpleNamespace(names=("one", "other"))
    return cop_positions.cop_progression(SimpleNamespace(plates=named, foot_trajectories=feet, is_static=False, at=at))


def columns(lever_arm_m):
    return free_moments._columns(
        SimpleNamespace(at=at),
        SimpleNamespace(names=("plate",), torques=(SimpleNamespace(rms_nm=(1.0, 1.0, 1.0), lever_arm_m=lever_arm_m),)),
    )


def untwisted(peak_nm):
    return free_moments.free_moments(plates_alone(plates(np.full(200, 700.0), 0.4 + FEW / 1e3, free_nm=peak_nm / 700)))


def repeated_plate(share):
    """A plate, and another that reads the same but for this share of its peak."""
    plate = plates(700.0 * np.sin(np.linspace(0.0, np.pi, 200)), np.full(200, 0.5))
    force = np.concatenate([plate.force, plate.force], axis=1)
    force[:, 1, 0] += share * 700.0 * np.where(FEW % 2, 1.0, -1.0)
    corners = np.concatenate([plate.corners, plate.corners + 2.0])
    both = PlateLoads(plate.time, ("one", "other"), force, np.zeros_like(force), (None, None), corners)
    return repeated_plates(plates_alone(both))


def standing_by(distance_m):
    contacts = [
        SimpleNamespace(distance_m=offset, between=False, time=np.arange(3.0), plate=0) for offset in (0, 0, distance_m)
    ]
    feet = (SimpleNamespace(seen=lambda time: np.ones(len(time))),) * 2
    named = SimpleNamespace(names=("plate",))
    return stray_loads(SimpleNamespace(plates=named, stray_contacts=stray_contacts(contacts, feet), at=at))


PLATE_LIMITS = {
    "P101 dead": (dead, 0.51, 0.49, [], ["WARNING"]),
    "P101 step": (lambda n: dead(0.0, n, mass_kg=70.0), 349.0, 351.0, [], ["WARNING"]),
    "P101 adult": (lambda kg: dead(0.0, 300.0, mass_kg=kg), 60.2, 59.8, [], ["WARNING"], lambda adult: 6 / 7 * adult),
    "P102 dropped": (lost, 0.063, 0.058, [], ["ERROR"]),
    "P102 carried": (lambda n: lost(before_n=n), 235.0, 247.0, [], ["ERROR"], lambda share: 600.0 * share),
    "P103 repeated": (repeated, 0.024, 0.026, [], ["WARNING"]),
    "P103 long": (repeated, 0.099, 0.101, ["WARNING"], ["ERROR"]),
    "P104 saturated": (saturated, 0.019, 0.021, [], ["WARNING"]),
    "P105 force_step": (
        lambda n: quantisation(plates_alone(plates(300 + n * (FEW % 20), STEADY / 1e3))),
        7.4,
        7.6,
        [],
        ["WARNING"],
    ),
    "P106 cop_step": (
        lambda m: quantisation(plates_alone(plates(STEADY, 0.2 + m * (FEW % 10)))),
        0.0074,
        0.0076,
        [],
        ["WARNING"],
    ),
    "P107 amplitude": (humming, 3.9, 4.1, [], ["WARNING"]),
    "P107 loud": (humming, 14.8, 15.2, ["WARNING"], ["ERROR"]),
    "P108 cutoff": (of_bandwidth, 10.1, 9.9, [], ["WARNING"]),
    "P108 overshoot": (overshooting, 0.059, 0.061, [], ["WARNING"]),
    "P111 dead": (dead_moment, 0.51, 0.49, [], ["ERROR"]),
    "P202 weakest": (weak, 0.29, 0.31, [], ["ERROR"]),
    "P202 threshold": (weak, 20.1, 19.9, [], ["ERROR"]),
    "P203 lever_arm": (twisting, 0.149, 0.151, [], ["ERROR"]),
    "P204 beyond": (outside, 4.99, 5.01, [], ["ERROR"]),
    "P211 drift": (lambda n: unloaded(drift_n=n), 14.9, 15.1, [], ["WARNING"]),
    "P213 zero; across": (lambda n: unloaded((n, 0.0, 0.0)), 14.9, 15.1, [], ["WARNING"]),
    "P213 zero; down": (lambda n: unloaded((0.0, -n, 0.0)), 14.9, 15.1, [], ["WARNING"]),
    "P213 zero; child": (
        lambda n: unloaded((n, 0.0, 0.0), adult_share=0.5),
        7.4,
        7.6,
        [],
        ["WARNING"],
        lambda limit: 0.5 * limit,
    ),
    "P213 far": (lambda n: unloaded((0.0, n, 0.0)), 39.9, 40.1, ["WARNING"], ["ERROR"]),
    "P213 least": (lambda n: unloaded((n, 0.0, 0.0), adult_share=0.1), 5.9, 6.1, [], ["WARNING"]),
    "P211 least": (lambda n: unloaded(drift_n=n, adult_share=0.1), 5.9, 6.1, [], ["WARNING"]),
    "P211 adult": (
        drifting,
        65.5,
        65.1,
        [],
        ["WARNING"],
        lambda adult: 14 / 15 * adult,
    ),
    "P111 step": (lambda n: dead_moment(0.1, n, mass_kg=70.0), 349.0, 351.0, [], ["ERROR"]),
    "P111 adult": (
        lambda kg: dead_moment(0.1, 300.0, mass_kg=kg),
        60.2,
        59.8,
        [],
        ["ERROR"],
        lambda adult: 6 / 7 * adult,
    ),
    "P213 adult": (of_mass, 65.5, 65.1, [], ["WARNING"], lambda adult: 14 / 15 * adult),
    "P221 difference": (weighing, 1.074, 1.076, [], ["WARNING"], lambda share: 1 + share),
    "P245 off_plate": (off_the_plate, 0.049, 0.051, [], ["WARNING"]),
    "P245 most": (off_the_plate, 0.499, 0.501, ["WARNING"], ["ERROR"]),
    "P249 height": (raised, 0.0001, -0.0001, [], ["WARNING"]),
    "P251 fixed": (lambda m, patched: progressing(patched, range_m=m), 0.0021, 0.0019, [], ["WARNING"]),
    "P252 backwards": (lambda share, patched: progressing(patched, first=share), -0.34, -0.36, [], ["WARNING"]),
    "P252 forwards": (lambda share, patched: progressing(patched, -0.5, share), 0.24, 0.26, [], ["WARNING"]),
    "P261 lever_arm": (columns, 0.0049, 0.0051, [], ["WARNING"]),
    "P264 absent": (untwisted, 0.0051, 0.0049, [], ["WARNING"]),
    "P244 far": (away_from_feet, 0.149, 0.151, [], ["ERROR"]),
    "P285 far": (standing_by, 0.299, 0.301, [], ["CORRECTED"]),
    "P287 equal": (repeated_plate, 0.031, 0.029, [], ["ERROR"]),
}
