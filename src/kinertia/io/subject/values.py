"""Validates entries of a subject file: existing files, names of trials, windows, belt speeds."""

import json
import os
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, ValidationInfo

from kinertia.findings.finding import Severity, with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.io.file_names import missing_file, path_from
from kinertia.io.marker_set_file import preset_names
from kinertia.settings import folder_of
from kinertia.trial.file_contents import StatedContact


class CodedError(ValueError):
    """Error of a value that has a code of its own."""

    def __init__(self, code: str, **evidence: Quantity) -> None:
        self.found = with_evidence(code, Where(), evidence, Severity.ERROR)
        super().__init__(self.found.message)


def _file(value: object, info: ValidationInfo, expected: str = "a file") -> Path:
    """Return an existing file as an absolute path, relative to the subject file's folder (the context) if relative."""
    if not isinstance(value, str | Path):
        raise ValueError("must be a path in quotes")
    path = path_from(folder_of(info), str(value)).resolve()
    if os.path.isfile(path):  # false where the system allows no such name
        return path
    if os.path.isdir(path):
        what = Quantity(f"be read, and {path} is one")
        raise CodedError("F102", given=Quantity("A folder"), what=what, expected=Quantity(expected))
    raise CodedError("F101", **missing_file(path, str(value), expected))


def _marker_set(value: object, info: ValidationInfo) -> str | Path:
    if value in preset_names():
        return str(value)
    return _file(value, info, f"a marker set's TOML file or one of the presets {', '.join(preset_names())}")


def _trial_name(value: object) -> str:
    """Check that a name can be a folder's: the results of several trials go to one folder each."""
    if isinstance(value, str) and value.strip(" .") and not set(value) & set("/\\\0"):
        return value
    problem = Quantity("it must be a valid folder name: not empty, and without / and \\")
    raise CodedError("F192", name=Quantity(shown(value)), problem=problem)


def _window(value: object) -> tuple[float, float]:
    match value:
        case [int() | float() as start, int() | float() as end] if start < end:
            return float(start), float(end)
    raise ValueError("must be [start, end] in seconds, the start before the end")


def _belt_speed(value: object, info: ValidationInfo) -> float | tuple[float, float] | Path:
    match value:
        case str() | Path():
            return _file(value, info)
        case {"right": right, "left": left, **others} if not others:
            return _one_belt_speed(right), _one_belt_speed(left)
        case (right, left):  # as it is once read
            return _one_belt_speed(right), _one_belt_speed(left)
    return _one_belt_speed(value)


def _one_belt_speed(value: object) -> float:
    if isinstance(value, int | float) and not isinstance(value, bool) and 0 < value <= 15:
        return float(value)
    raise ValueError("must be a belt's speed in m/s (up to 15), of two belts {right=1.2, left=0.6}, or a file")


def _stated_contacts(value: object) -> tuple[StatedContact, ...]:
    if not isinstance(value, list | tuple) or not value:
        raise ValueError(_CONTACT)
    return tuple(one if isinstance(one, StatedContact) else _stated_contact(one) for one in value)


def _stated_contact(value: object) -> StatedContact:
    match value:
        case {"plate": str(plate), "foot": "right" | "left" | "none" as foot, **others}:
            span = _window(others.pop("window_s", (-np.inf, np.inf)))
            if not others:
                return StatedContact(plate, {"right": 0, "left": 1}.get(foot), span)
    raise ValueError(_CONTACT)


_CONTACT = 'must be like [{plate="plate 1",foot="right",window_s=[0.4,1.1]}]; foot "right", "left" or "none"'
File = Annotated[Path, BeforeValidator(_file)]
MarkerSetName = Annotated[str | Path, BeforeValidator(_marker_set)]
TrialName = Annotated[str, BeforeValidator(_trial_name)]
Window = Annotated[tuple[float, float], BeforeValidator(_window)]
StatedContacts = Annotated[tuple[StatedContact, ...], BeforeValidator(_stated_contacts)]
LengthUnit = Literal["mm", "cm", "m"]
BeltSpeed = Annotated[float | tuple[float, float] | Path, BeforeValidator(_belt_speed)]


def shown(value: object) -> str:
    """Format a value nearly as TOML does."""
    return json.dumps(value, default=str, ensure_ascii=False)
