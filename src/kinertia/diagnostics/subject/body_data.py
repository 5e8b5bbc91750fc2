"""Do stated mass and stature agree with files and landmarks? Which population is assumed, what is not observed?

The distances from ankle to knee, to the front of the pelvis and to the shoulder add up to 0.79 to 0.84 of stature on
the reference recordings. Single distances vary by 4 to 5 % between people, their sum by less, since people with longer
legs have shorter trunks.

The figures are differences of the joint moments (RMS over the window) with and without the markers of arms and head, or
of all of the upper body, in the walks of gait2354 and of Rajagopal's model: 1 to 7 N m in the legs and 3 to 11 N m at
the lumbar joint without trunk markers, 0.1 to 5 and 1 to 8 N m without those of the arms; all within their error bars.
"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.context import PersonContext, RecordingContext
from kinertia.diagnostics.runner import check
from kinertia.diagnostics.subject.mass import weighed_as_stated
from kinertia.estimation.prior import population_of
from kinertia.findings.display import first_few
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.model.gait27 import ARM_COORDINATES, VIRTUAL_TRUNK
from kinertia.model.joint_centres import find_landmarks
from kinertia.model.marker_set import in_words
from kinertia.model.skeleton import Skeleton
from kinertia.settings import Subject

_SAME = Limit(0.01)
_QUANTITIES = {"mass_kg": ("mass", "kg"), "height_m": ("stature", "m")}
_PARTS = (("ankle_lateral", "knee_lateral"), ("knee_lateral", "asis"), ("asis", "acromion"))
_USUAL = 0.815
_SHORT, _LONG = Limit(0.76, usual=(0.79, 0.84)), Limit(0.87, usual=(0.79, 0.84))
_SHORTEST, _LONGEST = Limit(0.65), Limit(1.0)
"""Nobody is shorter than from ankle to shoulder, or has a third of the stature above shoulders and below ankles."""
_UPRIGHT = "upright on the pelvis, with literature values"
_HANGING = "hanging straight down from the trunk, which carries them"


@check("S103", same=_SAME)
def stated_and_filed(context: PersonContext) -> Iterator[Finding]:
    """Report S103: a mass or stature in files that differs from the one used; not reported where the plates confirm
    that one."""
    for name, (quantity, unit) in _QUANTITIES.items():
        stated = getattr(context.subject, name)
        in_files: dict[float, list[str]] = {}
        for recording in (*context.standing, *context.trials):
            filed = getattr(recording.recording, name)
            if stated is not None and filed is not None and abs(filed - stated) > _SAME * stated:
                in_files.setdefault(filed, []).append(recording.name)
        for filed, names in in_files.items():
            confirmed = name == "mass_kg" and weighed_as_stated(context, filed)
            yield finding(
                "S103",
                Where(trial=names[0] if len(names) == 1 else None, part=quantity),
                Severity.INFO if confirmed else None,
                stated=Quantity(stated, unit),
                filed=Quantity(filed, unit, limit=stated * (1.0 + (_SAME if filed > stated else -_SAME))),
                quantity=Quantity(quantity),
                files=Quantity(first_few(names)),
            )


@check("S401")
def population(context: PersonContext) -> Iterator[Finding]:
    """Report S401: a population that the anthropometric tables do not describe."""
    body_kg = None if context.total_mass is None else context.total_mass.body_kg
    assumed = population_of(context.subject, body_kg).finding(context.subject)
    if assumed is not None:
        yield assumed


def stated_ranges(subject: Subject) -> Iterator[Finding]:
    """Report S411: each joint whose range of motion is stated in the subject file."""
    for name, degrees in (subject.ranges_deg or {}).items():
        low, high = np.radians(degrees).tolist()
        yield finding("S411", Where(part=name), range_rad=Quantity((low, high), "rad"))


@check("S104", short=_SHORT, long=_LONG, shortest=_SHORTEST, longest=_LONGEST)
def stature(context: RecordingContext) -> Iterator[Finding]:
    """Report S104: a stature that the landmarks of a static trial contradict."""
    height_m = context.height_m
    if context.marker_set is None or height_m is None:
        return
    marks = find_landmarks(context.recording, context.marker_set)
    lengths = [
        sum(float(np.linalg.norm(marks[f"{upper}_{side}"] - marks[f"{lower}_{side}"])) for upper, lower in _PARTS)
        for side in "rl"
        if all(f"{name}_{side}" in marks for pair in _PARTS for name in pair)
    ]
    if not lengths:
        return
    length_m = float(np.mean(lengths))
    share = length_m / height_m
    if _SHORT <= share <= _LONG:
        return
    limit = _SHORT if share < _SHORT else _LONG
    possible = _SHORTEST <= share <= _LONGEST
    yield finding(
        "S104",
        context.at(),
        Severity.WARNING if possible else Severity.ERROR,
        stated_m=Quantity(height_m, "m"),
        implied_m=Quantity(length_m / _USUAL, "m"),
        length_m=Quantity(length_m, "m"),
        share=Quantity(share, "1", limit=limit, usual=limit.usual),
    )


def unobserved_segments(skeleton: Skeleton) -> Iterator[Finding]:
    """Report R401: trunk or arms without enough markers, in a 27-DOF model that was adapted to its trials."""
    locked = {name for name in ARM_COORDINATES if name in skeleton.locked}
    joined = len(locked) == len(ARM_COORDINATES)
    if VIRTUAL_TRUNK[0].label in skeleton.labels:
        yield _unobserved("trunk, arms and head" if joined else "trunk", _UPRIGHT, (1.0, 7.0))
    elif joined:
        yield _unobserved("arms", _HANGING, (0.1, 5.0))
    if locked and not joined:
        for side in "rl":
            locked_of_side = {name.removesuffix(f"_{side}") for name in locked if name.endswith(f"_{side}")}
            if locked_of_side:
                part = in_words(f"{'forearm' if locked_of_side == {'elbow_flex'} else 'arm'}_{side}")
                yield _unobserved(part, _HANGING.replace("them", "it"), (0.0, 5.0))


def _unobserved(part: str, assumed: str, change_nm: tuple[float, float]) -> Finding:
    return finding("R401", Where(part=part), moment_change_nm=Quantity(change_nm, "N m"), assumed=Quantity(assumed))
