"""Compiling, once on a machine, before the first command that computes."""

from __future__ import annotations

from collections.abc import Callable

from kinertia.model.compiled import is_compiled, set_compiled

_STAGE = "compiling, once"
_MOTION_SHARE, _KINEMATICS_SHARE = 0.25, 0.35
"""Of the time, after which the synthetic walk and inverse kinematics are done."""


def compile_once(progress: Callable[[str, float], None]) -> None:
    """Compile all that has not been compiled on this machine, by running it on a short synthetic walk."""
    if is_compiled():
        return
    progress(_STAGE, 0.0)
    from kinertia.estimation.prior import literature_prior
    from kinertia.estimation.simultaneous.fit import fit_simultaneous
    from kinertia.motion.kinematics import solve_kinematics
    from kinertia.synthetic.walk import walk, walking_subject
    from kinertia.trial.data import FootLoads, Trial

    subject = walking_subject()
    short = walk(subject, 0.8)
    progress(_STAGE, _MOTION_SHARE)
    feet = FootLoads(short.time, short.foot_loads[..., :3], short.foot_loads[..., 3:])
    measured = Trial("walk", short.markers, feet, short.foot_loads[:, 0, 1] > -1.0)
    kinematics = solve_kinematics(short.skeleton, measured, 0.0, 10.0)
    progress(_STAGE, _KINEMATICS_SHARE)
    fit_simultaneous(short.skeleton, literature_prior(subject.literature), [kinematics])
    progress(_STAGE, 1.0)
    set_compiled()
