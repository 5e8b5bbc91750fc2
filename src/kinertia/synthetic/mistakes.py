"""Fifty mistakes that laboratories make, each a change of sound files and the words that name it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kinertia.synthetic import load_mistakes as forces
from kinertia.synthetic import marker_mistakes as markers
from kinertia.synthetic.marker_mistakes import Change
from kinertia.synthetic.measured_person import MeasuredPerson

KG_PER_POUND = 0.45359237


@dataclass(frozen=True)
class Mistake:
    """One mistake.

    Attributes:
        name: what was done.
        change: makes it in the files of a person.
        named: a regular expression that a message that names it matches.
    """

    name: str
    change: Change
    named: str


def _subject(**factors: float) -> Change:
    """Mass or height times a factor, and the rest as it was."""

    def change(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson:
        stated = {key: factor * getattr(person.subject, key) for key, factor in factors.items()}
        return _said(person, stated)

    return change


def _more(**terms: float) -> Change:
    def change(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson:
        return _said(person, {key: getattr(person.subject, key) + term for key, term in terms.items()})

    return change


def _other_sex(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson:
    return _said(person, {"sex": {"male": "female", "female": "male"}[person.subject.sex or "male"]})


def _said(person: MeasuredPerson, stated: dict[str, object]) -> MeasuredPerson:
    """In the subject file, and in the static trial where that says it as well."""
    known = {key: value for key, value in stated.items() if getattr(person.static, key, None) is not None}
    static = replace(person.static, **known)  # type: ignore[arg-type]
    walk = replace(person.walk, **{k: v for k, v in known.items() if getattr(person.walk, k) is not None})  # type: ignore[arg-type]
    return replace(person, subject=person.subject.model_copy(update=stated), static=static, walk=walk)


_OUTER = "the outer marker of the (right|left) {joint} is on its inner side"
_PLACE = "centres? of pressure|plate.*: [xz]: [-+]"
"""By `check`, or as the place of a plate by the estimate."""
_ASIS_PSIS = (("asis_r", "psis_r"), ("asis_l", "psis_l"))

MISTAKES = (
    # labels
    Mistake(
        "outer and inner knee markers swapped in the static trial, one leg",
        markers.exchanged(("knee_lateral_r", "knee_medial_r"), where="static"),
        _OUTER.format(joint="knee"),
    ),
    Mistake(
        "outer and inner ankle markers swapped in the static trial, one leg",
        markers.exchanged(("ankle_lateral_l", "ankle_medial_l"), where="static"),
        _OUTER.format(joint="ankle"),
    ),
    Mistake(
        "outer and inner elbow markers swapped in the static trial, one arm",
        markers.exchanged(("elbow_lateral_r", "elbow_medial_r"), where="static"),
        "elbow.* swapped",
    ),
    Mistake("front and back of the pelvis swapped", markers.exchanged(*_ASIS_PSIS), "pelvis points backwards"),
    Mistake(
        "front and back of the pelvis swapped in the static trial",
        markers.exchanged(*_ASIS_PSIS, where="static"),
        "pelvis points backwards|ASI.*PSI.* look swapped|ASIS.*PSIS.* look swapped",
    ),
    Mistake(
        "heel and toe swapped, one foot",
        markers.exchanged(("heel_r", "metatarsal_r")),
        "right foot points backwards",
    ),
    Mistake(
        "all left and right labels swapped",
        markers.sides_exchanged(),
        "all left and right labels are swapped",
    ),
    Mistake(
        "left and right knee swapped in the walk",
        markers.exchanged(("knee_lateral_r", "knee_lateral_l"), where="walk"),
        "left and right look swapped in the labels",
    ),
    Mistake(
        "knee and ankle swapped in the static trial, one leg",
        markers.exchanged(("knee_lateral_r", "ankle_lateral_r"), where="static"),
        "look swapped",
    ),
    Mistake("thigh and shank markers swapped in the walk", markers.wands_exchanged, "look swapped"),
    # whose body
    Mistake(
        "static trial of another person, 10 % taller", markers.scaled(1.10, "static"), "static trial is of another"
    ),
    Mistake(
        "static trial of another session, markers 10 mm elsewhere",
        markers.placed_anew(0.010),
        "another session",
    ),
    Mistake(
        "a marker fell off before the walk and was put back 50 mm higher",
        markers.one_marker("knee_lateral_r", markers.displaced),
        "elsewhere",
    ),
    Mistake("computed joint centres listed as markers", markers.virtual_markers, "computed"),
    # axes, units, places
    Mistake("Z up in the markers, Y up in the forces", markers.z_up, "Y up"),
    Mistake("an axis of the laboratory mirrored", markers.mirrored, "mirrored"),
    Mistake("lengths in cm called mm", markers.scaled(0.1, "both"), "unit of length"),
    Mistake("floor of the cameras 30 mm too low", markers.moved((0.0, 0.03, 0.0), "both"), "floor"),
    Mistake(
        "cameras calibrated anew: all markers 100 mm further on than the plates",
        markers.moved((0.1, 0.0, 0.0), "walk"),
        _PLACE,
    ),
    # time
    Mistake("80 ms of marker frames cut out and closed up", markers.closed_up, "frames are missing"),
    Mistake("markers at half their rate", markers.half_speed, "frame rate"),
    Mistake("forces 100 ms late", forces.late(0.1), r"forces are \d+ ms late"),
    Mistake("forces of another trial", forces.of_another_trial, "are of another trial, or"),
    # single markers
    Mistake("spikes of 300 mm every 20 frames", markers.one_marker("knee_lateral_r", markers.spikes), "spikes"),
    Mistake("a marker frozen for half a second", markers.one_marker("ankle_lateral_l", markers.frozen), "stands still"),
    Mistake(
        "a gap of half a second filled with a straight line",
        markers.one_marker("ankle_lateral_l", markers.bridged),
        "straight line",
    ),
    Mistake("a marker jumps by 60 mm", markers.one_marker("knee_lateral_l", markers.jumping), "jump"),
    Mistake("two markers exchange their labels for 0.4 s", markers.exchanged_for_a_while, "swapped"),
    # loads
    Mistake("sign of the horizontal force along X", forces.with_signs(-1, 1, 1), "wrong sign|wrong signs"),
    Mistake("sign of the horizontal force along Z", forces.with_signs(1, 1, -1), "wrong sign|wrong signs"),
    Mistake("forces turned by 180 degrees", forces.with_signs(-1, 1, -1), "turned by 180 degrees"),
    Mistake("forces turned by 90 degrees", forces.directions_turned(90.0), "turned by -?90 degrees"),
    Mistake("torques in N mm", forces.torques_in_n_mm, "N mm"),
    Mistake("points of application in mm", forces.scaled(point=1000.0), "in mm"),
    Mistake("forces in kg", forces.scaled(force=1 / 9.81), "in kg"),
    Mistake("forces in kN", forces.scaled(force=1e-3), "kN"),
    Mistake("centres of pressure 50 mm off along X, both plates", forces.moved(0.05, 0.0), _PLACE),
    Mistake("centres of pressure 50 mm off along Z, both plates", forces.moved(0.0, 0.05), _PLACE),
    Mistake("plates exchanged", forces.plates_exchanged, "exchanged"),
    Mistake("both feet on one plate for 0.08 s", forces.on_one_plate, "both feet"),
    Mistake("50 N on the horizontal X axis", forces.with_offset(x_n=50.0), "zero of that axis"),
    Mistake("50 N on the vertical axis", forces.with_offset(y_n=50.0), "zero of its vertical force"),
    Mistake("zero of the vertical force drifts by 60 N", forces.with_drift(60.0), "drift"),
    Mistake("one plate reads 10 % too much", forces.scaled(force=1.1, plates=slice(1, 2)), "^(trial .*: )?the gain of"),
    Mistake("plates turned by 3 degrees about the vertical", forces.turned_about_vertical(3.0), "turned about"),
    # who
    Mistake("height 20 cm too much", _more(height_m=0.2), "height|stature"),
    Mistake("height 20 cm too little", _more(height_m=-0.2), "height|stature"),
    Mistake("the other sex", _other_sex, "sex"),
    Mistake("mass in pounds", _subject(mass_kg=1 / KG_PER_POUND), "pounds"),
    Mistake("a bag of 5 kg on the scale", _more(mass_kg=5.0), "stated mass"),
)
