"""Who walked, and how to estimate: `Subject` and `Settings`, tables of the subject file and arguments of functions."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo, model_validator


def folder_of(info: ValidationInfo) -> Path:
    """Folder that paths and names in a subject file count from; the current one without a file."""
    result: Path = (info.context or {}).get("folder", Path.cwd())
    return result


def _cutoff(value: object) -> object:
    if value == "gcv" or (type(value) in (int, float) and 0 < value < float("inf")):  # type: ignore[operator]
        return value
    raise ValueError('must be "gcv" or a positive frequency in Hz')


def _force_cutoff(value: object) -> object:
    if value in ("auto", "none") or (type(value) in (int, float) and 0 < value < float("inf")):  # type: ignore[operator]
        return value
    raise ValueError('must be "auto", "none" or a positive frequency in Hz')


def sex_of(value: object) -> object:
    """ "male" or "female", of which one letter is enough; anything else as it is."""
    known = ("male", "female")
    word = value.strip().lower() if isinstance(value, str) else ""
    return next((sex for sex in known if word and word in (sex, sex[0])), value)


Cutoff = Annotated[float | Literal["gcv"], BeforeValidator(_cutoff)]
ForceCutoff = Annotated[float | Literal["auto", "none"], BeforeValidator(_force_cutoff)]


class Table(BaseModel):
    """A table of the subject file: unknown keys are errors, types are never converted, nothing changes afterwards."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class Subject(Table):
    """Who walked. Mass (kg) and height (m) are None where the file leaves them to the C3D files.

    With an OpenSim model neither sex nor height is needed.

    Examples:
        >>> kinertia.Subject(name="A", sex="female", mass_kg=61.5, height_m=1.68).mass_kg
        61.5
    """

    name: str = Field(min_length=1, description="name in files and report; left out: the folder's name")
    sex: Annotated[Literal["male", "female"] | None, BeforeValidator(sex_of)] = Field(
        default=None, description='"male" or "female": which table of the literature'
    )
    mass_kg: float | None = Field(default=None, description="body mass on the scale, kg")
    height_m: float | None = Field(default=None, description="stature, m")

    @model_validator(mode="before")
    @classmethod
    def _named(cls, data: Any, info: ValidationInfo) -> Any:
        return {"name": folder_of(info).name or "subject", **data} if isinstance(data, dict) else data


class Settings(Table):
    """How to estimate.

    Examples:
        >>> kinertia.Settings(cutoff_hz=6.0).method
        'simultaneous'
    """

    method: Literal["simultaneous", "two-level"] = Field(
        default="simultaneous", description='estimator: "simultaneous" or "two-level" (the study\'s)'
    )
    bsp: Literal["dumas", "deleva"] = Field(
        default="dumas", description='literature table to start from: "dumas" or "deleva"'
    )
    symmetry: bool = Field(
        default=True, description="two-level only; true: left mirrors right, 49 parameters; false: 84"
    )
    cutoff_hz: Cutoff = Field(default="gcv", description='bandwidth of the motion: "gcv" (from the data) or Hz')
    force_cutoff_hz: ForceCutoff = Field(
        default="auto",
        description='simultaneous; forces in joint moments: "auto" (as measured, without impacts), "none" or Hz',
    )
    joint_axes: bool = Field(
        default=False,
        description="simultaneous, built-in model; true: axes of knees, ankles, elbows are calibrated too",
    )
    hip_centre: Literal["bell", "harrington"] = Field(
        default="bell", description='hip joint centres from the pelvis: "bell" or "harrington"'
    )


class Instruments(Table):
    """How well the laboratory knows its instruments; the literature's deviations for what it does not state.

    Examples:
        >>> kinertia.Instruments(plate_sd_mm=2.0).clock_sd_ms is None
        True
    """

    plate_sd_mm: float | None = Field(
        default=None,
        gt=0.0,
        description="how far centres of pressure are off along each axis, from a spot check, mm",
    )
    clock_sd_ms: float | None = Field(
        default=None, gt=0.0, description="how far forces are late or early, from a synchronisation check, ms"
    )
    same_plates: bool = Field(
        default=False, description="true: columns of the same name are the same plate in all force files (.mot, .sto)"
    )
