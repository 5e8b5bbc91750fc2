"""What can be wrong with a person's mass, height and trials: errors before any estimate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from kinertia.errors import SettingsError, SubjectError, TrialError, problem_of
from kinertia.findings.finding import finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.io.file_names import trouble_as_folders
from kinertia.model.anthropometry import check_subject
from kinertia.model.bsp import BodySegmentParameters
from kinertia.settings import Subject
from kinertia.trial.data import Recording

T = TypeVar("T")


def known(value: T | None) -> T:
    """The value of a field that the subject file or `complete_subject` has filled in."""
    if value is None:
        raise ValueError("complete_subject must come first")
    return value


def check_trials(recordings: Sequence[Recording]) -> None:
    """Raise unless there are trials, and several have names by which results can tell them apart.

    Raises:
        SettingsError: there is none.
        TrialError: a name that cannot be that of a folder beside the others'.
    """
    if not recordings:
        none = finding("S301")
        raise SettingsError(problem_of(none)).with_finding(none)
    names = [recording.name for recording in recordings]
    if trouble := trouble_as_folders(names):
        index, problem = trouble
        advice = "results have a folder for each trial: give this one's recording another name (dataclasses.replace)"
        raise TrialError(names[index], f"{problem}; {advice}")


def complete_subject(subject: Subject, recordings: Sequence[Recording], mass_only: bool = False) -> Subject:
    """Mass and height from the files where the user gave none.

    Args:
        subject, recordings: what the user states, and the files.
        mass_only: height and sex may stay unknown.

    Raises:
        SubjectError: neither the user nor a file gives mass or height, the user no sex, or a value cannot be true.
    """
    values: dict[str, float] = {}
    for field, quantity in (("mass_kg", "mass"), ("height_m", "stature")):
        given = getattr(subject, field)
        filed = [getattr(one, field) for one in recordings if getattr(one, field) is not None]
        if given is not None or filed:
            values[field] = filed[0] if given is None else given
        elif field == "mass_kg" or not mass_only:
            raise _missing(field, quantity)
    if subject.sex is None and not mass_only:
        raise _missing("sex", "sex")
    check_subject(values["mass_kg"], values.get("height_m", 1.7), subject.sex or "male")
    return subject.model_copy(update=values)


def _missing(field: str, quantity: str) -> SubjectError:
    found = finding("S101", Where(part=quantity), quantity=Quantity(quantity))
    return SubjectError(field, None, problem_of(found)).with_finding(found)


def mass_by_force_kg(literature: BodySegmentParameters, foot_loads: np.ndarray, residual: np.ndarray) -> float:
    """Body mass by the vertical ground reaction over a window, whatever the CoM's acceleration.

    The residual of the uncorrected motion is P = m (a + g) - F with the literature's m, so the mass that leaves no
    mean vertical residual is m F / (F + P), with means over the window.

    Args:
        literature: the BSPs of the residual.
        foot_loads: (w, 2, 6) ground reactions.
        residual: (w, 6) root residual of the literature BSPs on the uncorrected motion.
    """
    force = float(foot_loads[:, :, 1].sum(axis=1).mean())
    return literature.total_mass_kg * force / (force + float(residual[:, 1].mean()))
