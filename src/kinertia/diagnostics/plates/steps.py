"""Selects steps on plates. Where do they act on the feet, and do their forces point to the body?

How far in front of the heel a step acts, relative to what is usual at the person's stature, has SDs of 9 mm between
people, 8 mm between the feet of a person and 5 mm between the steps of a foot, in walks of 18 people in 11
laboratories. Plates that are displaced along the walk change it by as much; plates displaced across the walk move the
loads of both feet to the same side. Walks there and back show plates more precisely: the person's own part then changes
its sign in the laboratory.

A force points from the foot to the body, roughly: over the vertical force, the horizontal one resembles the horizontal
way from the centre of pressure to the marker-based centre, over the centre's height. Of 38 recordings (walks, runs,
squats, a jump, stairs; 20 people) cosines of both are 0.72 to 0.94, along single axes -0.05 and more, 0.2 and more
where the way is longer than 0.03; in synthetic walks all of them are 0.5 and more. A single step shows that.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.ambiguous_loads import FOOT_ENDS
from kinertia.diagnostics.evidence.landmarks import body_centre
from kinertia.diagnostics.evidence.plate_contacts import END_SHARE, PlateContact
from kinertia.diagnostics.subject.movements import task_of
from kinertia.estimation.simultaneous.instruments.priors import InstrumentInformation
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Limit, Quantity
from kinertia.trial.data import BoolArray, FloatArray, PlateLoads
from kinertia.trial.ground_contact import FIRM_LOAD_N, free_moment
from kinertia.trial.sampled_data import nearest_samples, rms, within

OF_HEIGHT, _LATE = np.array([0.033, 0.107]), 0.85
USUAL_ALONG_M = (-0.016, 0.03)
BACK_M, FORWARD_M = Limit(-0.026, "m", usual=USUAL_ALONG_M), Limit(0.042, "m", usual=USUAL_ALONG_M)
"""Where a twentieth and 85 % of a step's load have acted, the centre of pressure is this share of stature in front of
the heel marker. The mean of both differs from it by -16 to 30 mm (mean 4, SD 10) in the walks and runs of 26 people of
1.12 to 1.83 m in 14 laboratories, by as much in one step as in many.
"""
_MEAN_ALONG_M, _PERSON_SD_M, _FOOT_SD_M, _STEP_SD_M = 0.004, 0.009, 0.008, 0.005
"""In walks of 18 people in 11 laboratories: the mean, and SDs between people, between the feet of a person (7 mm, of
few), and between the steps of a foot."""
_FEET_APART_M = 0.04
"""In these people one foot's steps act up to 23 mm farther forward than the other's."""
_SIDEWAYS_SD_M, _OUTWARD_SD_M, _BOTH_BESIDE_M = 0.004, 0.05, 0.01
"""Steps of both feet together act within 9 mm (SD 4) of the axes of the feet in 19 walks of 16 people; each foot's are
up to 44 mm outward or inward of it, by where its markers are."""
AWAY = Limit(-0.3, usual=(0.2, 1.0))
MUCH_SMALLER = Limit(0.5)
_LEAST_WAY, _POINTING, _FEWEST = 0.03, Limit(0.5, usual=(0.72, 0.94)), 10

_CAUSES = (
    "a reversed axis or channel",
    "a vertical that is tilted by a few degrees, which looks the same in single steps",
)


def goes_forwards(context: RecordingContext) -> bool:
    """Return whether loads can be expected between heel and toe: whole feet are visible and the person does not walk
    backwards."""
    return context.shows_whole_feet and not context.walks_backwards


def heel_steps(context: RecordingContext) -> list[PlateContact]:
    """Return the loads that can be expected to progress from heel to toe: of one foot that does not land on its
    forefoot, in strides that do not go backwards."""
    if not context.has_strides or not goes_forwards(context):
        return []
    return [
        contact
        for contact in one_foot_loads(context)
        if not contact.trajectory.lands_on_forefoot(contact.start_s, contact.end_s)
    ]


def one_foot_loads(context: RecordingContext) -> list[PlateContact]:
    """Return the loads without those that both feet bear on one plate; if these seem to be most, the loads are at a
    wrong position instead, and count."""
    shared = {id(load.contact) for load in context.shared_loads}
    unshared = [contact for contact in context.contacts if id(contact) not in shared]
    return unshared if 2 * len(unshared) >= len(context.contacts) else list(context.contacts)


def shows_feet_equally(context: RecordingContext) -> bool:
    """Return whether the same markers of both feet are visible: else their lines from heel to toe differ."""
    if context.marker_set is None:
        return False
    landmarks, seen = context.marker_set.landmarks, context.seen_labels
    right, left = (
        [len(seen.intersection(landmarks.get(f"{name}_{side}", ()))) for end in FOOT_ENDS for name in end]
        for side in "rl"
    )
    return right == left


def steps_alone(context: RecordingContext, steps: Sequence[PlateContact]) -> list[PlateContact]:
    """Return the steps whose whole load is on one plate."""
    whole = set(map(id, context.whole_contacts))
    return [step for step in steps if step.is_step and id(step) in whole and not _bears_elsewhere(step, context)]


def _bears_elsewhere(step: PlateContact, context: RecordingContext) -> bool:
    """Return whether the foot of a step loads another plate, too."""
    return any(
        contact is not step
        and contact.foot == step.foot
        and contact.time[0] < step.time[-1]
        and step.time[0] < contact.time[-1]
        for contact in context.contacts
    )


def ahead_of_usual_m(step: PlateContact, height_m: float) -> FloatArray:
    """Return how much farther forward (2,) m than in others a step begins and pushes off, at this stature."""
    return step.ahead_m((END_SHARE, _LATE)) - height_m * OF_HEIGHT


def positions_by_feet(contexts: Sequence[RecordingContext], plates: Sequence[str]) -> tuple[InstrumentInformation, ...]:
    """Return what steps show of the positions of plates, by where they act on the feet: along them and across.

    Runs do not count, since where runners land differs more, nor do steps outside the stated window or with other
    people's loads.

    Args:
        contexts: of all recordings of one person whose forces are used.
        plates: their names.
    """
    rows = [
        (context.plates.names[step.plate], step)
        for context in contexts
        if context.plates is not None and shows_feet_equally(context) and task_of(context) != "run"
        for step in steps_alone(context, heel_steps(context))
        if context.uses((step.start_s, step.end_s)) and step not in context.foreign_contacts
    ]
    if not rows:
        return ()
    on, steps = zip(*rows, strict=True)
    forward = np.array([step.trajectory.heading(step.time, step.weight) for step in steps])
    left = np.column_stack([forward[:, 1], -forward[:, 0]])
    same_foot = np.equal.outer(*2 * [[step.foot for step in steps]])
    along, across = _ahead_of_others(steps, contexts[0].height_m, same_foot), _beside_feet(steps, left, same_foot)
    return tuple(
        InstrumentInformation.of_positions(plates, on, way, *shown)
        for way, shown in ((forward, along), (left, across))
        if shown is not None
    )


def _ahead_of_others(
    steps: Sequence[PlateContact], height_m: float | None, same_foot: BoolArray
) -> tuple[FloatArray, FloatArray] | None:
    """Return how much farther forward (m,) m than in other people m steps act, and the covariance of that without
    displaced plates; None without the stature, where feet differ, and where the mean of all steps is beyond P243's
    limits."""
    if height_m is None:
        return None
    ahead = np.array([ahead_of_usual_m(step, height_m).mean() for step in steps])
    of_feet = [float(ahead[same].mean()) for same in same_foot]
    if not BACK_M < float(ahead.mean()) < FORWARD_M or np.ptp(of_feet) > _FEET_APART_M:
        return None
    return ahead - _MEAN_ALONG_M, _PERSON_SD_M**2 + _FOOT_SD_M**2 * same_foot + _STEP_SD_M**2 * np.eye(len(steps))


def _beside_feet(
    steps: Sequence[PlateContact], left: FloatArray, same_foot: BoolArray
) -> tuple[FloatArray, FloatArray] | None:
    """Return how much farther left (m,) m than the feet's axes m steps act, and its covariance as above; None of one
    foot, and of both feet farther to one side than in anyone else."""
    if same_foot.all():
        return None
    beside = np.array([float(step.own_offset_m @ direction) for step, direction in zip(steps, left, strict=True)])
    both_m = (beside[same_foot[0]].mean() + beside[~same_foot[0]].mean()) / 2
    if abs(both_m) > _BOTH_BESIDE_M:
        return None
    outward = _OUTWARD_SD_M**2 * np.where(same_foot, 1.0, -1.0)
    return beside, _SIDEWAYS_SD_M**2 + outward + _STEP_SD_M**2 * np.eye(len(steps))


def forces_of_steps(context: RecordingContext) -> Iterator[Finding]:
    """Report P231 and P232 where forces point away from the body, or beside it."""
    to_body, force = _ways_to_body(context)
    size = float(np.linalg.norm(to_body) * np.linalg.norm(force))
    if len(force) < _FEWEST or not size:
        return
    # from Z to X is a positive rotation about Y
    undone = {0.0: force, np.pi: -force, np.pi / 2: -1j * force, -np.pi / 2: 1j * force}
    fits = {angle: float(np.vdot(to_body, force_turned).real) / size for angle, force_turned in undone.items()}
    cosines, away = {}, []
    for axis, way, along in ((0, to_body.imag, force.imag), (2, to_body.real, force.real)):
        cosines[axis] = float(way @ along / max(np.linalg.norm(way) * np.linalg.norm(along), 1e-12))
        if rms(way) > _LEAST_WAY and cosines[axis] < AWAY:
            away.append(axis)
    angle = max(fits, key=fits.__getitem__)
    one_sign = [
        float(np.vdot(to_body, force_signed).real) / size for force_signed in (force.conjugate(), -force.conjugate())
    ]
    if angle and fits[angle] > max(_POINTING, *one_sign):
        yield finding(
            "P231",
            context.at(),
            angle_rad=Quantity(angle, "rad"),
            correlation=Quantity(tuple(cosines.values()), "1", usual=AWAY.usual),
            correlation_undone=Quantity(fits[angle], "1", limit=_POINTING, usual=_POINTING.usual),
        )
        return
    for axis in away:
        yield finding(
            "P232",
            context.at(**context.along(axis)),
            correlation=Quantity(cosines[axis], "1", limit=AWAY, usual=AWAY.usual),
            beside=Quantity(" and the vertical moment" if moment_reversed(context.plates, axis) else ""),
            causes=_CAUSES,
        )


def _ways_to_body(context: RecordingContext) -> tuple[np.ndarray, np.ndarray]:
    """Return ways (k,) from the centre of pressure to the marker-based centre, over its height, and forces (k,) over
    the vertical one, along Z and, imaginary, along X, while single feet load plates."""
    plates, markers = context.plates, context.all_markers
    centre = body_centre(context.segment_of_label, markers)
    steps = [contact for contact in context.contacts if not contact.between]
    seen = np.zeros(0, dtype=bool) if centre is None else np.isfinite(centre).all(axis=1)
    if plates is None or centre is None or seen.sum() < 2 or not steps:
        return np.zeros(0, dtype=complex), np.zeros(0, dtype=complex)
    time, ways, forces = markers.time[seen], [], []
    for step in steps:
        shown = within(step.time, time[0], time[-1]) & (step.weight > FIRM_LOAD_N)
        x, y, z = (np.interp(step.time[shown], time, centre[seen, k]) for k in range(3))
        force = plates.force[nearest_samples(plates.time, step.time[shown]), step.plate]
        place = step.place[shown]
        ways.append((z - place[:, 1] + 1j * (x - place[:, 0])) / y)
        forces.append((force[:, 2] + 1j * force[:, 0]) / force[:, 1])
    return np.concatenate(ways), np.concatenate(forces)


def moment_reversed(plates: PlateLoads | None, axis: int) -> bool:
    """Return whether the vertical moments of all plates are reversed like the forces along an axis: free moments are
    small, and about the middle of a plate a vertical moment of the wrong sign leaves twice that of the forces."""
    if plates is None or plates.corners is None:
        return False
    middle = plates.corners.mean(axis=1)[None]
    force = plates.force * np.where(np.arange(3) == axis, -1.0, 1.0)
    about = plates.moment - np.cross(middle, plates.force)
    loaded = plates.force[..., 1] > FIRM_LOAD_N
    if not loaded.any():
        return False
    left_nm = [
        rms(free_moment(np.concatenate([force, about * [1.0, sign, 1.0] + np.cross(middle, force)], axis=2))[loaded])
        for sign in (1.0, -1.0)
    ]
    return left_nm[1] < MUCH_SMALLER * left_nm[0]
