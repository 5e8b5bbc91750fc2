"""Adds the root equations: the residual between ground reactions and the body's motion."""

import numpy as np

from kinertia.estimation.simultaneous.inputs import BSP, FreedModel
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import Gradient, NormalEquations
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm, InTrial
from kinertia.estimation.simultaneous.terms.root_terms import RootFrames, add_root, columns_of
from kinertia.motion.dynamics import Motion
from kinertia.motion.workload import pieces


class RootLoads(CostTerm):
    """The root equations at the dynamic frames of all trials; they add no unknowns, and depend on other terms'."""

    def __init__(self, model: FreedModel) -> None:
        super().__init__(model)
        given = self.given
        self._columns = columns_of(given.free, model.segments, given.moving, given.still, self.layout)

    def add(self, into: Gradient, here: InTrial) -> None:
        """Add the squares of the residuals, each over its standard deviation."""
        basis, frames, start = self.given.bases[here.k], here.time_block.frames, here.time_block.splines.start
        dynamic = frames.start + np.flatnonzero(self.given.trials[here.k].dynamic[frames])
        for piece in pieces(len(dynamic)):
            root = self._at(here, dynamic[piece])
            if not isinstance(into, NormalEquations):
                root.add_gradient(into, self._columns, basis, start)
            elif into.bordered:
                add_root(into, self.layout.in_root, basis, start, root.terms(self._columns))
            else:
                add_root(into, slice(0, 0), basis, start, root.of_motion.terms(self._columns.of_motion))

    def _at(self, here: InTrial, frames: np.ndarray) -> RootFrames:
        """Return the equations at some frames, with the changes by other terms."""
        k, static = here.k, here.static
        motion = self.model.full(self.given.bases[k].evaluate(here.coefficients, frames), static)
        wrench, by_errors = here.loads.root(k, static, frames)
        root = RootFrames(
            skeleton=self.given.free,
            bsp=self.model.bsp(static),
            theta=static[self.layout[BSP]],
            motion=Motion(*motion),
            wrench=wrench,
            by_errors=by_errors,
            by_single=here.loads.on_feet(k, static, 1, frames).sum(axis=1)[..., None],
            at=(here.loads.delay_unknowns(k),),
            sd=self.given.trials[k].root_sd(frames),
            frames=frames,
            static=self.layout.in_root.stop,
        )
        for term in here.terms:
            root = term.in_root(root, k, static)
        return root
