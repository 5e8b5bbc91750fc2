"""Mistakes that laboratories make, each a change of fault-free files and the codes that identify it."""

from dataclasses import dataclass, replace

import numpy as np

from validation import load_mistakes as forces
from validation import marker_mistakes as markers
from validation.marker_mistakes import Change
from validation.measured_person import MeasuredPerson

KG_PER_POUND = 0.45359237


@dataclass(frozen=True)
class Mistake:
    """One fault that laboratories make.

    Attributes:
        name: description of the fault.
        change: injects it into the files of a person.
        codes: codes of the findings that identify it; none if no recording can show it.
    """

    name: str
    change: Change
    codes: frozenset[str]


def _subject(**factors: float) -> Change:
    """Return a fault that multiplies mass or height by a factor."""

    def change(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson:
        stated = {key: factor * getattr(person.subject, key) for key, factor in factors.items()}
        return _restated(person, stated)

    return change


def _more(**terms: float) -> Change:
    def change(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson:
        return _restated(person, {key: getattr(person.subject, key) + term for key, term in terms.items()})

    return change


def _other_sex(person: MeasuredPerson, rng: np.random.Generator) -> MeasuredPerson:
    return _restated(person, {"sex": {"male": "female", "female": "male"}[person.subject.sex or "male"]})


def _restated(person: MeasuredPerson, stated: dict[str, object]) -> MeasuredPerson:
    """Change stated data in the subject file, and in the static trial where they are stated as well."""
    known = {key: value for key, value in stated.items() if getattr(person.static, key, None) is not None}
    static = replace(person.static, **known)  # type: ignore[arg-type]
    walk = replace(person.walk, **{k: v for k, v in known.items() if getattr(person.walk, k) is not None})  # type: ignore[arg-type]
    return replace(person, subject=person.subject.model_copy(update=stated), static=static, walk=walk)


_ASIS_PSIS = (("asis_r", "psis_r"), ("asis_l", "psis_l"))


def _codes(*codes: str) -> frozenset[str]:
    return frozenset(codes)


_POSITIONS = _codes("P242", "P243", "P244", "P246")
"""Codes of positions, by the feet, or as a position that the estimate has corrected."""

MISTAKES = (
    # labels
    Mistake(
        "lateral and medial knee markers swapped in the static trial, one leg",
        markers.exchanged(("knee_lateral_r", "knee_medial_r"), where="static"),
        _codes("L208", "L212"),
    ),
    Mistake(
        "lateral and medial ankle markers swapped in the static trial, one leg",
        markers.exchanged(("ankle_lateral_l", "ankle_medial_l"), where="static"),
        _codes("L208", "L212"),
    ),
    Mistake(
        "lateral and medial elbow markers swapped in the static trial, one arm",
        markers.exchanged(("elbow_lateral_r", "elbow_medial_r"), where="static"),
        _codes("L208", "L212"),
    ),
    Mistake("front and back of the pelvis swapped", markers.exchanged(*_ASIS_PSIS), _codes("L203")),
    Mistake(
        "front and back of the pelvis swapped in the static trial",
        markers.exchanged(*_ASIS_PSIS, where="static"),
        _codes("L203", "L212"),
    ),
    Mistake("heel and toe swapped, one foot", markers.exchanged(("heel_r", "metatarsal_r")), _codes("L205")),
    Mistake("all left and right labels swapped", markers.sides_exchanged(), _codes("L201")),
    Mistake(
        "left and right knee swapped in the walk",
        markers.exchanged(("knee_lateral_r", "knee_lateral_l"), where="walk"),
        _codes("L202", "L211", "L212"),
    ),
    Mistake(
        "knee and ankle swapped in the static trial, one leg",
        markers.exchanged(("knee_lateral_r", "ankle_lateral_r"), where="static"),
        _codes("L206", "L207", "L212"),
    ),
    Mistake(
        "medial knee markers swapped between the legs in the static trial",
        markers.exchanged(("knee_medial_r", "knee_medial_l"), where="static"),
        _codes("L202", "L212"),
    ),
    Mistake("thigh and shank markers swapped in the walk", markers.wands_exchanged, _codes("L206", "L212", "L213")),
    # whose body
    Mistake("static trial of another person, 10 % taller", markers.scaled(1.10, "static"), _codes("S203")),
    Mistake("static trial of another session, markers 10 mm elsewhere", markers.placed_anew(0.010), _codes("S204")),
    Mistake(
        "a marker fell off before the walk and was put back 50 mm higher",
        markers.one_marker("knee_lateral_r", markers.displaced),
        _codes("M161"),
    ),
    Mistake("computed joint centres listed as markers", markers.virtual_markers, _codes("M151")),
    # axes, units, places
    Mistake("Z up in the markers, Y up in the forces", markers.z_up, _codes("M142", "P201")),
    Mistake("an axis of the laboratory mirrored", markers.mirrored, _codes("L201")),
    Mistake("lengths in cm called mm", markers.scaled(0.1, "both"), _codes("M141")),
    Mistake("floor of the cameras 30 mm too low", markers.moved((0.0, 0.03, 0.0), "both"), _codes("M143")),
    Mistake("cameras tilted by 3 degrees along the walk", markers.tilted("z", 3.0), _codes("M144")),
    Mistake("cameras tilted by 3 degrees to one side", markers.tilted("x", -3.0), _codes("M145")),
    Mistake(
        "cameras recalibrated: all markers displaced by 100 mm against the plates",
        markers.moved((0.1, 0.0, 0.0), "walk"),
        _POSITIONS,
    ),
    # time
    Mistake("80 ms of marker frames cut out and closed up", markers.closed_up, _codes("M121")),
    Mistake("markers at half their rate", markers.half_speed, _codes("T201", "T202")),
    Mistake("forces 100 ms late", forces.late(0.1), _codes("T211", "T214")),
    Mistake("forces of one plate 25 ms late", forces.late_plate(0.025), _codes("T216")),
    Mistake("forces of another trial", forces.of_another_trial, _codes("T212")),
    # single markers
    Mistake("spikes of 300 mm every 20 frames", markers.one_marker("knee_lateral_r", markers.spikes), _codes("M111")),
    Mistake("a marker frozen for half a second", markers.one_marker("ankle_lateral_l", markers.frozen), _codes("M113")),
    Mistake(
        "a gap of half a second filled with a straight line",
        markers.one_marker("ankle_lateral_l", markers.bridged),
        _codes("M114"),
    ),
    Mistake("a marker jumps by 60 mm", markers.one_marker("knee_lateral_l", markers.jumping), _codes("M112")),
    Mistake(
        "a knee marker with the trajectory of the ankle marker",
        markers.copied("ankle_lateral_r", "knee_lateral_r"),
        _codes("M115"),
    ),
    Mistake("two markers exchange their labels for 0.4 s", markers.exchanged_for_a_while, _codes("L211")),
    # loads
    Mistake("sign of the horizontal force along X", forces.with_signs(-1, 1, 1), _codes("P232")),
    Mistake("sign of the horizontal force along Z", forces.with_signs(1, 1, -1), _codes("P232")),
    Mistake("forces turned by 180 degrees", forces.with_signs(-1, 1, -1), _codes("P231")),
    Mistake("forces turned by 90 degrees", forces.directions_turned(90.0), _codes("P231")),
    Mistake("torques in N mm", forces.torques_in_n_mm, _codes("P203")),
    Mistake("points of application in mm", forces.scaled(point=1000.0), _codes("P204")),
    Mistake("forces in kg", forces.scaled(force=1 / 9.81), _codes("P202")),
    Mistake("forces in kN", forces.scaled(force=1e-3), _codes("P202")),
    Mistake("centres of pressure 50 mm off along X, both plates", forces.moved(x_m=0.05), _POSITIONS),
    Mistake("centres of pressure 50 mm off along Z, both plates", forces.moved(z_m=0.05), _POSITIONS),
    Mistake("surface of both plates taken for 50 mm higher", forces.moved(y_m=0.05), _codes("P249")),
    Mistake("plates exchanged", forces.plates_exchanged, _codes("P241")),
    Mistake("both feet on one plate for 0.08 s", forces.on_one_plate, _codes("P276")),
    Mistake(
        "50 N on the horizontal X axis", forces.with_offset(x_n=50.0), _codes("P212", "P213", "P214", "P215", "P216")
    ),
    Mistake("50 N on the vertical axis", forces.with_offset(y_n=50.0), _codes("P212", "P213", "P216")),
    Mistake("zero of the vertical force drifts by 60 N", forces.with_drift(60.0), _codes("P211")),
    Mistake("one plate reads 10 % too much", forces.scaled(force=1.1, plates=slice(1, 2)), _codes("P221", "P223")),
    Mistake("a spike of 2 kN in the force of one plate", forces.one_plate(forces.spike), _codes("P109")),
    Mistake("force samples of one plate missing for 50 ms", forces.one_plate(forces.dropped), _codes("P102")),
    Mistake("horizontal forces of one plate not exported", forces.one_plate(forces.vertical_alone), _codes("P101")),
    Mistake("a constant centre of pressure on one plate", forces.one_plate(forces.fixed_point), _codes("P251")),
    Mistake("plates turned by 3 degrees about the vertical", forces.turned_about_vertical(3.0), _codes("P234", "P237")),
    Mistake(
        "one plate turned by 5 degrees about the vertical", forces.turned_about_vertical(5.0, True), _codes("P237")
    ),
    Mistake("vertical force of one plate with the wrong sign", forces.vertical_reversed, _codes("P238", "F157")),
    Mistake(
        "vertical channels of each plate interchanged (1 with 3, 2 with 4)",
        forces.about_middles(forces.tilting_reversed),
        _codes("P242"),
    ),
    Mistake(
        "lateral forces and vertical moments reversed", forces.lateral_and_vertical_moment_reversed, _codes("P232")
    ),
    Mistake("one horizontal moment channel not exported", forces.about_middles(forces.across_dead), _codes("P111")),
    Mistake(
        "5 % of the vertical force in the horizontal forces of one plate",
        forces.leaking(0.05),
        _codes("P212"),
    ),
    Mistake("gravity 5 degrees off the vertical, along the walk", forces.leaning("z", 5.0), _codes("P214")),
    Mistake("gravity 5 degrees off the vertical, to one side", forces.leaning("x", 5.0), _codes("P214")),
    Mistake("forces at a rate 10 % off", forces.at_rate(1.1), _codes("T201")),
    Mistake("markers at 30 Hz", markers.few_frames(30.0), _codes("M124")),
    Mistake("markers low-passed at 3 Hz", markers.low_passed(3.0), _codes("M133")),
    Mistake("forces low-passed at 8 Hz", forces.low_passed(8.0), _codes("P108")),
    Mistake("cameras' scale 2 % too large in the walk", markers.scaled(1.02, "walk"), _codes("S205")),
    Mistake(
        "cameras' scale 2 % too large in both trials", markers.scaled(1.02, "both"), _codes("S205", "P243", "P246")
    ),
    # who
    Mistake("height 20 cm too much", _more(height_m=0.2), _codes("S104")),
    Mistake("height 20 cm too little", _more(height_m=-0.2), _codes("S104")),
    Mistake("the other sex", _other_sex, _codes()),
    Mistake("mass in pounds", _subject(mass_kg=1 / KG_PER_POUND), _codes("S112")),
    Mistake("a bag of 5 kg on the scale", _more(mass_kg=5.0), _codes("S111")),
)
