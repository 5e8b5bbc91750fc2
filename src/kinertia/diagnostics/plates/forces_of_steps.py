"""Do the forces of single steps point to the body? Axes and signs where hardly any frame has all load measured.

A force points from the foot to the body, roughly: over the vertical force, the horizontal one resembles the horizontal
way from the centre of pressure to the marker-based centre, over the centre's height. Of 38 recordings (walks, runs,
squats, a jump, stairs; 20 people) cosines of both are 0.72 to 0.94, along single axes -0.05 and more, 0.2 and more
where the way is longer than 0.03; in synthetic walks all of them are 0.5 and more. A single step shows that.
"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.landmarks import body_centre
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Limit, Quantity
from kinertia.trial.data import PlateLoads
from kinertia.trial.ground_contact import FIRM_LOAD_N, free_moment
from kinertia.trial.sampled_data import nearest_samples, rms, within

AWAY = Limit(-0.3, usual=(0.2, 1.0))
MUCH_SMALLER = Limit(0.5)
_LEAST_WAY, _POINTING, _FEWEST = 0.03, Limit(0.5, usual=(0.72, 0.94)), 10

_CAUSES = (
    "a reversed axis or channel",
    "a vertical that is tilted by a few degrees, which looks the same in single steps",
)


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
