"""Adds body segment parameters to the estimate: their unknowns, and their cost against the literature and the scale."""

from typing import Any

import numpy as np
from scipy.linalg import block_diag

from kinertia.estimation.simultaneous.inputs import BSP, FreedModel, Given
from kinertia.estimation.simultaneous.layout import Unknowns
from kinertia.estimation.simultaneous.linear_algebra.static_information import LEAST_INFORMATION
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm, Solution
from kinertia.model.log_cholesky import nearest_consistent, table_jacobian, to_log_cholesky


class BodySegments(CostTerm):
    """Ten log-Cholesky parameters of every segment, which are physically consistent for any values."""

    @classmethod
    def unknowns(cls, given: Given) -> tuple[Unknowns, ...]:
        """Return the parameters of all segments; the prior applies to their table."""
        start = to_log_cholesky(nearest_consistent(given.prior.mean))
        return (Unknowns(name=BSP, unit="log-Cholesky of kg, m", start=start, prior=None),)

    def __init__(self, model: FreedModel) -> None:
        super().__init__(model)
        self._at = self.layout[BSP]
        self._information = np.linalg.inv(self.given.prior.covariance)

    @property
    def _logs(self) -> np.ndarray:
        """Indices of unknowns that are logarithms: per segment its mass, and three square roots of second moments."""
        every = np.arange(self._at.start, self._at.stop).reshape(-1, 10)
        return every[:, [0, 4, 5, 6]].ravel()

    def add_information(self, into: np.ndarray, static: np.ndarray) -> None:
        """Add the information of the table's prior and of the total mass by the scale."""
        prior, theta = self.given.prior, self._at
        jacobian = block_diag(*table_jacobian(static[theta]))
        mass_row = prior.on_scale @ jacobian[0::10] / prior.mass_sd_kg
        into[theta, theta] += jacobian.T @ self._information @ jacobian + np.outer(mass_row, mass_row)
        into[theta, theta] += LEAST_INFORMATION * np.eye(theta.stop - theta.start)

    def add_pull(self, rhs: np.ndarray, static: np.ndarray) -> float:
        """Add the right-hand side of the table's prior and of the scale's total mass; return their sum of squares."""
        prior, theta = self.given.prior, self._at
        bsp, by_own = self.model.bsp(static), table_jacobian(static[theta])
        gap = (bsp.table() - prior.mean.table()).ravel()
        mass_gap = (float(prior.on_scale @ bsp.mass_kg) - prior.mass_kg) / prior.mass_sd_kg
        pulls = (self._information @ gap).reshape(-1, 10)
        pulls[:, 0] += mass_gap / prior.mass_sd_kg * prior.on_scale
        rhs[theta] -= np.einsum("bi,bij->bj", pulls, by_own).ravel()
        return float(gap @ self._information @ gap) + mass_gap**2

    def shorten(self, step: np.ndarray) -> None:
        """Limit the change of every logarithm to one."""
        step[self._logs] = np.clip(step[self._logs], -1.0, 1.0)

    def add_bends(self, into: np.ndarray, rhs: np.ndarray) -> None:
        """Add second derivatives by logarithms that Gauss-Newton leaves out, where the cost falls with the logarithm.

        The data may favour a mass or a second moment below zero. Towards zero the first derivatives vanish, and with
        them the curvature that limits a Gauss-Newton step: it would again and again predict a large gain and achieve
        none. A cost F of exp(x) has the second derivative F'' exp(2 x) + F' exp(x), and the last term is the slope by
        x; by the logarithm of a square root it is twice the slope.
        """
        slope = -rhs[self._logs].reshape(-1, 4)
        into[self._logs] += (np.maximum(slope, 0.0) * [1.0, 2.0, 2.0, 2.0]).ravel()

    def read(self, solution: Solution) -> dict[str, Any]:
        """Return physically consistent parameters, and the covariance of their table, at most the prior's."""
        chain = block_diag(*table_jacobian(solution.there[self._at]))
        covariance = chain @ solution.covariance[self._at, self._at] @ chain.T
        return {
            "bsp": self.model.bsp(solution.static),
            "bsp_covariance": _at_most(covariance, self.given.prior.covariance),
        }


def _at_most(covariance: np.ndarray, prior: np.ndarray) -> np.ndarray:
    """Limit the covariance so that no combination is more uncertain than in the prior: data never add uncertainty."""
    root = np.linalg.cholesky(prior)
    left = np.linalg.solve(root, np.linalg.solve(root, covariance).T)
    shares, along = np.linalg.eigh(0.5 * (left + left.T))
    along = root @ along
    result: np.ndarray = (along * np.minimum(shares, 1.0)) @ along.T
    return result
