"""Compiles the numerical core once per machine, before the first command that computes."""

import gc
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from kinertia.cohort.process import PYTHON
from kinertia.model.compiled import is_compiled, set_compiled

_STAGE = "compiling, once"
_POSE_SHARE, _MOTION_SHARE, _KINEMATICS_SHARE, _DYNAMICS_SHARE = 0.15, 0.4, 0.5, 0.8
"""Shares of the time after which pose, synthetic walk, inverse kinematics and all before the estimate are done."""


def compile_once(progress: Callable[[str, float], None]) -> None:
    """Compile everything not yet compiled on this machine, by running it on a short synthetic walk."""
    if is_compiled():
        return
    progress(_STAGE, 0.0)
    with _without_looking_for_garbage(), _markers_beside():
        import numpy as np

        from kinertia.estimation.prior import literature_prior
        from kinertia.estimation.simultaneous.fit import fit_simultaneous
        from kinertia.motion.dynamics import axis_motion, consistent_root_acceleration, residual_terms, root_regressor
        from kinertia.motion.kinematics import solve_kinematics
        from kinertia.motion.rigid_body import axis_force_derivatives
        from kinertia.synthetic.walk import walk, walking_subject
        from kinertia.trial.data import FootLoads, Trial

        subject = walking_subject()
        subject.skeleton.pose(np.zeros((1, len(subject.skeleton.coordinates))))
        progress(_STAGE, _POSE_SHARE)
        short = walk(subject, 0.8)
        progress(_STAGE, _MOTION_SHARE)
        feet = FootLoads(short.time, short.foot_loads[..., :3], short.foot_loads[..., 3:])
        measured = Trial("walk", short.markers, feet, short.foot_loads[:, 0, 1] > -1.0)
        kinematics = solve_kinematics(short.skeleton, measured, 0.0, 10.0)
        progress(_STAGE, _KINEMATICS_SHARE)
        skeleton, bsp, motion = short.skeleton, short.bsp, short.motion
        for balance in (residual_terms, consistent_root_acceleration):
            balance(skeleton, bsp, motion, short.foot_loads.sum(axis=1))
        root_regressor(skeleton, bsp.segments, motion)
        state = axis_motion(skeleton, motion)
        every = np.ones(len(skeleton.tree.parent), dtype=bool)
        axis_force_derivatives(skeleton.tree, skeleton.gravity_m_s2, skeleton.bodies(bsp), *state, every)
        progress(_STAGE, _DYNAMICS_SHARE)
    with _without_looking_for_garbage():
        fit_simultaneous(short.skeleton, literature_prior(subject.literature), [kinematics])
    progress(_STAGE, 1.0)
    set_compiled()


@contextmanager
def _without_looking_for_garbage() -> Iterator[None]:
    """Disable garbage collection: compiling makes millions of lasting objects, whose scanning takes a tenth of it."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


@contextmanager
def _markers_beside() -> Iterator[None]:
    """Run `compile_markers` in a separate process, until the end of the block at the earliest; what it leaves undone,
    as where no process can be started, the estimate compiles itself.
    """
    command = [*PYTHON, "-c", f"from {__name__} import compile_markers; compile_markers()"]
    try:
        beside = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    except OSError:
        yield
        return
    try:
        yield
        beside.wait()
    finally:
        beside.kill()
        beside.wait()


def compile_markers() -> None:
    """Compile the marker terms on a body at rest; they take as long as everything before the estimate."""
    import numpy as np

    from kinertia.estimation.simultaneous.frame_blocks import TimeBlock
    from kinertia.estimation.simultaneous.marker_errors import ErrorProcess
    from kinertia.estimation.simultaneous.marker_terms import add_markers
    from kinertia.estimation.simultaneous.motion_basis import MotionBasis
    from kinertia.estimation.simultaneous.normal_equations import Gradient, NormalEquations
    from kinertia.estimation.simultaneous.skin import SkinPatterns
    from kinertia.estimation.simultaneous.visible_markers import seen_markers
    from kinertia.synthetic.walk import walking_subject

    gc.disable()
    skeleton = walking_subject().skeleton
    coordinates, markers = len(skeleton.coordinates), len(skeleton.markers)
    basis = MotionBasis(0.01 * np.arange(20), 0.05)
    frames, time_block = len(basis.first), TimeBlock.whole(basis)
    # the body's parameters stand before the unknowns of the markers
    columns = slice(10, 10 + 3 * markers)
    seen = seen_markers(
        skeleton,
        np.zeros((frames, markers, 3)),
        np.zeros((frames, coordinates)),
        (np.ones(markers), ErrorProcess.double_over(3.0)),
        (SkinPatterns.none(frames, markers), np.zeros(0)),
        np.arange(coordinates),
        np.arange(0),
    )
    for kind in (Gradient, NormalEquations):
        add_markers(kind.zero(time_block.size, coordinates, columns.stop), columns, basis, time_block, seen, 0)
