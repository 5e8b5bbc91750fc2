"""Checks a person's mass, height, sex and trials before any estimate."""

from collections.abc import Sequence
from typing import Any, TypeVar

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
    """Return the value of a field that the subject file or `complete_subject` has filled in."""
    if value is None:
        raise ValueError("complete_subject must come first")
    return value


def check_trials(recordings: Sequence[Recording]) -> None:
    """Raise an error unless there are trials, whose names distinguish their results.

    Raises:
        SettingsError: there is no trial.
        TrialError: a name is not usable as a folder beside those of the other trials.
    """
    if not recordings:
        raise SettingsError.of(finding("S301"))
    names = [recording.name for recording in recordings]
    if trouble := trouble_as_folders(names):
        index, problem = trouble
        advice = "results have a folder for each trial: give this one's recording another name (dataclasses.replace)"
        raise TrialError(names[index], f"{problem}; {advice}")


def complete_subject(subject: Subject, recordings: Sequence[Recording], mass_only: bool = False) -> Subject:
    """Fill in mass and height from the files where the user gave none.

    Args:
        subject, recordings: what the user states, and the files.
        mass_only: height and sex may stay unknown.

    Raises:
        SubjectError: neither the user nor a file gives mass or height, the user no sex, or a value is impossible.
    """
    if missing := lacking(subject, recordings, mass_only):
        quantities = ", ".join(missing.values())
        found = finding("S101", Where(part=quantities), quantity=Quantity(quantities))
        raise SubjectError(next(iter(missing)), None, problem_of(found)).with_finding(found)
    values = {field: _filed(subject, field, recordings) for field in ("mass_kg", "height_m")}
    completed = subject.model_copy(update={field: value for field, value in values.items() if value is not None})
    check_subject(
        known(completed.mass_kg), 1.7 if completed.height_m is None else completed.height_m, subject.sex or "male"
    )
    return completed


def lacking(subject: Subject, recordings: Sequence[Recording], mass_only: bool = False) -> dict[str, str]:
    """Return which of mass, stature and sex neither the user nor a file states: the fields, and their names.

    Args:
        subject, recordings: what the user states, and the files.
        mass_only: height and sex may stay unknown, as with an OpenSim model.
    """
    needed = {"mass_kg": "mass"} if mass_only else {"mass_kg": "mass", "height_m": "stature", "sex": "sex"}
    return {field: name for field, name in needed.items() if _filed(subject, field, recordings) is None}


def _filed(subject: Subject, field: str, recordings: Sequence[Recording]) -> Any:
    """Return the value that the user states, or else the first file that does; no file states the sex."""
    stated = [getattr(one, field, None) for one in (subject, *recordings)]
    return next((value for value in stated if value is not None), None)


def mass_by_force_kg(literature: BodySegmentParameters, foot_loads: np.ndarray, residual: np.ndarray) -> float:
    """Compute body mass (kg) from the vertical ground reaction over a window, for any acceleration of the CoM.

    The residual of the uncorrected motion is P = m (a + g) - F with the literature's m, so the mass that leaves no
    mean vertical residual is m F / (F + P), with means over the window.

    Args:
        literature: the BSPs of the residual.
        foot_loads: (w, 2, 6) ground reactions.
        residual: (w, 6) root residual of the literature BSPs on the uncorrected motion.
    """
    force = float(foot_loads[:, :, 1].sum(axis=1).mean())
    return literature.total_mass_kg * force / (force + float(residual[:, 1].mean()))
