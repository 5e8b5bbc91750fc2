"""Defines the unknowns of the study's estimator: seven parameters of every segment or pair of segments."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from kinertia.model.bsp import (
    MIRROR_SIGNS,
    PARAMETERS,
    UNITS,
    BodySegmentParameters,
    FloatArray,
    dynamic_by_table,
    partners,
)

_STUDY = 7
"""Parameters per segment: the first seven of `PARAMETERS`."""


@dataclass(frozen=True, eq=False)
class ParameterVector:
    """The study's unknowns theta: mass, com_x, com_y, com_z, ixx, iyy, izz of every segment or every pair.

    Principal axes lie along the segment axes: ixy, ixz, iyz are not in theta and keep the reference's values
    (zero in the study). Under symmetry a pair counts once, as its right segment, and the left segment mirrors the right
    one, including the fixed ixy, ixz, iyz. Twelve segments give 84 parameters, or 49 under symmetry.

    Attributes:
        reference: gives the segments, their order, and ixy, ixz, iyz.
        symmetric: whether left mirrors right.

    Raises:
        ValueError: under symmetry two would share a name (`hand_r`, `hand_l` and also `hand`).
    """

    reference: BodySegmentParameters
    symmetric: bool

    def __post_init__(self) -> None:
        if len(set(self.names)) != len(self.names):
            raise ValueError(f"parameter names are not unique: {', '.join(self.names)}")

    @cached_property
    def _is_left(self) -> npt.NDArray[np.bool_]:
        # (s,) segments whose values mirror their partner's
        segments = self.reference.segments
        paired = partners(segments) != np.arange(len(segments))
        return np.array([self.symmetric and p and n.endswith("_l") for n, p in zip(segments, paired, strict=True)])

    @cached_property
    def _group(self) -> npt.NDArray[np.intp]:
        # (s,) which seven of theta a segment takes
        own = np.cumsum(~self._is_left) - 1
        return np.where(self._is_left, own[partners(self.reference.segments)], own)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names `<segment>.<parameter>` of all elements of theta; a pair drops its suffix ("thigh.mass")."""
        mirrored = set(self._group[self._is_left])
        groups = []
        for name, group, left in zip(self.reference.segments, self._group, self._is_left, strict=True):
            if not left:
                groups.append(name[:-2] if group in mirrored else name)
        return tuple(f"{group}.{parameter}" for group in groups for parameter in PARAMETERS[:_STUDY])

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of every element of theta."""
        return UNITS[:_STUDY] * (len(self.names) // _STUDY)

    @property
    def lower_bounds(self) -> FloatArray:
        """Lower bounds of theta: 0 for masses (kg) and moments (kg m2), -inf for CoM coordinates (m)."""
        return np.tile([0.0, -np.inf, -np.inf, -np.inf, 0.0, 0.0, 0.0], len(self.names) // _STUDY)

    def values(self, bsp: BodySegmentParameters) -> FloatArray:
        """Return theta of these body segment parameters; under symmetry the mean of the right and the mirrored left.

        Raises:
            ValueError: the segments are not those of the reference.
        """
        return self._symmetrised(bsp)[~self._is_left, :_STUDY].ravel()

    def bsp(self, theta: npt.ArrayLike) -> BodySegmentParameters:
        """Return body segment parameters with this theta; the left mirrors the right under symmetry."""
        table = self._own_table.copy()
        table[:, :_STUDY] = self._grouped(theta) * self._signs
        return BodySegmentParameters.from_table(self.reference.segments, table)

    def jacobian(self, theta: npt.ArrayLike) -> FloatArray:
        """Compute the derivative (10 s, len(names)) of `bsp(theta).dynamic_parameters()` with respect to theta."""
        values = self._grouped(theta) * self._signs
        blocks = dynamic_by_table(values[:, 0], values[:, 1:4])[..., :_STUDY] * self._signs[:, None, :]
        jacobian = np.zeros((len(blocks), 10, len(self.names) // _STUDY, _STUDY))
        jacobian[np.arange(len(blocks)), :, self._group, :] = blocks
        return jacobian.reshape(10 * len(blocks), len(self.names))

    @cached_property
    def _own_table(self) -> FloatArray:
        # (s, 10) of the reference
        return self._symmetrised(self.reference)

    @cached_property
    def _signs(self) -> FloatArray:
        # (s, 7) factors from a segment's seven of theta to its own parameters
        return np.where(self._is_left[:, None], MIRROR_SIGNS[:_STUDY], 1.0)

    def _grouped(self, theta: npt.ArrayLike) -> FloatArray:
        # (s, 7) each segment's elements of theta
        vector = np.asarray(theta, dtype=float)
        if vector.shape != (len(self.names),):
            raise ValueError(f"theta has shape {vector.shape}; ({len(self.names)},) was expected")
        return vector.reshape(-1, _STUDY)[self._group]

    def _symmetrised(self, bsp: BodySegmentParameters) -> FloatArray:
        # (s, 10) table in which, under symmetry, pairs are the mean of either side and the mirrored other
        if bsp.segments != self.reference.segments:
            raise ValueError(f"segments {bsp.segments} are not those of the reference {self.reference.segments}")
        table = bsp.table()
        if self.symmetric:
            paired = partners(bsp.segments) != np.arange(len(bsp.segments))
            mirrored = table[partners(bsp.segments)] * MIRROR_SIGNS
            table[paired] = 0.5 * (table[paired] + mirrored[paired])
        return table
