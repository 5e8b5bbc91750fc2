"""Widths of knees, ankles and elbows: from the subject file, the static trial, or any other file of the person."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from kinertia.model.marker_set import WIDTHS, MarkerSet
from kinertia.settings import Subject
from kinertia.trial.data import Recording


def with_widths(
    static: Recording, trials: Sequence[Recording], marker_set: MarkerSet, subject: Subject
) -> tuple[Recording, MarkerSet, list[str]]:
    """The static trial with all widths that are known, the marker set that names them, and notes.

    What the subject file says goes before the static trial, and that before the other trials.
    """
    names, widths_m, notes = dict(marker_set.widths), dict(static.measurements), []
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
            notes.append(f"{name} is from {other.name}, {1e3 * widths_m[name]:.0f} mm: {static.name} does not have it")
    return replace(static, measurements=widths_m), replace(marker_set, widths=names), notes
