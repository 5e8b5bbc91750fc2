"""Do stated mass and stature agree with the files? Which population is assumed, and which markers are not there?"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.person_context import PersonContext
from kinertia.diagnostics.subject.mass import weighed_as_stated
from kinertia.estimation.population import population_of
from kinertia.findings.display import first_few
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.settings import Subject

_SAME = 0.01
_QUANTITIES = {"mass_kg": ("mass", "kg"), "height_m": ("stature", "m")}


def stated_and_filed(context: PersonContext) -> Iterator[Finding]:
    """Report S103: a mass or stature in files that differs from the one used; not reported where the plates confirm
    that one."""
    for name, (quantity, unit) in _QUANTITIES.items():
        stated = getattr(context.subject, name)
        in_files: dict[float, list[str]] = {}
        for one in (*context.standing, *context.trials):
            filed = getattr(one.recording, name)
            if stated is not None and filed is not None and abs(filed - stated) > _SAME * stated:
                in_files.setdefault(filed, []).append(one.name)
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


def population(context: PersonContext) -> Iterator[Finding]:
    """Report S401: a population that the anthropometric tables do not describe."""
    body_kg = None if context.total_mass is None else context.total_mass.body_kg
    assumed = population_of(context.subject, body_kg).finding(context.subject)
    if assumed is not None:
        yield assumed


def absent_markers(context: PersonContext) -> Iterator[Finding]:
    """Report M105: markers of the static trial, or else of the model, that a trial lacks."""
    if context.marker_set is None:
        return
    reference = [label for own in context.marker_set.segments.values() for label in own]
    if context.model is None:
        shown = {label for one in context.standing[:1] for label in one.all_markers.labels}
        reference = [label for label in reference if label in shown]
    for trial in context.trials:
        absent = tuple(label for label in reference if label not in trial.all_markers.labels)
        if absent:
            yield finding("M105", Where(trial=trial.name, markers=absent), count=Quantity(len(absent), "1"))


def stated_ranges(subject: Subject) -> Iterator[Finding]:
    """Report S411: each joint whose range of motion is stated in the subject file."""
    for name, degrees in (subject.ranges_deg or {}).items():
        low, high = np.radians(degrees).tolist()
        yield finding("S411", Where(part=name), range_rad=Quantity((low, high), "rad"))
