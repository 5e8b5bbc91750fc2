"""Draws joint moments of a trial over time, as far as they are known: of coordinates, and in three dimensions.

Where the moments of a side are not known, the panel is shaded in its colour; the page states the reasons.
"""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from kinertia.estimation.trial_fit import TrialFit
from kinertia.model.skeleton import Skeleton
from kinertia.motion.joint_moments import component_names, joint_and_side
from kinertia.report import style
from kinertia.report.coordinate_titles import Coordinate, joint_moment_title, load_title, panels_of
from kinertia.report.figure import Figure
from kinertia.report.panels import Panel, shaded, small_multiples
from kinertia.report.time_figures import (
    MOST_FRAMES,
    bands,
    event_lines,
    lines_by_side,
    shown_events,
    stage_name,
    thinned,
    time_axis,
)
from kinertia.report.wording import LITERATURE, Start
from kinertia.trial.sampled_time import runs

_FAINT = 0.1
_ROOT_COORDINATES = 6


@dataclass(frozen=True, eq=False)
class _Loads:
    """Loads (f, r) per stage at f times, with the estimate's standard deviations, where there are any."""

    time: np.ndarray
    stages: dict[str, np.ndarray]
    sd: np.ndarray | None

    @classmethod
    def of(cls, trial: TrialFit) -> Self:
        """Take the loads of the coordinates wherever they are known; of results without these, in the windows."""
        curves = trial.joint_curves
        if curves is None:
            return cls(
                trial.time, dict(trial.joint_loads), None if trial.deviations is None else trial.deviations.moments
            )
        return cls(curves.time, dict(curves.forces), None if curves.deviations is None else curves.deviations.moments)

    def drawn(self, axis: dict[str, Any], one: Coordinate) -> list[dict[str, Any]]:
        """Shade the parts of the axis in which the estimate of a side is not known."""
        first, last = axis["range"]
        result = []
        for side, column in one.columns.items():
            colour = style.UNUSED if side not in style.SIDES or not side else style.faded(style.SIDES[side][1], _FAINT)
            known = np.isfinite(self.stages["estimate"][:, column])
            ends = [first, *(t for a, b in runs(known) for t in (self.time[a], self.time[b])), last]
            gaps = zip(ends[::2], ends[1::2], strict=True)
            step = float(np.median(np.diff(self.time))) if len(self.time) > 1 else 0.0
            result += [shaded(float(a), float(b), colour) for a, b in gaps if b - a > 1.5 * step]
        return result


def moment_figure(
    trial: TrialFit,
    skeleton: Skeleton,
    mass_kg: float,
    most_frames: int = MOST_FRAMES,
    start: Start = LITERATURE,
    truth: np.ndarray | None = None,
) -> Figure:
    """Draw moments of coordinates (N m/kg) as before, on the measured motion, and as estimated, with the 95 % band.

    `truth` (w, c) N m: of a synthetic person in the measured windows, dashed.
    """
    loads, axis = _Loads.of(trial), _axis(trial)
    thin, events = thinned(len(loads.time), most_frames), shown_events(trial.kinematics, axis)
    sd, middle = None if loads.sd is None else loads.sd / mass_kg, loads.stages["estimate"] / mass_kg
    panels = []
    for one in panels_of(skeleton):
        if min(one.columns.values()) < _ROOT_COORDINATES:
            continue
        traces = [] if sd is None else bands(one, loads.time, middle, sd, thin)
        for stage, line in (("literature", {"dash": "dot", "width": 1.6}), ("estimate", {"width": 2})):
            values = loads.stages[stage] / mass_kg
            traces += lines_by_side(one, stage_name(stage, start), loads.time, values, thin, line)
        if truth is not None:
            dashed = {"color": style.BLACK, "dash": "dash", "width": 1.4}
            own = thinned(len(trial.time), most_frames)
            traces += [
                {**curve, "name": "truth"}
                for curve in lines_by_side(one, "truth", trial.time, truth / mass_kg, own, dashed)
            ]
        title = f"{load_title(one, 'moment')} (N m/kg)" if one.rotational else f"{load_title(one, 'force')} (N/kg)"
        panels.append(Panel(title, traces, [*loads.drawn(axis, one), *event_lines(events, one)]))
    peak = np.nanmax(np.abs(middle[:, _ROOT_COORDINATES:]), initial=0.0)
    alt = f"Joint moments of {trial.name} over time, {start.word} against estimate; the largest is {peak:.2f} N m/kg."
    return small_multiples(panels, alt, axis)


def joint_moment_figure(trial: TrialFit, mass_kg: float, most_frames: int = MOST_FRAMES) -> Figure | None:
    """Draw three-dimensional joint moments (N m/kg) as estimated, with the 95 % band; None without any."""
    curves = trial.joint_curves
    if curves is None or not np.isfinite(curves.joints["estimate"].moments).any():
        return None
    joints, count = curves.joints["estimate"], len(curves.time)
    sd = None if curves.moment_sd is None else curves.moment_sd.reshape(count, -1)
    loads = _Loads(curves.time, {"estimate": joints.moments.reshape(count, -1) / mass_kg}, sd)
    axis, thin = _axis(trial), thinned(count, most_frames)
    events = shown_events(trial.kinematics, axis)
    columns: dict[str, dict[str, int]] = {}
    for row, label in enumerate(joints.joints):
        base, side = joint_and_side(label)
        for component, name in enumerate(component_names(base)):
            columns.setdefault(name, {})[side] = 3 * row + component
    panels = []
    for name, own in columns.items():
        one = Coordinate(name, f"{joint_moment_title(name)} (N m/kg)", own, True)
        values = loads.stages["estimate"]
        traces = [] if sd is None else bands(one, loads.time, values, sd / mass_kg, thin)
        traces += lines_by_side(one, "estimate", loads.time, values, thin, {"width": 2})
        panels.append(Panel(one.title, traces, [*loads.drawn(axis, one), *event_lines(events, one)]))
    alt = f"Three-dimensional joint moments of {trial.name} over time, wherever they are known."
    return small_multiples(panels, alt, axis)


def _axis(trial: TrialFit) -> dict[str, Any]:
    """Return the time axis of all frames in which any moment is known."""
    curves = trial.joint_curves
    known = np.zeros(0) if curves is None else curves.time[np.logical_or.reduce(curves.known, axis=1)]
    return time_axis(trial.kinematics, (float(known[0]), float(known[-1])) if len(known) else None)
