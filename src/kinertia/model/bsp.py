"""Defines body segment parameters (BSPs): one table and its views.

A rigid segment has ten inertial parameters: mass, three coordinates of the centre of mass (CoM), six elements
of the inertia tensor. Biomechanics states the tensor about the CoM, in the segment frame; the equations of
motion are linear in another ten, the *dynamic parameters*: the first moment m c replaces the CoM, and the
tensor is about the origin of the segment frame. `BodySegmentParameters` holds the former and returns the latter.

ixy, ixz and iyz are elements of the tensor, ixy = -integral of x y dm, as in OpenSim, URDF and Pinocchio, not
"products of inertia" of the opposite sign.

Left and right are distinguished by the suffixes `_l` and `_r`. Axes are x anterior, y up, z to the body's right on
both sides (ISB): the left segment is the right one mirrored in the x-y plane; com_z, ixz and iyz change sign.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import pandas as pd

FloatArray = npt.NDArray[np.float64]

PARAMETERS = ("mass", "com_x", "com_y", "com_z", "ixx", "iyy", "izz", "ixy", "ixz", "iyz")
"""Order of the ten in `BodySegmentParameters.table` and in files; the first seven are the study's."""

UNITS = ("kg", "m", "m", "m") + 6 * ("kg m2",)
"""Unit of each of `PARAMETERS`."""

MIRROR_SIGNS = np.array([1.0, 1.0, 1.0, -1.0, 1.0, 1.0, 1.0, 1.0, -1.0, -1.0])
"""Factor on each of `PARAMETERS` that converts a right segment into a left one."""

_ROUNDING = 1e-6
_ASYMMETRY = 1e-9
_CONDITIONS = (
    "mass is {value:.4g} kg, not positive",
    "ixx is {value:.4g} kg m2, not positive",
    "iyy is {value:.4g} kg m2, not positive",
    "izz is {value:.4g} kg m2, not positive",
    "triangle inequality ixx + iyy > izz violated by {excess:.4g} kg m2",
    "triangle inequality iyy + izz > ixx violated by {excess:.4g} kg m2",
    "triangle inequality izz + ixx > iyy violated by {excess:.4g} kg m2",
    "ixy, ixz, iyz are too large: triangle inequality of the principal moments violated by {excess:.4g} kg m2",
)
"""Messages for a segment that violates a condition; `BodySegmentParameters._margins` has a column for each."""
_TABLE_ROWS, _TABLE_COLUMNS = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]  # ixx iyy izz ixy ixz iyz
_PIN_ROWS, _PIN_COLUMNS = [0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]  # Ixx Ixy Iyy Ixz Iyz Izz


@dataclass(frozen=True, eq=False)
class BodySegmentParameters:
    """Inertial parameters of `s` segments, each in its own segment frame.

    Physically impossible values (a negative mass) are allowed, because an estimator passes through them;
    `inconsistencies` lists them.

    Attributes:
        segments: unique names, `s` of them; a left/right pair is `<name>_l` and `<name>_r`.
        mass_kg: (s,) masses, kg.
        com_m: (s, 3) centres of mass from the segment's origin, m.
        inertia_kgm2: (s, 3, 3) symmetric inertia tensors about the segment's CoM, kg m2.

    Raises:
        ValueError: a shape is wrong, a name occurs twice, a value is not finite, or a tensor is not symmetric.

    Examples:
        >>> bsp = kinertia.BodySegmentParameters(
        ...     ("shank",), np.array([3.0]), np.array([[0.0, -0.18, 0.0]]), np.diag([0.04, 0.004, 0.04])[None]
        ... )
        >>> bsp.total_mass_kg, bool(bsp.physically_consistent().all())
        (3.0, True)
    """

    segments: tuple[str, ...]
    mass_kg: FloatArray
    com_m: FloatArray
    inertia_kgm2: FloatArray

    def __post_init__(self) -> None:
        segments = tuple(self.segments)
        if len(set(segments)) != len(segments):
            raise ValueError(f"segment names must be unique: {', '.join(segments)}")
        object.__setattr__(self, "segments", segments)
        for name, shape in (("mass_kg", ()), ("com_m", (3,)), ("inertia_kgm2", (3, 3))):
            array = np.array(getattr(self, name), dtype=float)
            expected = (len(segments), *shape)
            if array.shape != expected:
                raise ValueError(f"{name} has shape {array.shape}; {expected} was expected")
            if not (finite := np.isfinite(array).all(axis=tuple(range(1, array.ndim)))).all():
                raise ValueError(f"{name} of segment '{segments[np.argmin(finite)]}' is not finite")
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        skew = np.abs(self.inertia_kgm2 - self.inertia_kgm2.transpose(0, 2, 1)).max(axis=(1, 2))
        symmetric = skew <= _ASYMMETRY * np.abs(self.inertia_kgm2).max(axis=(1, 2))
        if not symmetric.all():
            raise ValueError(f"inertia_kgm2 of segment '{segments[np.argmin(symmetric)]}' is not symmetric")

    @property
    def total_mass_kg(self) -> float:
        """Sum of the segments' masses, kg."""
        return float(self.mass_kg.sum())

    def table(self) -> FloatArray:
        """Return values (s, 10) in the order of `PARAMETERS`, SI units."""
        moments = self.inertia_kgm2[:, _TABLE_ROWS, _TABLE_COLUMNS]
        return np.column_stack([self.mass_kg, self.com_m, moments])

    @classmethod
    def from_table(cls, segments: Sequence[str], table: npt.ArrayLike) -> BodySegmentParameters:
        """Make parameters from a table: the inverse of `table`."""
        values = _rows(segments, table)
        inertia = _tensors(values[:, 4:], _TABLE_ROWS, _TABLE_COLUMNS)
        return cls(tuple(segments), values[:, 0], values[:, 1:4], inertia)

    def dynamic_parameters(self) -> FloatArray:
        """Return parameters (10 s,) in which the equations of motion are linear, segment after segment.

        Pinocchio's order (`pin.Inertia.toDynamicParameters`): m, m c_x, m c_y, m c_z (kg m), then Ixx, Ixy,
        Iyy, Ixz, Iyz, Izz (kg m2) about the SEGMENT ORIGIN: I_origin = I_com + m (c.c 1 - c c^T).
        """
        inertia = self.inertia_kgm2 + _point_mass_inertia(self.mass_kg, self.com_m)
        moments = inertia[:, _PIN_ROWS, _PIN_COLUMNS]
        return np.column_stack([self.mass_kg, self.mass_kg[:, None] * self.com_m, moments]).ravel()

    @classmethod
    def from_dynamic_parameters(cls, segments: Sequence[str], parameters: npt.ArrayLike) -> BodySegmentParameters:
        """Invert `dynamic_parameters`; a segment without mass gets its CoM at its origin.

        Raises:
            ValueError: the number of parameters is wrong, or there is a first moment without a mass.
        """
        values = _rows(segments, parameters)
        mass, first_moment = values[:, 0], values[:, 1:4]
        for segment, m, moment in zip(segments, mass, first_moment, strict=True):
            if m == 0.0 and moment.any():
                raise ValueError(f"segment '{segment}' has a first moment but no mass")
        com = first_moment / np.where(mass == 0.0, 1.0, mass)[:, None]
        inertia = _tensors(values[:, 4:], _PIN_ROWS, _PIN_COLUMNS) - _point_mass_inertia(mass, com)
        return cls(tuple(segments), mass, com, inertia)

    def to_frame(self) -> pd.DataFrame:
        """Return a long table with columns segment, parameter, unit, value; ten rows per segment (`PARAMETERS`)."""
        import pandas as pd

        return pd.DataFrame(self.columns())

    def columns(self) -> dict[str, Any]:
        """Return the columns of `to_frame`, by name."""
        s = len(self.segments)
        return {
            "segment": np.repeat(np.array(self.segments, dtype=object), len(PARAMETERS)),
            "parameter": PARAMETERS * s,
            "unit": UNITS * s,
            "value": self.table().ravel(),
        }

    def _repr_html_(self) -> str:
        """Return the HTML table for a notebook: a row per segment, a column per parameter, in kg, m and kg m2."""
        import pandas as pd

        headings = [f"{name} ({unit})" for name, unit in zip(PARAMETERS, UNITS, strict=True)]
        frame = pd.DataFrame(self.table(), index=pd.Index(self.segments, name="segment"), columns=headings)
        return str(frame.to_html(float_format=lambda value: f"{value:.4g}"))

    @classmethod
    def from_frame(cls, frame: pd.DataFrame) -> BodySegmentParameters:
        """Invert `to_frame`; rows may be in any order, segments keep the order of their first row.

        Raises:
            ValueError: a column, segment parameter or unit is missing, unknown or given twice.
        """
        columns = ("segment", "parameter", "unit", "value")
        if missing := [column for column in columns if column not in frame.columns]:
            raise ValueError(f"the table of body segment parameters lacks the column(s) {', '.join(missing)}")
        units = dict(zip(PARAMETERS, UNITS, strict=True))
        values: dict[str, dict[str, float]] = {}
        for segment, parameter, unit, value in zip(*(frame[column] for column in columns), strict=True):
            row = values.setdefault(segment, {})
            if parameter not in units:
                raise ValueError(f"{segment}: '{parameter}' is none of {', '.join(PARAMETERS)}")
            if unit != units[parameter]:
                raise ValueError(f"{segment}: {parameter} is in '{unit}'; give it in '{units[parameter]}'")
            if parameter in row:
                raise ValueError(f"{segment}: {parameter} is given twice")
            row[parameter] = float(value)
        for segment, row in values.items():
            absent = [parameter for parameter in PARAMETERS if parameter not in row]
            if absent:
                raise ValueError(f"{segment}: {', '.join(absent)} missing")
        return cls.from_table(tuple(values), [[row[p] for p in PARAMETERS] for row in values.values()])

    def pseudo_inertia(self) -> FloatArray:
        """Return pseudo-inertia matrices (s, 4, 4) [[S, m c], [m c^T, m]]; S = integral of x x^T dm at the origin.

        They are positive definite exactly when the parameters belong to a body of positive density (Wensing,
        Kim & Slotine 2018, IEEE RA-L 3:60). Units: kg m2 (S), kg m, kg.
        """
        first_moment = self.mass_kg[:, None] * self.com_m
        pseudo = np.empty((len(self.segments), 4, 4))
        pseudo[:, :3, :3] = second_moments(self.inertia_kgm2) + first_moment[:, :, None] * self.com_m[:, None, :]
        pseudo[:, :3, 3] = pseudo[:, 3, :3] = first_moment
        pseudo[:, 3, 3] = self.mass_kg
        return pseudo

    def physically_consistent(self) -> npt.NDArray[np.bool_]:
        """Return whether each segment (s,) has mass > 0 and a positive definite pseudo-inertia.

        Then a body of positive density with these parameters exists.
        """
        possible: npt.NDArray[np.bool_] = np.all(self._margins() > 0, axis=1)
        return possible

    def inconsistencies(self) -> list[str]:
        """Describe each physical condition that a segment violates, in a sentence; empty if all are consistent."""
        margins = self._margins()
        violated = ~(margins > 0)
        # the principal moments add nothing where those about the axes are impossible
        violated[:, -1] &= ~violated[:, 1:-1].any(axis=1)
        return [
            f"{self.segments[i]}: {_CONDITIONS[k].format(value=margins[i, k], excess=-margins[i, k])}."
            for i, k in np.argwhere(violated)
        ]

    def _margins(self) -> FloatArray:
        """Return the quantities (s, 8) that must be positive for each of `_CONDITIONS`, kg and kg m2.

        Moments are about the CoM: if the pseudo-inertia is positive definite about one point, it is about all.
        """
        moments = np.diagonal(self.inertia_kgm2, axis1=1, axis2=2)
        excess = moments - np.roll(moments, -1, axis=1) - np.roll(moments, -2, axis=1)
        smallest = np.linalg.eigvalsh(second_moments(self.inertia_kgm2))[:, 0]
        return np.column_stack([self.mass_kg, moments, -excess[:, [2, 0, 1]], 2.0 * smallest])

    def mirrored(self) -> BodySegmentParameters:
        """Return the body's mirror image, with the same names in the same order.

        Every segment takes the values of its partner (`_r` <-> `_l`; a segment without partner is its own),
        with com_z, ixz and iyz changed in sign.
        """
        return self.from_table(self.segments, self.table()[partners(self.segments)] * MIRROR_SIGNS)


def combine(
    mass_kg: npt.ArrayLike, com_m: npt.ArrayLike, inertia_kgm2: npt.ArrayLike
) -> tuple[float, FloatArray, FloatArray]:
    """Combine `n` bodies, given in one frame, rigidly into one.

    Args:
        mass_kg: (n,) masses, kg.
        com_m: (n, 3) centres of mass, m.
        inertia_kgm2: (n, 3, 3) tensors, each about its own body's CoM, kg m2.

    Returns:
        Mass (kg), centre of mass (3,) (m) and tensor (3, 3) about that centre of mass (kg m2).

    Raises:
        ValueError: the total mass is not positive.
    """
    mass, com, inertia = (np.asarray(a, dtype=float) for a in (mass_kg, com_m, inertia_kgm2))
    total = float(mass.sum())
    if not total > 0:
        raise ValueError(f"bodies of total mass {total} kg have no common centre of mass")
    centre = mass @ com / total
    return total, centre, (inertia + _point_mass_inertia(mass, com - centre)).sum(axis=0)


def impossible_segments(bsp: BodySegmentParameters) -> list[str]:
    """List the segments that no distribution of mass can have.

    Bodies without mass and inertia, as in OpenSim models, are not judged; a body without thickness (equality in the
    triangle inequality, as with rounded inertias) is accepted.
    """
    table, second = bsp.table(), np.linalg.eigvalsh(second_moments(bsp.inertia_kgm2))
    there = table[:, [0, *range(4, 10)]].any(axis=1)
    wrong = (bsp.mass_kg <= 0) | (second[:, 0] < -_ROUNDING * np.abs(second).max(axis=1))
    return [bsp.segments[i] for i in np.flatnonzero(there & wrong)]


def second_moments(inertia: FloatArray) -> FloatArray:
    """Return integrals (..., 3, 3) of x x^T dm from inertia tensors about the same point."""
    result: FloatArray = 0.5 * np.trace(inertia, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - inertia
    return result


def inertia_of(second: FloatArray) -> FloatArray:
    """Return inertia tensors (..., 3, 3) from integrals of x x^T dm about the same point; inverts `second_moments`."""
    result: FloatArray = np.trace(second, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - second
    return result


def transformed_parameters(places: FloatArray) -> FloatArray:
    """Return linear maps (s, 10, 10) of dynamic parameters from frames to the one in which they are given (`places`).

    The pseudo-inertia of a body moves as J' = T J T^T (Wensing, Kim and Slotine 2018); the parameters are linear in J.

    Args:
        places: (s, 4, 4) homogeneous transforms T.
    """
    units = np.zeros((10, 4, 4))  # pseudo-inertias of unit dynamic parameters
    units[0, 3, 3] = 1.0
    units[[1, 2, 3], [0, 1, 2], 3] = units[[1, 2, 3], 3, [0, 1, 2]] = 1.0
    units[4:, :3, :3] = second_moments(_tensors(np.eye(6), _PIN_ROWS, _PIN_COLUMNS))
    transform = places[:, None]
    moved = transform @ units @ transform.transpose(0, 1, 3, 2)
    moments = inertia_of(moved[..., :3, :3])[..., _PIN_ROWS, _PIN_COLUMNS]
    parameters: FloatArray = np.concatenate([moved[..., 3, 3:], moved[..., :3, 3], moments], axis=-1)
    return parameters.transpose(0, 2, 1)


def dynamic_by_table(mass: FloatArray, com: FloatArray) -> FloatArray:
    """Return the derivative (s, 10, 10) of each segment's dynamic parameters by its row of the table.

    The table is `BodySegmentParameters.table`.
    """
    derivative = np.zeros((len(mass), 10, 10))
    derivative[:, 0, 0] = 1.0
    derivative[:, 1:4, 0] = com
    derivative[:, 4:, 0] = _point_mass_inertia(np.ones_like(mass), com)[:, _PIN_ROWS, _PIN_COLUMNS]
    for k, unit in enumerate(np.eye(3)):
        derivative[:, 1 + k, 1 + k] = mass
        outer = com[:, :, None] * unit
        tensor = 2.0 * com[:, k, None, None] * np.eye(3) - outer - outer.transpose(0, 2, 1)
        derivative[:, 4:, 1 + k] = (mass[:, None, None] * tensor)[:, _PIN_ROWS, _PIN_COLUMNS]
    derivative[:, [4, 6, 9, 5, 7, 8], range(4, 10)] = 1.0
    return derivative


def partners(segments: Sequence[str]) -> npt.NDArray[np.intp]:
    """Return the index (s,) of each segment's `_l`/`_r` partner, or its own."""
    index = {name: i for i, name in enumerate(segments)}
    other = {"_r": "_l", "_l": "_r"}
    return np.array([index.get(name[:-2] + other.get(name[-2:], ""), i) for name, i in index.items()], dtype=np.intp)


def _rows(segments: Sequence[str], values: npt.ArrayLike) -> FloatArray:
    array = np.asarray(values, dtype=float)
    if array.size != 10 * len(segments):
        raise ValueError(f"{array.size} values were given; ten for each of {len(segments)} segments were expected")
    return array.reshape(len(segments), 10)


def _tensors(moments: FloatArray, rows: list[int], columns: list[int]) -> FloatArray:
    tensors = np.empty((len(moments), 3, 3))
    tensors[:, rows, columns] = tensors[:, columns, rows] = moments
    return tensors


def _point_mass_inertia(mass: FloatArray, position: FloatArray) -> FloatArray:
    """Return the inertia (n, 3, 3) about the origin of point masses (n,) at positions (n, 3)."""
    squares = np.einsum("ni,ni->n", position, position)
    result: FloatArray = mass[:, None, None] * (
        squares[:, None, None] * np.eye(3) - position[:, :, None] * position[:, None, :]
    )
    return result
