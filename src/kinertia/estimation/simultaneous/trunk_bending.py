"""How a trunk that bends departs from a rigid one: part of it stays upright while the trunk leans.

Markers on chest and shoulders lean with the upper trunk. Head, abdomen and spine follow them only in part, so that some
mass is nearer to the vertical through the trunk's lowest joint than a rigid trunk has it. A mass m at the height h over
that joint is displaced by s h (y - u): s is the share that stays upright, y points up, and u along the trunk. The sum
of s m h is one unknown per trial, kappa (kg m): how much bends depends on the task.

To first order in kappa the root load grows by what a first moment of -kappa along u does in a rigid trunk, with the
inertia that belongs to it, and by the moment of a displacement that always points up: kappa y x f, where f is the
specific force at the trunk (acceleration less gravity). It is taken from the ground reactions: f = F / mass.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinertia.estimation.simultaneous.sound_or_faulty import SoundOrFaulty
from kinertia.model.anatomy import segment_of
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.log_cholesky import dynamic_jacobian

BENDING_PRIOR_M = SoundOrFaulty(0.001, 0.02, 0.1)
"""Of kappa over the body's mass: a trunk that is rigid, and one that bends. Under a prior of 0.015 m, a person of 63 kg
had 0.4 to 0.8 kg m in walks, 1.0 swaying, 1.4 to 2.3 in jumps and 2.5 in squats: 0.006 to 0.04 m. Walks hardly show it,
and where it is nothing, room for it lets the trunk's centre of mass wander: so it needs evidence."""
_MIDDLE = 1.5
"""Mean height of what is displaced, over the trunk's centre of mass: deflections of a uniform rod that is held at its
lower end grow with the square of the height, which puts their mean at three quarters of its length."""
_MOST_OF_TRUNK = 0.7
"""Share of all bodies of the trunk; a model with less in one of them has a trunk that bends."""


@dataclass(frozen=True, eq=False)
class TrunkBending:
    """The trunk of a model, and what one unit of kappa (kg m) changes.

    Attributes:
        row: of the trunk among the segments.
        parameters: (10,) by how much its dynamic parameters change.
        mass_kg: of the whole body.
    """

    row: int
    parameters: np.ndarray
    mass_kg: float

    @classmethod
    def of(cls, bsp: BodySegmentParameters, mass_kg: float) -> TrunkBending | None:
        """Of these segments and a body of this mass; None if none of them is a trunk that stands on its origin."""
        trunk = [k for k, name in enumerate(bsp.segments) if segment_of(name) == "torso"]
        if not trunk:
            return None
        row = max(trunk, key=lambda k: bsp.mass_kg[k])
        height_m = float(bsp.com_m[row, 1])
        if height_m <= 0.0 or bsp.mass_kg[row] < _MOST_OF_TRUNK * bsp.mass_kg[trunk].sum():
            return None
        parameters = np.zeros(10)
        parameters[2] = -1.0
        parameters[[4, 9]] = -2.0 * _MIDDLE * height_m  # displaced, and its distance from the joint changed
        return cls(row, parameters, mass_kg)

    @property
    def prior(self) -> SoundOrFaulty:
        """Of kappa, kg m."""
        known = BENDING_PRIOR_M
        return SoundOrFaulty(self.mass_kg * known.sound_sd, self.mass_kg * known.faulty_sd, known.faulty_share)

    def at(self, static: np.ndarray, place: int) -> BentTrunk:
        """Bent as the static unknowns (S,) have it at this place."""
        return BentTrunk(self, float(static[place]), place)


@dataclass(frozen=True, eq=False)
class BentTrunk:
    """A trunk that bends, in a trial.

    Attributes:
        trunk: the model's.
        kappa: kg m.
        place: where it stands among the static unknowns.
    """

    trunk: TrunkBending
    kappa: float
    place: int

    @property
    def _share(self) -> float:
        """m."""
        return self.kappa / self.trunk.mass_kg

    def bent(self, bsp: BodySegmentParameters) -> BodySegmentParameters:
        """What moves like these segments with this trunk; nothing that is physically possible."""
        if not self.kappa:
            return bsp
        parameters = bsp.dynamic_parameters().reshape(-1, 10)
        parameters[self.trunk.row] += self.kappa * self.trunk.parameters
        return BodySegmentParameters.from_dynamic_parameters(bsp.segments, parameters.ravel())

    def upright(self, wrench: np.ndarray, by_static: np.ndarray | None = None) -> np.ndarray:
        """Ground reactions (d, 6) less the moment kappa y x F / mass; by_static (d, 6, s), their derivatives, become
        the result's.
        """
        moment = self._moment(wrench)
        if by_static is not None:
            by_static[:, 3] -= self._share * by_static[:, 2]
            by_static[:, 5] += self._share * by_static[:, 0]
            by_static[:, :, self.place] -= moment
        return wrench - self.kappa * moment

    def pulls(
        self, wrench: np.ndarray, by_ground: np.ndarray, by_bodies: np.ndarray, by_static: np.ndarray
    ) -> np.ndarray:
        """(d, 6) pulls on the ground reactions as they are, for those (d, 6) on what `upright` makes of them.

        The pull on kappa, through these and through the bodies' parameters (b, 10), goes to `by_static` (s,).
        """
        by_static[self.place] -= np.vdot(by_ground, self._moment(wrench))
        by_static[self.place] -= by_bodies[self.trunk.row] @ self.trunk.parameters
        result = by_ground.copy()
        result[:, 2] -= self._share * by_ground[:, 3]
        result[:, 0] += self._share * by_ground[:, 5]
        return result

    def add_by_parameters(self, by_static: np.ndarray, theta: np.ndarray) -> None:
        """Add derivatives of the root equations by kappa through the trunk's parameters to by_static (d, 6, s); they
        come from those by the trunk's unknowns, of `theta`, which stand first.
        """
        own = slice(10 * self.trunk.row, 10 * self.trunk.row + 10)
        by_unknowns = np.linalg.solve(dynamic_jacobian(theta[own])[0], self.trunk.parameters)
        by_static[:, :, self.place] += by_static[:, :, own] @ by_unknowns

    def _moment(self, wrench: np.ndarray) -> np.ndarray:
        """(d, 6) y x F / mass."""
        moment = np.zeros_like(wrench)
        moment[:, 3], moment[:, 5] = wrench[:, 2] / self.trunk.mass_kg, -wrench[:, 0] / self.trunk.mass_kg
        return moment
