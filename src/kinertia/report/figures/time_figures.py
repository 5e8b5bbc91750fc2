"""Draws figures over time: root residuals, coordinates and joint moments of a trial.

Frames that were not used are shaded; vertical lines are gait events, solid at foot contact, dashed at foot off.

Where the moments of a side are not known, the panel is shaded in its colour; the page states the reasons.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from kinertia.estimation.result.leg_moments import full_bandwidth
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.model.skeleton import Skeleton
from kinertia.motion.joint_moments import component_names, joint_and_side
from kinertia.motion.kinematics import Kinematics
from kinertia.report.figures.coordinate_titles import Coordinate, load_title, panels_of, signed_joint_moment
from kinertia.report.figures.figure import (
    BLACK,
    SIDES,
    STAGES,
    UNUSED,
    Figure,
    Panel,
    compact,
    faded,
    shaded,
    small_multiples,
)
from kinertia.report.wording import INTERVAL_SD, LITERATURE, Start
from kinertia.settings import SignConvention
from kinertia.trial.file_contents import GaitEvent
from kinertia.trial.sampled_data import rms, rms_length, runs
from kinertia.trial.stances import gait_events

MOST_FRAMES = 1200
"""Largest number of frames drawn per curve."""
BAND_EVERY = 2
"""Every how many of these frames a band's edges are drawn: they change more slowly than the curves."""
MOST_EVENTS = 40
"""Gait events in the frames shown up to which they are drawn; more would hide the curves."""
_AROUND = 0.2
"""Share of the window that is shown before and after it."""
_AXES = ("forward", "upward", "to the right")
_FAINT = 0.1
_ROOT_COORDINATES = 6


def residual_figure(trial: TrialFit, most_frames: int = MOST_FRAMES, start: Start = LITERATURE) -> Figure:
    """Draw the residual force (N) and moment (N m) at the pelvis, stage by stage, with forces at the bandwidth of the
    motion, and for the estimate also at full bandwidth.
    """
    thin, axis = thinned(len(trial.time), most_frames), time_axis(trial.kinematics)
    marks = [*_unused(trial.kinematics, axis), *event_lines(shown_events(trial.kinematics))]
    stages = {
        stage_name(stage, start, _hz(trial, stage)): (STAGES[stage], values)
        for stage, values in trial.residuals.items()
    }
    full = f"estimate, {full_bandwidth(trial.reactions)}"
    # the first is drawn below the others
    stages = {full: (STAGES["estimate_full"], trial.full_residuals["estimate"]), **stages}
    panels = []
    for k in range(6):
        kind = "Force" if k < 3 else "Moment"
        traces = [
            {**_curve(trial.time, values[:, k], thin), "name": name, "line": line}
            for name, (line, values) in stages.items()
        ]
        title = f"{kind} {_AXES[k % 3]} (N)" if k < 3 else f"Moment about {_MOMENT_AXES[k - 3]} (N m)"
        panels.append(Panel(title, traces, marks))
    listed = "; ".join(
        f"{name} {rms_length(values[:, :3]):.1f} N and {rms_length(values[:, 3:]):.1f} N m"
        for name, (_, values) in stages.items()
    )
    alt = f"Residual force and moment at the pelvis of {trial.name} over time, RMS: {listed}."
    return small_multiples(panels, alt, axis)


_MOMENT_AXES = ("forward axis", "vertical", "right axis")


def stage_name(stage: str, start: Start, hz: float | None = None) -> str:
    """Describe a stage of `TrialFit.residuals` or `.joint_loads` in words, with the bandwidth if given."""
    name = {"literature": start.values, "corrected": f"{start.values}, pelvis corrected"}.get(stage, stage)
    return name if hz is None else f"{name} ({hz:.3g} Hz)"


def bandwidths(trial: TrialFit) -> str:
    """Describe the bandwidths of the motion before and after the estimate."""
    before, after = (f"{_hz(trial, stage):.3g}" for stage in ("literature", "estimate"))
    return f"{after} Hz" if before == after else f"{before} Hz, estimate {after} Hz"


def _hz(trial: TrialFit, stage: str) -> float:
    return trial.motion_hz if stage == "estimate" else trial.kinematics.cutoff_hz


def coordinate_figure(trial: TrialFit, skeleton: Skeleton, most_frames: int = MOST_FRAMES) -> Figure:
    """Draw every coordinate (degrees, m) by inverse kinematics frame by frame, and as estimated with its 95 % band."""
    ik, axis = trial.kinematics.ik, time_axis(trial.kinematics)
    unused, events = _unused(trial.kinematics, axis), shown_events(trial.kinematics)
    shown = (ik.time >= axis["range"][0]) & (ik.time <= axis["range"][1])
    stages = (
        ("inverse kinematics", ik.time[shown], ik.q[shown], {"dash": "dot", "width": 1.6}),
        ("estimate", trial.time, trial.motion.q, {"width": 2}),
    )
    sd = None if trial.deviations is None else trial.deviations.coordinates
    panels = []
    for coordinate in panels_of(skeleton):
        scale = np.degrees(1.0) if coordinate.rotational else 1.0
        thin = thinned(len(trial.time), most_frames)
        traces = [] if sd is None else bands(coordinate, trial.time, scale * trial.motion.q, scale * sd, thin)
        for name, time, values, line in stages:
            thin = thinned(len(time), most_frames)
            traces += lines_by_side(coordinate, name, time, scale * values, thin, line)
        unit = "degrees" if coordinate.rotational else "m"
        panels.append(Panel(f"{coordinate.title} ({unit})", traces, [*unused, *event_lines(events, coordinate)]))
    change = np.degrees(trial.motion_change[:, skeleton.rotational])
    alt = (
        f"Coordinates of {trial.name} over time, inverse kinematics against estimate; the joint angles differ by "
        f"{rms(change):.1f} degrees RMS."
    )
    return small_multiples(panels, alt, axis)


def panel_over_time(
    trial: TrialFit,
    coordinate: Coordinate,
    lines: Mapping[str, tuple[np.ndarray, dict[str, Any]]],
    band: tuple[np.ndarray, np.ndarray],
    most_frames: int = MOST_FRAMES,
) -> Panel:
    """Draw curves of both sides over time, with a 95 % band where there are SDs.

    Args:
        trial: trial of the frames.
        coordinate: title, and the column of each side.
        lines: values (w, c) and style of the line by name.
        band: values and SDs (w, c).
        most_frames: largest number of frames drawn per curve.
    """
    axis, thin = time_axis(trial.kinematics), thinned(len(trial.time), most_frames)
    traces = bands(coordinate, trial.time, *band, thin) if np.isfinite(band[1]).any() else []
    for name, (values, line) in lines.items():
        traces += lines_by_side(coordinate, name, trial.time, values, thin, line)
    marks = [*_unused(trial.kinematics, axis), *event_lines(shown_events(trial.kinematics), coordinate)]
    return Panel(coordinate.title, traces, marks)


def bands(
    coordinate: Coordinate, time: np.ndarray, values: np.ndarray, sd: np.ndarray, thin: slice
) -> list[dict[str, Any]]:
    """Draw a 95 % band around values (w, c) per side: an invisible lower edge, and an upper one filled down to it."""
    traces, thin = [], slice(None, None, BAND_EVERY * thin.step)
    for side, column in coordinate.columns.items():
        word, colour = SIDES[side]
        middle, half = values[:, column], INTERVAL_SD * sd[:, column]
        edge = {"line": {"width": 0}, "hoverinfo": "skip", "hovertemplate": None}
        name = f"{word} 95 % band".strip()
        fill = {"fill": "tonexty", "fillcolor": faded(colour, 0.18), "name": name, "showlegend": False}
        lower = {"name": f"{name}, lower edge", "showlegend": False}
        traces.append({**_curve(time, middle - half, thin), **edge, **lower})
        traces.append({**_curve(time, middle + half, thin), **edge, **fill})
    return traces


def lines_by_side(
    coordinate: Coordinate, name: str, time: np.ndarray, values: np.ndarray, thin: slice, line: dict[str, Any]
) -> list[dict[str, Any]]:
    """Draw a line per side, with its colour and a name that begins with the side; the legend explains sides only."""
    return [
        {
            **_curve(time, values[:, column], thin),
            "name": ", ".join(filter(None, (SIDES[side][0], name))),
            "line": {"color": SIDES[side][1], **line},
            "showlegend": bool(side),
        }
        for side, column in coordinate.columns.items()
    ]


def _curve(time: np.ndarray, values: np.ndarray, thin: slice) -> dict[str, Any]:
    """Draw a line over frames, which breaks at gaps; times of a single window need not be written where uniform."""
    shown, y = time[thin], values[thin]
    step = float(np.median(np.diff(shown))) if len(shown) > 1 else 1.0
    gaps = np.flatnonzero(np.diff(shown) > 1.5 * step) + 1
    x: dict[str, Any] = {"x0": round(float(shown[0]), 6), "dx": round(step, 9)}
    if gaps.size:
        x = {"x": np.insert(shown, gaps, shown[gaps - 1]).round(6).tolist()}
        y = np.insert(y.astype(float), gaps, np.nan)
    return {
        "type": "scatter",
        "mode": "lines",
        **x,
        "y": compact(y),
        "hovertemplate": "%{x:.3f} s: %{y:.3g}<extra>%{fullData.name}</extra>",
    }


def thinned(frames: int, most: int) -> slice:
    """Return the frames that are drawn: all, or every so many that at most `most` remain."""
    return slice(None, None, -(-frames // most))


def time_axis(kinematics: Kinematics, span_s: tuple[float, float] | None = None) -> dict[str, Any]:
    """Return the settings of the time axis: all windows, or this span (s), with a small margin."""
    start, end = span_s or kinematics.window_s
    around = _AROUND * (end - start)
    time = kinematics.trial.markers.time
    limits = [max(start - around, float(time[0])), min(end + around, float(time[-1]))]
    title = {"text": "time (s)", "font": {"size": 11}, "standoff": 2}
    return {"range": limits, "title": title, "nticks": 6}


def _unused(kinematics: Kinematics, axis: dict[str, Any]) -> list[dict[str, Any]]:
    """Shade times outside the windows."""
    starts, ends = zip(*kinematics.windows_s, strict=True)
    spans = zip((axis["range"][0], *ends), (*starts, axis["range"][1]), strict=True)
    return [shaded(first, last, UNUSED) for first, last in spans if last - first > 1e-6]


def shown_events(kinematics: Kinematics, axis: Mapping[str, Any] | None = None) -> list[GaitEvent]:
    """Return the events in the frames shown, by default those of `time_axis`; none where there are too many."""
    first, last = (axis or time_axis(kinematics))["range"]
    shown = [event for event in gait_events(kinematics.trial) if first <= event.time_s <= last]
    return shown if len(shown) <= MOST_EVENTS else []


def event_lines(events: Sequence[GaitEvent], coordinate: Coordinate | None = None) -> list[dict[str, Any]]:
    """Draw lines at the events of the sides that the coordinate is on; at all events where it is on none."""
    sides = [] if coordinate is None else [side for side in coordinate.columns if side]
    return [_vertical_line(event) for event in events if not sides or event.side in sides]


def _vertical_line(event: GaitEvent) -> dict[str, Any]:
    dash = "solid" if event.kind == "heel strike" else "dash"
    line = {"color": faded(SIDES[event.side][1], 0.6), "width": 1, "dash": dash}
    return {"type": "line", "x0": event.time_s, "x1": event.time_s, "y0": 0, "y1": 1, "yref": "domain", "line": line}


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

    def drawn(self, axis: dict[str, Any], coordinate: Coordinate) -> list[dict[str, Any]]:
        """Shade the parts of the axis in which the estimate of a side is not known."""
        first, last = axis["range"]
        result = []
        for side, column in coordinate.columns.items():
            colour = UNUSED if side not in SIDES or not side else faded(SIDES[side][1], _FAINT)
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
    for coordinate in panels_of(skeleton):
        if min(coordinate.columns.values()) < _ROOT_COORDINATES:
            continue
        traces = [] if sd is None else bands(coordinate, loads.time, middle, sd, thin)
        for stage, line in (("literature", {"dash": "dot", "width": 1.6}), ("estimate", {"width": 2})):
            values = loads.stages[stage] / mass_kg
            traces += lines_by_side(coordinate, stage_name(stage, start), loads.time, values, thin, line)
        if truth is not None:
            dashed = {"color": BLACK, "dash": "dash", "width": 1.4}
            rows = thinned(len(trial.time), most_frames)
            traces += [
                {**curve, "name": "truth"}
                for curve in lines_by_side(coordinate, "truth", trial.time, truth / mass_kg, rows, dashed)
            ]
        title = (
            f"{load_title(coordinate, 'moment')} (N m/kg)"
            if coordinate.rotational
            else f"{load_title(coordinate, 'force')} (N/kg)"
        )
        panels.append(Panel(title, traces, [*loads.drawn(axis, coordinate), *event_lines(events, coordinate)]))
    peak = np.nanmax(np.abs(middle[:, _ROOT_COORDINATES:]), initial=0.0)
    alt = f"Joint moments of {trial.name} over time, {start.word} against estimate; the largest is {peak:.2f} N m/kg."
    return small_multiples(panels, alt, axis)


def joint_moment_figure(
    trial: TrialFit, mass_kg: float, convention: SignConvention, most_frames: int = MOST_FRAMES
) -> Figure | None:
    """Draw three-dimensional joint moments of the legs (N m/kg) as estimated, with the 95 % band; None without any."""
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
        if not side:
            continue
        for component, name in enumerate(component_names(base)):
            columns.setdefault(name, {})[side] = 3 * row + component
    panels = []
    for name, column in columns.items():
        title, sign = signed_joint_moment(name, trial.skeleton, convention)
        coordinate = Coordinate(name, f"{title} (internal N m/kg)", column, True)
        values = sign * loads.stages["estimate"]
        traces = [] if sd is None else bands(coordinate, loads.time, values, sd / mass_kg, thin)
        traces += lines_by_side(coordinate, "estimate", loads.time, values, thin, {"width": 2})
        panels.append(
            Panel(coordinate.title, traces, [*loads.drawn(axis, coordinate), *event_lines(events, coordinate)])
        )
    alt = f"Three-dimensional joint moments of {trial.name} over time, wherever they are known."
    return small_multiples(panels, alt, axis)


def _axis(trial: TrialFit) -> dict[str, Any]:
    """Return the time axis of all frames in which any moment is known."""
    curves = trial.joint_curves
    known = np.zeros(0) if curves is None else curves.time[np.logical_or.reduce(curves.known, axis=1)]
    return time_axis(trial.kinematics, (float(known[0]), float(known[-1])) if len(known) else None)
