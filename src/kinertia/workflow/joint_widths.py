"""Finds the widths of knees, ankles and elbows: in the subject file, the static trial, or any other file."""

from collections.abc import Sequence
from dataclasses import replace

from kinertia.findings.finding import finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.marker_set import WIDTHS, MarkerSet
from kinertia.settings import Subject
from kinertia.trial.data import Recording

_SIDES = {"r": "right", "l": "left"}


def with_widths(
    static: Recording, trials: Sequence[Recording], marker_set: MarkerSet, subject: Subject
) -> tuple[Recording, MarkerSet]:
    """Return the static trial with all known widths and S105 for each from another file, and the set that includes
    them.

    The subject file takes precedence over the static trial, and that over the other trials.
    """
    names, widths_m, borrowed = dict(marker_set.widths), dict(static.measurements), []
    for joint in WIDTHS:
        key = f"{joint.rpartition('_')[0]}_width_mm"
        given = getattr(subject, key)
        if given is not None:
            names[joint], widths_m[key] = key, given / 1e3
            continue
        name = names.get(joint)
        if name is None or widths_m.get(name, 0.0) > 0.0:
            continue
        other = next((trial for trial in trials if trial.measurements.get(name, 0.0) > 0.0), None)
        if other is not None:
            widths_m[name] = other.measurements[name]
            where = Where(file=other.name, part=f"{_SIDES[joint[-1]]} {joint.rpartition('_')[0]}")
            borrowed.append(finding("S105", where, width_m=Quantity(widths_m[name], "m")))
    found = (*static.findings, *borrowed)
    return replace(static, measurements=widths_m, findings=found), replace(marker_set, widths=names)
