"""Compiling, once on a machine: `kinertia warm-up`, and the first command that computes."""

from __future__ import annotations

from collections.abc import Callable

from kinertia.cli.options import Quiet
from kinertia.model.compiled import cache_folder, is_compiled, set_compiled

_STAGE = "compiling, once"
_MOTION_SHARE, _KINEMATICS_SHARE = 0.4, 0.6
"""Of the time, after which the synthetic walk and inverse kinematics are done."""


def warm_up(quiet: Quiet = False) -> None:
    """Compile beforehand what the first fit would compile.

    Kinertia's calculations are compiled once on a machine, which takes about
    half a minute. A command that computes does it when it must; an
    administrator can do it for all users of an installation that only he may
    write to, and a cluster before its jobs start.

    [bold]Example[/]

    kinertia warm-up
    """
    from kinertia.cli.terminal import out, shown_progress

    done = is_compiled()
    with shown_progress():
        pass
    out.print(f"{'compiled already' if done else 'compiled'}: {cache_folder()}", soft_wrap=True)


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
