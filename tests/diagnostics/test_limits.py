"""Limits of findings: just below each nothing is found, or less; just above, it is. Numbers are those of the texts."""

from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.diagnostics.evidence.force_mass import ForceMass
from kinertia.diagnostics.markers.trajectories import visible
from kinertia.diagnostics.plates.cop_path import cop_on_plate
from kinertia.diagnostics.plates.signals import quantisation
from kinertia.diagnostics.plates.zeros import zeros
from kinertia.diagnostics.result import masses, plate_errors
from kinertia.diagnostics.result.residuals import residuals_of
from kinertia.diagnostics.subject import body_data, movements
from kinertia.diagnostics.subject.body_data import stated_and_filed
from kinertia.diagnostics.subject.mass import masses_of_trials, stated_mass
from kinertia.diagnostics.timing import belt_speed
from kinertia.estimation.total_mass import TotalMass
from kinertia.findings.where import Where
from kinertia.trial.data import Markers, PlateLoads
from kinertia.trial.unloaded_level import UnloadedReading
from marker_contexts import context_of
from plate_findings import plates_alone

FEW = np.arange(200)
STATED = TotalMass(70.0, 70.0, 0.0)


def at(**where):
    return Where(trial="walk", **where)


def plates(vertical, x_m):
    """One plate of a square metre, loaded by this force (k,) at this place (k,)."""
    force, place = np.zeros((len(x_m), 1, 3)), np.zeros((len(x_m), 1, 3))
    force[:, 0, 1], place[:, 0, 0], place[:, 0, 2] = vertical, x_m, 0.5
    corners = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 0.0, 1.0]]])
    return PlateLoads(np.arange(len(x_m)) / 1000, ("plate",), force, np.cross(place, force), (None,), corners)


def off_the_plate(share):
    beyond = np.arange(1000) < round(1000 * share)
    return cop_on_plate(plates_alone(plates(np.full(1000, 500.0), np.where(beyond, 1.1, 0.5))))


def unloaded(level_n=(0.0, 0.0, 0.0), drift_n=0.0, adult_share=1.0):
    reading = UnloadedReading(level_n, drift_n, 800.0, 0.0)
    seen = SimpleNamespace(names=("plate",), unloaded=(reading,), force=np.zeros((10, 1, 3)))
    return zeros(SimpleNamespace(plates=seen, adult_share=adult_share, at=at, along=lambda axis: {}))


def overshooting(seconds):
    loads = plates(np.full(200, 500.0), np.full(200, 0.5))
    object.__setattr__(loads, "unloaded", (UnloadedReading((0.0, 0.0, 0.0), 0.0, 800.0, seconds),))
    return quantisation(plates_alone(loads))


def estimated_mass(total_kg):
    ready = SimpleNamespace(total_mass=TotalMass(70.0, 70.0, 1.0))
    fit = SimpleNamespace(estimate=SimpleNamespace(total_mass_kg=total_kg))
    return masses.total_mass(SimpleNamespace(fit=fit, ready=ready))


def mass_of_the_motion(mass_kg, patched):
    patched.setattr(masses, "mass_from_force_kg", lambda literature, trial: mass_kg)
    fit = SimpleNamespace(trials=[SimpleNamespace(name="walk")])
    by_markers = {"walk": SimpleNamespace(mass_kg=70.0, sd_kg=0.5)}
    ready = SimpleNamespace(literature=None)
    return masses.forces_of_the_motion(SimpleNamespace(fit=fit, ready=ready, force_masses=by_markers))


def item(mass_in_sds):
    estimate = SimpleNamespace(segments=("bag",), mass_kg=np.array([mass_in_sds]))
    fit = SimpleNamespace(estimate=estimate, posterior=SimpleNamespace(sd=np.array([[1.0]])))
    ready = SimpleNamespace(attached=[SimpleNamespace(name="bag", mass_kg=None)])
    return masses.attached_items(SimpleNamespace(fit=fit, ready=ready))


def residual(size, column, peak=False, external_n=1e6):
    """Always of this size, or in one frame of ten thousand."""
    left = np.zeros((10_000, 6))
    left[: 1 if peak else None, column] = size
    loads = np.zeros((10_000, 2, 6))
    loads[:, 0, 1] = external_n
    each = {"estimate": left}
    kinematics = SimpleNamespace(foot_loads=loads, complete=True)
    trial = SimpleNamespace(name="walk", residuals=each, full_residuals=each, kinematics=kinematics, motion_hz=6.0)
    return residuals_of(trial, mass_kg=0.0)  # of no body is any of it harmless


def filed(**values):
    recording = SimpleNamespace(**{"mass_kg": None, "height_m": None, **values})
    trial = SimpleNamespace(name="walk", recording=recording)
    subject = SimpleNamespace(mass_kg=70.0, height_m=1.8)
    return stated_and_filed(SimpleNamespace(subject=subject, standing=[], trials=[trial], total_mass=None))


def weighed(*masses_kg):
    """A person with trials whose forces give these masses, within 0.5 kg."""
    trials = [
        SimpleNamespace(
            name=f"walk {k}",
            force_mass=ForceMass(kg, 0.5, "whole strides", FEW / 100, np.full(len(FEW), kg)),
            plates=object(),
            standing_mass=None,
            is_static=False,
            travel=SimpleNamespace(kind="walks"),
            whole_plate_masses={},
        )
        for k, kg in enumerate(masses_kg)
    ]
    return SimpleNamespace(total_mass=STATED, trials=trials, standing=[], subject=SimpleNamespace(), static=None)


def belt(feet_m_s, patched):
    patched.setattr(belt_speed, "standing_speeds", lambda markers, feet: (feet_m_s, feet_m_s))
    own = SimpleNamespace(distance_m=lambda start, end: 2.0 * (end - start))
    stated = SimpleNamespace(under=lambda foot: own, speed_m_s=np.array([2.0]))
    markers, recording = SimpleNamespace(time=FEW / 100), SimpleNamespace(belt=stated)
    return belt_speed.belt_speed(SimpleNamespace(recording=recording, all_markers=markers, feet=object(), at=at))


def moving(lean_deg, drop_m, patched):
    moved = movements.InformativeMovements(np.radians(lean_deg), drop_m)
    patched.setattr(movements, "movements_of", lambda trial: moved)
    return movements.informative_movements(SimpleNamespace(trials=[SimpleNamespace(plates=object())]))


def fitted():
    posterior = SimpleNamespace(instruments=None)
    plate = {"turn": SimpleNamespace(sd=0.05)}
    ready = SimpleNamespace(uncertainty=SimpleNamespace(instruments=SimpleNamespace(plate=plate)))
    fit = SimpleNamespace(posterior=posterior)
    return SimpleNamespace(fit=fit, ready=ready, along=lambda axis, plate: Where(plate=plate, axis=axis), errors=())


def displaced(detectable_m, patched):
    patched.setattr(plate_errors, "smallest_detectable", lambda *known: detectable_m)
    return [*plate_errors.common_offset(fitted())][:1]


def rotated(all_deg, one_deg, patched):
    for name, degrees in (("smallest_detectable", all_deg), ("smallest_detectable_of_one", one_deg)):
        patched.setattr(plate_errors, name, lambda *known, degrees=degrees: np.radians(degrees))
    patched.setattr(plate_errors, "equal", lambda *rotations: False)
    patched.setattr(plate_errors, "corrected", lambda *rotations: ())
    return plate_errors.plate_rotation(fitted())


def shown(share):
    positions = np.zeros((1000, 2, 3))
    positions[round(1000 * share) :, 1] = np.nan
    return visible(context_of(Markers(np.arange(1000) / 100, ("A", "B"), positions)))


def tall(share, patched):
    """From ankle to shoulder over the stature."""
    heights = {"ankle_lateral": 0.0, "knee_lateral": 0.4, "asis": 0.9, "acromion": 1.4}
    marks = {f"{name}_{side}": np.array([0.0, high, 0.0]) for name, high in heights.items() for side in "rl"}
    patched.setattr(body_data, "find_landmarks", lambda recording, marker_set: marks)
    return body_data.stature(SimpleNamespace(height_m=1.4 / share, marker_set=object(), recording=None, at=at))


STEADY = np.full(200, 500.0)
CASES = {
    "P245 share": (off_the_plate, 0.049, 0.051, [], ["P245 WARNING"]),
    "P245 most": (off_the_plate, 0.499, 0.501, ["P245 WARNING"], ["P245 ERROR"]),
    "P211 drift": (lambda n: unloaded(drift_n=n), 14.9, 15.1, [], ["P211 WARNING"]),
    "P213 across": (lambda n: unloaded((n, 0.0, 0.0)), 14.9, 15.1, [], ["P213 WARNING"]),
    "P213 down": (lambda n: unloaded((0.0, -n, 0.0)), 14.9, 15.1, [], ["P213 WARNING"]),
    "P213 far": (lambda n: unloaded((0.0, n, 0.0)), 39.9, 40.1, ["P213 WARNING"], ["P213 ERROR"]),
    "P213 child": (lambda n: unloaded((n, 0.0, 0.0), adult_share=0.5), 7.4, 7.6, [], ["P213 WARNING"]),
    "P213 infant": (lambda n: unloaded((n, 0.0, 0.0), adult_share=0.1), 5.9, 6.1, [], ["P213 WARNING"]),
    "P105": (
        lambda n: quantisation(plates_alone(plates(300 + n * (FEW % 20), STEADY / 1e3))),
        7.4,
        7.6,
        [],
        ["P105 WARNING"],
    ),
    "P106": (
        lambda m: quantisation(plates_alone(plates(STEADY, 0.2 + m * (FEW % 10)))),
        0.0074,
        0.0076,
        [],
        ["P106 WARNING"],
    ),
    "P108": (overshooting, 0.059, 0.061, [], ["P108 WARNING"]),
    "S113": (estimated_mass, 74.05, 74.15, [], ["S113 WARNING"]),
    "S113 lighter": (lambda kg: estimated_mass(70.0 - kg), 4.05, 4.15, [], ["S113 WARNING"]),
    "R107": (mass_of_the_motion, 74.4, 74.6, [], ["R107 WARNING"]),
    "S407": (item, 2.05, 1.95, [], ["S407 WARNING"]),
    "R301 rms": (lambda n: residual(n, 0), 4.9, 5.1, [], ["R301 WARNING"]),
    "R301 rms far": (lambda n: residual(n, 1), 9.9, 10.1, ["R301 WARNING"], ["R301 ERROR"]),
    "R301 peak": (lambda n: residual(n, 2, True), 9.9, 10.1, [], ["R301 WARNING"]),
    "R301 peak far": (lambda n: residual(n, 0, True), 24.9, 25.1, ["R301 WARNING"], ["R301 ERROR"]),
    "R302 rms": (lambda n: residual(n, 3), 29.9, 30.1, [], ["R302 WARNING"]),
    "R302 rms far": (lambda n: residual(n, 4), 49.9, 50.1, ["R302 WARNING"], ["R302 ERROR"]),
    "R302 peak": (lambda n: residual(n, 5, True), 49.9, 50.1, [], ["R302 WARNING"]),
    "R302 peak far": (lambda n: residual(n, 3, True), 74.9, 75.1, ["R302 WARNING"], ["R302 ERROR"]),
    "R303": (lambda n: residual(n, 0, True, external_n=100.0), 4.9, 5.1, [], ["R303 ERROR"]),
    "S103 mass": (lambda kg: filed(mass_kg=kg), 70.6, 70.8, [], ["S103 WARNING"]),
    "S103 stature": (lambda m: filed(height_m=m), 1.783, 1.781, [], ["S103 WARNING"]),
    "S111": (lambda kg: stated_mass(weighed(kg)), 72.5, 72.7, [], ["S111 WARNING"]),
    "S111 far": (lambda kg: stated_mass(weighed(kg)), 78.1, 78.4, ["S111 WARNING"], ["S111 ERROR"]),
    "S306": (lambda kg: masses_of_trials(weighed(70.0, kg)), 78.3, 78.6, [], ["S306 ERROR"]),
    "T301": (belt, 1.51, 1.49, [], ["T301 WARNING"]),
    "S312 sway": (lambda deg, patched: moving(deg, 0.2, patched), 12.1, 11.9, [], ["S312 INFO"]),
    "S312 squats": (lambda m, patched: moving(20.0, m, patched), 0.151, 0.149, [], ["S312 INFO"]),
    "P248": (displaced, 0.0149, 0.0151, [], ["P248 INFO"]),
    "P235 all": (lambda deg, patched: rotated(deg, 1.0, patched), 1.95, 2.05, [], ["P235 INFO"]),
    "P235 one": (lambda deg, patched: rotated(1.0, deg, patched), 3.95, 4.05, [], ["P235 INFO"]),
    "M102": (shown, 0.505, 0.495, ["M103 INFO"], ["M102 INFO"]),
    "S104 above": (tall, 0.869, 0.871, [], ["S104 WARNING"]),
    "S104 below": (tall, 0.761, 0.759, [], ["S104 WARNING"]),
    "S104 impossible": (tall, 0.999, 1.001, ["S104 WARNING"], ["S104 ERROR"]),
    "S104 impossible too": (tall, 0.651, 0.649, ["S104 WARNING"], ["S104 ERROR"]),
}
"""Check, a value just within the limit, one just beyond it, and what is found of each."""


@pytest.mark.parametrize("case", CASES)
def test_limits(case, monkeypatch):
    question, within, beyond, few, more = CASES[case]
    for value, expected in ((within, few), (beyond, more)):
        patched = [monkeypatch] * ("patched" in question.__code__.co_varnames[: question.__code__.co_argcount])
        assert [f"{one.code} {one.severity.name}" for one in question(value, *patched)] == expected, value
