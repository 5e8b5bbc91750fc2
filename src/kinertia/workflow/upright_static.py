"""Puts a static trial upright whose file does not say which axis is up, or says it wrongly, by the landmarks."""

from dataclasses import replace

import numpy as np

from kinertia.diagnostics.evidence.landmarks import feet_to_pelvis_m, landmark_positions
from kinertia.errors import MarkerSetError
from kinertia.findings.finding import finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.io.lab_axes import rotation_of_line
from kinertia.workflow.person import Person

_UPRIGHT = 0.9
"""Cosine of 26 degrees between an axis and the line from feet to pelvis."""


def with_upright_static(person: Person) -> Person:
    """Return the person with the static trial rotated to Y up (F133) where another axis leads from feet to pelvis.

    One with loads on plates is left as it is, since those would have to be rotated by their own axes.
    """
    static = person.static
    if static is None or static.plates is not None or isinstance(person.labels, MarkerSetError):
        return person
    line = feet_to_pelvis_m(landmark_positions(static.markers, person.labels))
    if line is None or np.abs(line).max() < _UPRIGHT * np.linalg.norm(line):
        return person
    rotation, axis = rotation_of_line(line)
    if axis == "+Y":
        return person
    note = finding("F133", Where(trial=static.name), axis=Quantity(axis), source=Quantity("the feet and the pelvis"))
    upright = replace(
        static, markers=static.markers.rotated(rotation), vertical=axis, findings=(*static.findings, note)
    )
    return replace(person, static=upright)
