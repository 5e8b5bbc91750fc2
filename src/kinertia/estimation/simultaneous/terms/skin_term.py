"""Adds skin motion that follows the joints: the coefficients of its patterns."""

import numpy as np

from kinertia.estimation.simultaneous.inputs import SKIN, FreedModel, Given
from kinertia.estimation.simultaneous.layout import Unknowns
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm


class Skin(CostTerm):
    """Coefficients of skin motion (`skin`), the same in all trials."""

    @classmethod
    def unknowns(cls, given: Given) -> tuple[Unknowns, ...]:
        """Return three unknowns per marker and pattern; those of a segment are correlated."""
        size = given.skin[0].size
        return (Unknowns(name=SKIN, unit="1", start=np.zeros(size), prior=None, seen_by="markers"),)

    def __init__(self, model: FreedModel) -> None:
        super().__init__(model)
        self._information = self.given.skin[0].information()

    def add_information(self, into: np.ndarray, static: np.ndarray) -> None:
        """Add the information of the coefficients' prior."""
        at = self.layout[SKIN]
        into[at, at] += self._information

    def add_pull(self, rhs: np.ndarray, static: np.ndarray) -> float:
        """Add the right-hand side of the coefficients' prior, and return its sum of squares."""
        own = static[self.layout[SKIN]]
        pull = self._information @ own
        rhs[self.layout[SKIN]] -= pull
        return float(own @ pull)
