"""What can be wrong with a person's mass, height and trials: errors before any estimate."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import TypeVar

import numpy as np

from kinertia.errors import SettingsError, SubjectError, TrialError
from kinertia.io.file_names import trouble_as_folders
from kinertia.model.anthropometry import check_subject
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.settings import Subject
from kinertia.trial.data import Recording, Trial

T = TypeVar("T")

_OTHER_PERSON_M, _OTHER_PERSON = 0.04, 0.15
"""Two markers of a segment may differ in distance by this much between trials of one person: length, or share."""


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
        raise SettingsError("there is no trial to estimate from; give at least one")
    names = [recording.name for recording in recordings]
    if trouble := trouble_as_folders(names):
        index, problem = trouble
        advice = "results have a folder for each trial: give this one's recording another name (dataclasses.replace)"
        raise TrialError(names[index], f"{problem}; {advice}")


def complete_subject(
    subject: Subject, recordings: Sequence[Recording], mass_only: bool = False
) -> tuple[Subject, list[str]]:
    """Mass and height from the files where the user gave none; warnings where both are given and disagree.

    Args:
        subject, recordings: what the user says, and the files.
        mass_only: height and sex may stay unknown.

    Raises:
        SubjectError: neither the user nor a file gives mass or height, the user no sex, or a value cannot be true.
    """
    warnings = []
    values: dict[str, float] = {}
    for quantity, option in (("mass_kg", "--mass"), ("height_m", "--height")):
        stated = [(r.name, getattr(r, quantity)) for r in recordings if getattr(r, quantity) is not None]
        given = getattr(subject, quantity)
        if given is None and not stated:
            if mass_only and quantity == "height_m":
                continue
            raise SubjectError(
                quantity, None, f"no file carries it; give it with {option} or as {quantity} under [subject]"
            )
        values[quantity] = stated[0][1] if given is None else given
        for name, value in stated:
            if abs(value - values[quantity]) > 0.01 * values[quantity]:
                warnings.append(f"{quantity} is taken as {values[quantity]:g}, but the file of '{name}' says {value:g}")
    if subject.sex is None and not mass_only:
        problem = (
            "give male or female, by which the table of the literature is chosen, with --sex or as sex under [subject]"
        )
        raise SubjectError("sex", None, problem)
    check_subject(values["mass_kg"], values.get("height_m", 1.7), subject.sex or "male")
    return subject.model_copy(update=values), warnings


def check_visible(skeleton: Skeleton, trial: Trial) -> None:
    """Raise TrialError when a segment other than the arms' has no marker in the trial."""
    arms = tuple(f"{name}_{side}" for side in "rl" for name in ("upper_arm", "forearm"))
    for segment in set(skeleton.segments) - set(arms):
        worn = [m.label for m in skeleton.markers if m.segment == segment]
        if worn and not set(worn) & set(trial.markers.labels):
            raise TrialError(
                trial.name,
                f"none of the markers of the {segment} ({', '.join(worn)}) is in the file, so its coordinates are "
                f"unknown; use a trial that has them",
            )


def check_same_person(skeleton: Skeleton, trials: Sequence[Trial]) -> None:
    """Raise TrialError when marker distances say that trials are of different people, or of one marked anew.

    Compared are distances between markers of one segment of pelvis, legs and feet: median over the frames of a trial.
    """
    segments = dict(zip(skeleton.labels, skeleton.marker_segments, strict=True))
    lower = {skeleton.segments[0], *(f"{name}_{side}" for name in ("thigh", "shank", "foot") for side in "rl")}
    for first, other in combinations(trials, 2):
        labels = [name for name in skeleton.labels if name in first.markers.labels and name in other.markers.labels]
        pairs = [
            (a, b)
            for a, b in combinations(labels, 2)
            if segments[a] == segments[b] and skeleton.segments[segments[a]] in lower
        ]
        if not pairs:
            continue
        long, short = (_median_distances(trial, pairs) for trial in (first, other))
        off = np.abs(long - short)
        wrong = np.nan_to_num(np.minimum(off / _OTHER_PERSON_M, off / (_OTHER_PERSON * long)))
        k = int(np.argmax(wrong))
        if wrong[k] > 1.0:
            raise TrialError(
                other.name,
                f"the markers {pairs[k][0]} and {pairs[k][1]} are {short[k] * 1e3:.0f} mm apart, in '{first.name}' "
                f"{long[k] * 1e3:.0f} mm; pool only trials of one person with the markers left in place",
            )


def _median_distances(trial: Trial, pairs: Sequence[tuple[str, str]]) -> np.ndarray:
    ends = (trial.markers.arranged([pair[i] for pair in pairs]) for i in range(2))
    distances = np.linalg.norm(np.subtract(*ends), axis=-1)
    seen = np.isfinite(distances).any(axis=0)
    return np.where(seen, np.nanmedian(np.where(seen, distances, 0.0), axis=0), np.nan)


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
