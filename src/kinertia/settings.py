"""Defines who walked and how to estimate: `Subject` and `Settings`, tables of the subject file."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo, model_validator


def folder_of(info: ValidationInfo) -> Path:
    """Return the folder that paths and names in a subject file are relative to; without a file, the current one."""
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


_STATED = re.compile(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(?:\+-|\+/-|±)\s*([\d.]+(?:[eE][-+]?\d+)?)\s*")


def _stated(value: object) -> tuple[float, float]:
    """Parse "8.9 +- 0.4" into value and standard deviation."""
    if isinstance(value, tuple):  # of a table that exists
        return value
    match = _STATED.fullmatch(value) if isinstance(value, str) else None
    try:
        numbers = tuple(float(part) for part in match.groups()) if match else ()
    except ValueError:
        numbers = ()
    if len(numbers) == 2 and numbers[1] > 0.0:
        return numbers
    raise ValueError('must be a value with its standard deviation in quotes, like "8.9 +- 0.4"')


def _stated_positive(value: object) -> tuple[float, float]:
    stated = _stated(value)
    if stated[0] > 0.0:
        return stated
    raise ValueError("must be above zero, as every mass and moment of inertia is")


Stated = Annotated[tuple[float, float], BeforeValidator(_stated)]
StatedPositive = Annotated[tuple[float, float], BeforeValidator(_stated_positive)]


_WEIGHED_SD = 0.01
"""Relative standard deviation of a mass that is given without one."""


def _attached_mass(value: object) -> tuple[float, float] | None:
    """Parse the mass of an attached object into mass and standard deviation (kg); None if it is unknown."""
    if value is None or value == "unknown":
        return None
    if type(value) in (int, float) and 0 < value < float("inf"):  # type: ignore[operator]
        return float(value), _WEIGHED_SD * float(value)  # type: ignore[arg-type]
    try:
        mass_kg, sd_kg = _stated(value)
    except ValueError:
        mass_kg = 0.0
    if mass_kg > 0:
        return mass_kg, sd_kg
    raise ValueError('must be a mass in kg, one with its standard deviation in quotes ("10 +- 0.5"), or "unknown"')


def _three(value: object) -> tuple[float, float, float]:
    match value:
        case [int() | float() as x, int() | float() as y, int() | float() as z]:
            if 0.0 < max(abs(x), abs(y), abs(z)) < _NEAREST_MM:
                raise ValueError(f"must be in mm, and none of these is {_NEAREST_MM:g} mm; are they in m?")
            if all(abs(number) <= _FARTHEST_MM for number in (x, y, z)):
                return float(x), float(y), float(z)
    raise ValueError(f"must be three numbers, [x, y, z] in mm, none beyond {_FARTHEST_MM:g}")


_NEAREST_MM, _FARTHEST_MM = 2.0, 2000.0


def _size(value: object) -> tuple[float, float, float]:
    size = _three(value)
    if min(size) > 0:
        return size
    raise ValueError("must be three lengths above zero, [depth, height, width] in mm")


def _range_deg(value: Any) -> tuple[float, float]:
    low, high = value if isinstance(value, list | tuple) and len(value) == 2 else (0.0, 0.0)
    if all(isinstance(end, int | float) for end in (low, high)) and -360.0 <= low < high <= 360.0:
        return float(low), float(high)
    raise ValueError("must be two angles, the smaller first, like [-20, 150], in degrees")


RangeDeg = Annotated[tuple[float, float], BeforeValidator(_range_deg)]
AttachedMass = Annotated[tuple[float, float] | None, BeforeValidator(_attached_mass)]
Place = Annotated[tuple[float, float, float], BeforeValidator(_three)]
Size = Annotated[tuple[float, float, float], BeforeValidator(_size)]


def sex_of(value: object) -> object:
    """Expand an abbreviation to "male" or "female" (one letter is enough); return anything else unchanged."""
    known = ("male", "female")
    word = value.strip().lower() if isinstance(value, str) else ""
    return next((sex for sex in known if word and word in (sex, sex[0])), value)


Cutoff = Annotated[float | Literal["gcv"], BeforeValidator(_cutoff)]
ForceCutoff = Annotated[float | Literal["auto", "none"], BeforeValidator(_force_cutoff)]


class Table(BaseModel):
    """A table of the subject file: unknown keys are errors, types are not converted, and instances are immutable.

    NumPy numbers and arrays are accepted as Python's.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    @model_validator(mode="before")
    @classmethod
    def _of_numpy(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        return {key: value.tolist() if hasattr(value, "dtype") else value for key, value in data.items()}


class Subject(Table):
    """Describes the participant. Mass (kg) and height (m) are None where the file leaves them to the C3D files.

    With an OpenSim model neither sex nor height is needed.

    Examples:
        >>> kinertia.Subject(name="A", sex="female", mass_kg=61.5, height_m=1.68).mass_kg
        61.5
    """

    name: str = Field(
        default="subject", min_length=1, description="name in files and report; left out: the folder's name"
    )
    sex: Annotated[Literal["male", "female"] | None, BeforeValidator(sex_of)] = Field(
        default=None, description='"male" or "female": selects the body tables'
    )
    mass_kg: float | None = Field(default=None, description="body mass on the scale, kg")
    height_m: float | None = Field(default=None, description="stature, m")
    age_years: float | None = Field(
        default=None,
        gt=0.0,
        lt=130.0,
        description="age; the tables are of young adults, below 18 and from 65 others apply",
    )
    population: Literal["adult", "child", "elderly", "obese", "other"] | None = Field(
        default=None,
        description='"adult", "child", "elderly", "obese" or "other" (pregnant, very muscular, ...); left out: by age '
        "and body-mass index",
    )
    knee_width_mm: float | None = Field(
        default=None, gt=30.0, lt=200.0, description="built-in model, sets without medial markers: knee width, mm"
    )
    ankle_width_mm: float | None = Field(default=None, gt=20.0, lt=150.0, description="ankle width, likewise, mm")
    elbow_width_mm: float | None = Field(default=None, gt=20.0, lt=150.0, description="elbow width, likewise, mm")
    ranges_deg: dict[str, RangeDeg] | None = Field(
        default=None,
        description="joints that move farther than most people's: `{ knee_angle_r = [-20, 150] }`, degrees",
    )

    @model_validator(mode="before")
    @classmethod
    def _named(cls, data: Any, info: ValidationInfo) -> Any:
        return {"name": folder_of(info).name or "subject", **data} if isinstance(data, dict) else data


@dataclass(frozen=True)
class Method:
    """What an estimator uses, besides trials of a person with the built-in model.

    Attributes:
        opensim_models: a model of the user's own, in place of the built-in one.
        attached: objects that move with a segment.
        priors: what is known of the body besides its mass, height and sex.
        instruments: what is known of plates and synchronisation; otherwise they are exact.
        joint_axes: joint axes, where the trials show them.
        force_cutoff: a bandwidth of the forces in joint moments; otherwise it is the motion's.
        symmetry: the setting by which left mirrors right.
    """

    opensim_models: bool = False
    attached: bool = False
    priors: bool = False
    instruments: bool = False
    joint_axes: bool = False
    force_cutoff: bool = False
    symmetry: bool = False


MethodName = Literal["simultaneous", "two-level"]
_METHODS: dict[MethodName, Method] = {
    "simultaneous": Method(
        opensim_models=True, attached=True, priors=True, instruments=True, joint_axes=True, force_cutoff=True
    ),
    "two-level": Method(symmetry=True),
}
SignConvention = Literal["clinical", "isb", "opensim"]


class Settings(Table):
    """Options of the estimate, and signs of its report.

    Examples:
        >>> kinertia.Settings(cutoff_hz=6.0).method
        'simultaneous'
    """

    method: MethodName = Field(
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
    joint_axes: bool | None = Field(
        default=None,
        description="built-in model; whether axes of knees, ankles and elbows are estimated; left out: with two walks, "
        'squats or a trial of use = "kinematics"',
    )
    hip_centre: Literal["bell", "harrington"] = Field(
        default="bell", description='hip joint centres from the pelvis: "bell" or "harrington"'
    )
    convention: SignConvention | None = Field(
        default=None,
        description='signs in the report: "clinical", "isb" or "opensim"; left out: "opensim" for an OpenSim model, '
        'else "clinical"',
    )

    @property
    def uses(self) -> Method:
        """What the method uses."""
        return _METHODS[self.method]


class Instruments(Table):
    """Standard deviations that the laboratory states for its instruments.

    Values that it does not state are taken from the literature.

    Examples:
        >>> kinertia.Instruments(plate_sd_mm=2.0).clock_sd_ms is None
        True
    """

    plate_sd_mm: float | None = Field(
        default=None, gt=0.0, description="SD of centres of pressure along each axis, from a spot check, mm"
    )
    clock_sd_ms: float | None = Field(
        default=None, gt=0.0, description="SD of the delay between forces and markers, from a synchronisation check, ms"
    )
    gain_sd_percent: float | None = Field(
        default=None, gt=0.0, le=20.0, description="SD of errors of the vertical force, from known weights, %"
    )
    same_plates: bool = Field(
        default=False, description="true: columns of the same name are the same plate in all force files (.mot, .sto)"
    )
    zeroed: bool = Field(
        default=False, description="true: the plates were zeroed; their unloaded reading is not subtracted"
    )


class PriorSettings(Table):
    """Options of the prior, besides the choice of anthropometric tables.

    Examples:
        >>> kinertia.settings.PriorSettings(masses_kept=True).sides_correlation is None
        True
    """

    sides_correlation: float | None = Field(
        default=None,
        ge=0.0,
        lt=1.0,
        description="correlation of left and right: 0 for none, 0.9 as in the literature prior",
    )
    masses_kept: bool = Field(default=False, description="true: segment masses are fixed at the prior")


class KnownSegment(Table):
    """Measured parameters of one segment: values with standard deviations, and their source.

    Centres of mass are given along the axes of the segment, moments of inertia about the centre of mass and the same
    axes, as in `bsp.csv`.

    Examples:
        >>> kinertia.settings.KnownSegment(mass_kg="8.9 +- 0.4", source="DXA").parameters()
        {'mass': (8.9, 0.4)}
    """

    mass_kg: StatedPositive | None = Field(default=None, description='"value +- sd", kg')
    com_x_mm: Stated | None = Field(default=None, description="centre of mass, forwards, mm")
    com_y_mm: Stated | None = Field(default=None, description="centre of mass, upwards along the segment, mm")
    com_z_mm: Stated | None = Field(default=None, description="centre of mass, to the person's right, mm")
    ixx_kgm2: StatedPositive | None = Field(default=None, description="moment of inertia about the x axis, kg m2")
    iyy_kgm2: StatedPositive | None = Field(default=None, description="about the y axis")
    izz_kgm2: StatedPositive | None = Field(default=None, description="about the z axis")
    prosthesis: bool = Field(
        default=False, description="true: the segment is a prosthesis; ignore reference data and symmetry"
    )
    source: str | None = Field(default=None, description="how it was measured; shown in the notes of a fit")

    def parameters(self) -> dict[str, tuple[float, float]]:
        """Return value and standard deviation of each stated parameter (a name of `PARAMETERS`), in SI units."""
        parameters = {}
        for key in type(self).model_fields:
            stated = getattr(self, key)
            if key not in ("source", "prosthesis") and stated is not None:
                parameter, unit = key.rsplit("_", 1)
                factor = 1e-3 if unit == "mm" else 1.0
                parameters[parameter] = (factor * stated[0], factor * stated[1])
        return parameters


class Attached(Table):
    """An object that moves with a segment in all trials and is not body: a rucksack, a held weight, an orthosis, shoes.

    Positions are given along the axes of the segment from its origin, as centres of mass in `bsp.csv`.

    Examples:
        >>> pack = dict(name="rucksack", segment="torso", com_mm=[-200, 300, 0], on_scale=False)
        >>> kinertia.Attached(mass_kg=10.0, **pack).mass_kg
        (10.0, 0.1)
        >>> kinertia.Attached(mass_kg="unknown", **pack).mass_kg is None
        True
    """

    name: str = Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", description="a name of its own, of letters, digits and _")
    segment: str = Field(description='segment that it moves with, like "torso"; in an OpenSim model a body')
    mass_kg: AttachedMass = Field(description='kg: a number, "10 +- 0.5", or "unknown": then it is estimated')
    on_scale: bool = Field(description="true: mass_kg of [subject] was weighed with it; false: without")
    com_mm: Place = Field(description="its centre of mass in the segment: [forwards, upwards, to the right], mm")
    com_sd_mm: float = Field(default=30.0, gt=0.0, le=500.0, description="SD of that along each axis, mm")
    size_mm: Size | None = Field(
        default=None,
        description="size along the same axes, for its inertia as a solid block; left out: a ball with the density "
        "of water",
    )


@dataclass(frozen=True)
class Overrule:
    """Findings that a user overrules, by code, question or family.

    Attributes:
        waive: ERRORs that do not block; shown as waived in every output.
        ignore: findings below ERROR that are not shown and do not lower the verdict.
        reasons: codes with the user's reason.

    Examples:
        >>> kinertia.Overrule(waive=("P244",)).waive
        ('P244',)
    """

    waive: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()
    reasons: tuple[tuple[str, str], ...] = ()

    def __add__(self, other: Overrule) -> Overrule:
        return Overrule((*self.waive, *other.waive), (*self.ignore, *other.ignore), (*self.reasons, *other.reasons))

    def reason(self, code: str) -> str:
        """Return the last reason given for this code, its question or its family; empty without."""
        return next((why for given, why in reversed(self.reasons) if code.startswith(given)), "")
