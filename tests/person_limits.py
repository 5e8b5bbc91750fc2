"""Cases of limits of findings about time, and about the person; `marker_limits` says what a case is."""

from types import SimpleNamespace

import numpy as np

from kinertia.diagnostics.evidence.force_mass import ForceMass
from kinertia.diagnostics.evidence.segment_distances import LOWER_BODY
from kinertia.diagnostics.markers import axes_and_floor
from kinertia.diagnostics.plates import contact_delays, force_timing
from kinertia.diagnostics.plates.force_timing import TrialDelay, force_rate, uneven_delays
from kinertia.diagnostics.plates.ground_contact import foreign_load
from kinertia.diagnostics.subject import body_data, movements
from kinertia.diagnostics.subject.body_data import stated_and_filed
from kinertia.diagnostics.subject.mass import masses_of_trials, stated_mass
from kinertia.diagnostics.subject.movements import flat_feet
from kinertia.diagnostics.subject.same_person import static_and_trials, trials_of_one_person
from kinertia.diagnostics.subject.same_session import trial_scales
from kinertia.estimation.prepared import TotalMass
from kinertia.findings.quantity import Where
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import Markers, Recording
from marker_contexts import context_of
from plate_findings import plates_alone
from plate_limits import plates

FEW = np.arange(200)
STEADY = np.full(200, 500.0)
STATED = TotalMass(70.0, 70.0, 0.0)


def at(**where):
    return Where(trial="walk", **where)


def tall(share, patched):
    """From ankle to shoulder over the stature."""
    heights = {"ankle_lateral": 0.0, "knee_lateral": 0.4, "asis": 0.9, "acromion": 1.4}
    marks = {f"{name}_{side}": np.array([0.0, high, 0.0]) for name, high in heights.items() for side in "rl"}
    patched.setattr(body_data, "find_landmarks", lambda recording, marker_set: marks)
    return body_data.stature(SimpleNamespace(height_m=1.4 / share, marker_set=object(), recording=None, at=at))


def on_a_block(height_m):
    marks = {f"{name}_{side}": (f"{side}{name}",) for name in ("heel", "metatarsal") for side in "rl"}
    labels = tuple(label for mark in marks.values() for label in mark)
    places = np.zeros((20, 4, 3))
    places[:, ::2, 1] = height_m
    return flat_feet(context_of(Markers(np.arange(20) / 100, labels, places), MarkerSet("feet", marks, {}, {})))


def two_of(ratio):
    """Two trials of a pelvis with this ratio of its distances."""
    labels = tuple("ABCDE")
    marker_set = MarkerSet("pelvis", {}, dict.fromkeys(LOWER_BODY, ()) | {"pelvis": labels}, {})
    places = np.random.default_rng(100).normal(0.0, 0.15, (1, 5, 3)).repeat(20, axis=0)
    return [
        context_of(Recording(name, Markers(np.arange(20) / 100, labels, size * places)), marker_set)
        for name, size in (("first", 1.0), ("other", ratio))
    ]


def of_sizes(ratio):
    trials = two_of(ratio)
    return [*trials_of_one_person(SimpleNamespace(marker_set=trials[0].marker_set, trials=trials, standing=()))][:1]


def standing_of_another(ratio):
    """A trial whose distances are this multiple of the static trial's."""
    first, other = two_of(ratio)
    person = SimpleNamespace(
        marker_set=first.marker_set, trials=[other], standing=[first], static=first, has_error=lambda *known: False
    )
    return static_and_trials(person)


def recalibrated(ratio):
    trials = two_of(ratio)
    return [*trial_scales(SimpleNamespace(marker_set=trials[0].marker_set, trials=trials, standing=()))][:1]


def above_the_floor(height_m, patched):
    patched.setattr(axes_and_floor, "_lowest", lambda context, percentile: ("heel", height_m))
    return axes_and_floor.floor(SimpleNamespace(static=SimpleNamespace(at=at), trials=()))


def supporting(share, seconds, complete):
    """Mass by forces that are this share of body weight, for so long, and nearly right for this share of the time."""
    supported = np.full(2000, 70.0 * 1.2)  # neither right nor far off
    supported[: round(2000 * complete)] = 70.0
    supported[-round(1000 * seconds) - 1 :] = 70.0 * share
    return ForceMass(70.0, 0.5, "whole strides", np.arange(2000) / 1000, supported)


def somebody_else(share=1.5, seconds=0.5, complete=0.5):
    found = supporting(share, seconds, complete).foreign(70.0)
    context = SimpleNamespace(foreign_load=found, plates=None, foreign_contacts=(), trial_on_plates=None, at=at)
    return foreign_load(context)


def supported_elsewhere(share=0.5, seconds=0.5, complete=0.5):
    person = weighed(70.0)
    person.trials[0].force_mass = supporting(share, seconds, complete)
    return stated_mass(person)


def late(seconds, patched, uneven_s=0.0):
    """Loads that begin and end late; where they are uneven, they begin later by this and end earlier by it."""
    delays = SimpleNamespace(
        grows=lambda start_s: False,
        delay_s=seconds,
        median_s=seconds + np.array([uneven_s, -uneven_s]),
        time=np.zeros((3, 2)),
        by_rate=lambda start: None,
    )
    patched.setattr(contact_delays.ContactDelays, "of", lambda contacts, feet: delays)
    patched.setattr(contact_delays, "contacts_of", lambda plates, feet: [SimpleNamespace(distance_m=0.0)])
    context = plates_alone(plates(STEADY, np.full(200, 0.5)))
    made = SimpleNamespace(plates=context.plates, foot_trajectories=(), whole_contacts=(), velocities=(), at=at)
    return [contact_delay.finding for contact_delay in contact_delays.contact_delays(made)]


def moved_by_forces(ratio):
    changes = SimpleNamespace(vertical_ratio=lambda velocity: ratio, pelvis=None, centre=None)
    context = SimpleNamespace(
        velocity_changes=changes, velocity_changes_on_plates=changes, has_strides=True, trial=None, at=at
    )
    return force_rate(context)


def uneven(seconds, short=False):
    return [*uneven_delays([TrialDelay("one", 0.0, 0.0, short), TrialDelay("other", seconds, seconds, short)])][:1]


def belt(feet_m_s, patched, stated_m_s=2.0):
    patched.setattr(force_timing, "standing_speeds", lambda markers, feet: (feet_m_s, feet_m_s))
    belt_of_foot = SimpleNamespace(distance_m=lambda start, end: stated_m_s * (end - start))
    stated = SimpleNamespace(under=lambda foot: belt_of_foot, speed_m_s=np.array([stated_m_s]))
    markers, recording = SimpleNamespace(time=FEW / 100), SimpleNamespace(belt=stated)
    return force_timing.belt_speed(SimpleNamespace(recording=recording, all_markers=markers, feet=object(), at=at))


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
    return SimpleNamespace(
        total_mass=STATED, trials=trials, standing=[], subject=SimpleNamespace(mass_kg=STATED.body_kg), static=None
    )


def leaning(lean_rad, drop_m, patched):
    moved = movements.InformativeMovements(lean_rad, drop_m)
    patched.setattr(movements, "movements_of", lambda trial: moved)
    return movements.informative_movements(SimpleNamespace(trials=[SimpleNamespace(plates=object())]))


PERSON_LIMITS = {
    "P202 unit": (
        lambda off: stated_mass(weighed(70.0 * 0.2248 * (1 + off))),
        0.105,
        0.095,
        [],
        ["ERROR"],
    ),
    "P281 missing": (lambda share: supported_elsewhere(1 - share), 0.24, 0.26, [], ["WARNING"]),
    "P281 missing_for": (lambda s: supported_elsewhere(seconds=s), 0.198, 0.202, [], ["WARNING"]),
    "P281 complete": (lambda share: supported_elsewhere(complete=share), 0.24, 0.26, [], ["WARNING"]),
    "P284 share": (lambda share: somebody_else(1 + share), 0.29, 0.31, [], ["ERROR"]),
    "P284 lasts": (lambda s: somebody_else(seconds=s), 0.148, 0.152, [], ["ERROR"]),
    "P284 right": (lambda share: somebody_else(complete=share), 0.24, 0.26, [], ["ERROR"]),
    "T202 least": (moved_by_forces, 0.41, 0.39, [], ["ERROR"]),
    "T202 most": (moved_by_forces, 1.79, 1.81, [], ["ERROR"]),
    "T211 delay": (late, 0.044, 0.046, [], ["ERROR"]),
    "T211 ends": (lambda s, patched: late(0.06, patched, 0.06 - s), 0.029, 0.031, [], ["ERROR"]),
    "T212 longest": (late, 0.249, 0.251, [], ["ERROR"]),
    "T213 delay": (uneven, 0.0119, 0.0121, [], ["WARNING"]),
    "T213 short": (lambda s: uneven(s, True), 0.0179, 0.0181, [], ["WARNING"]),
    "T301 apart": (belt, 1.51, 1.49, [], ["WARNING"], lambda share: 2 * (1 - share)),
    "T301 slow": (
        lambda v, patched: belt(0.4, patched, v),
        0.69,
        0.71,
        [],
        ["WARNING"],
        lambda limit: 0.4 + limit,
    ),
    "S103 same; mass": (lambda kg: filed(mass_kg=kg), 70.6, 70.8, [], ["WARNING"], lambda share: 70 * (1 + share)),
    "S103 same; stature": (
        lambda m: filed(height_m=m),
        1.783,
        1.781,
        [],
        ["WARNING"],
        lambda share: 1.8 * (1 - share),
    ),
    "M143 lowest": (above_the_floor, 0.0051, 0.0049, [], ["WARNING"]),
    "M143 highest": (above_the_floor, 0.0499, 0.0501, [], ["WARNING"]),
    "S104 long": (tall, 0.869, 0.871, [], ["WARNING"]),
    "S104 short": (tall, 0.761, 0.759, [], ["WARNING"]),
    "S104 longest": (tall, 0.999, 1.001, ["WARNING"], ["ERROR"]),
    "S104 shortest": (tall, 0.651, 0.649, ["WARNING"], ["ERROR"]),
    "S111 share": (
        lambda kg: stated_mass(weighed(kg)),
        72.5,
        72.7,
        [],
        ["WARNING"],
        lambda share: 70 * (1 + share) + 1.24,
    ),
    "S111 error": (
        lambda kg: stated_mass(weighed(kg)),
        78.1,
        78.4,
        ["WARNING"],
        ["ERROR"],
        lambda share: 70 * (1 + share) + 1.27,
    ),
    "S111 agreed": (
        lambda kg: stated_mass(weighed(kg, kg)),
        74.3,
        74.5,
        ["WARNING"],
        ["ERROR"],
        lambda share: 70 * (1 + share) + 0.88,
    ),
    "S112 unit": (lambda off: stated_mass(weighed(70.0 * 0.45359 * (1 + off))), 0.105, 0.095, [], ["ERROR"]),
    "S202 apart": (on_a_block, 0.0399, 0.0401, [], ["WARNING"]),
    "S305 ratio": (of_sizes, 1.049, 1.051, [], ["ERROR"], lambda share: 1 + share),
    "S203 ratio": (standing_of_another, 1.048, 1.052, [], ["ERROR"], lambda share: 1 + share),
    "S205 scale": (recalibrated, 1.0095, 1.0105, [], ["WARNING"], lambda share: 1 + share),
    "S306 share": (
        lambda kg: masses_of_trials(weighed(70.0, kg)),
        78.3,
        78.6,
        [],
        ["ERROR"],
        lambda share: 70 * (1 + share) + 1.41,
    ),
    "S312 sway": (lambda rad, patched: leaning(rad, 0.2, patched), 0.211, 0.208, [], ["INFO"]),
    "S312 squat": (lambda m, patched: leaning(0.35, m, patched), 0.151, 0.149, [], ["INFO"]),
}
