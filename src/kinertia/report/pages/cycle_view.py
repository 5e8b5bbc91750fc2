"""Collects what the pages show of gait cycles: figures, measures and peaks of the strides per side, and scores."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from scipy.special import stdtrit

from kinertia.estimation.result.cycles import CycleCurve, peak_columns, spatiotemporal_columns
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.gait_scores import GaitProfile
from kinertia.estimation.result.mean_cycles import FEWEST_PEOPLE, fits_by_task
from kinertia.io.norms_file import Norm
from kinertia.motion.model_outputs import CLINICAL_ANGLES
from kinertia.motion.spatiotemporal import MEASURES
from kinertia.report.figures.coordinate_titles import convention_of
from kinertia.report.figures.cycle_figures import (
    Norms,
    PhaseFigures,
    cycle_figures,
    has_spread,
    other_powers,
    phase_figures,
)
from kinertia.report.figures.figure import SIDES, Figure, base_layout, written
from kinertia.report.wording import INTERVAL_SD
from kinertia.trial.data import FEET

_COVERED = 0.95
"""Share of people like the controls that is neither low nor high."""
_ROWS = (
    ("speed_m_s", "speed (m/s)", 2),
    ("cadence_steps_min", "cadence (steps/min)", 1),
    ("stride_length_m", "stride length (m)", 3),
    ("step_length_m", "step length (m)", 3),
    ("stride_time_s", "stride time (s)", 3),
    ("step_time_s", "step time (s)", 3),
    ("step_width_m", "step width (m)", 3),
    ("stance_percent", "stance (% of cycle)", 1),
    ("double_support_percent", "double support (% of cycle)", 1),
)


class CyclesView(NamedTuple):
    """What the templates show of stances and landings, of the main task's gait cycle, and of each other task's."""

    phases: list[dict[str, Any]]
    cycle: dict[str, Any] | None
    more_cycles: list[tuple[str, dict[str, Any] | None]]


def cycles_view(fit: Fit, norms: Norms, profiles: Mapping[str, GaitProfile]) -> CyclesView:
    """Collect everything that the templates show of gait cycles; `profiles` are scores by task."""
    phases = [_phase(figures) for figures in phase_figures(fit, legs=True)]
    cycles = [(task, _cycle(part, norms, profiles.get(task))) for task, part in fits_by_task(fit).items()]
    return CyclesView(phases, cycles[0][1] if cycles else None, cycles[1:])


def _cycle(fit: Fit, norms: Norms, scored: GaitProfile | None) -> dict[str, Any] | None:
    """Collect everything that the templates show of the gait cycle of one task; None where no stride shows anything."""
    figures = cycle_figures(fit, norms, legs=True)
    if not figures:
        return None
    powers = other_powers(fit)
    clinical, profile = figures.pop("clinical", None), None if scored is None else _profile(scored)
    names = {trial.name for trial in fit.trials if trial.joint_curves is not None}
    strides = [stride for trial in fit.trials for stride in trial.strides]
    return {
        "rows": stride_rows(fit, norms),
        "peaks": peak_rows([curve for curve in fit.curves["estimate"] if curve.trial in names]),
        "trials": [trial.name for trial in fit.trials],
        "norms": not set(MEASURES).issuperset(norms),
        "profile": profile,
        "map": None if profile is None else written(map_figure(profile)),
        "clinical": None if clinical is None or convention_of(fit) == "opensim" else written(clinical),
        "spread": has_spread(clinical or figures["angle"]),
        "longest": not has_spread(figures["moment"]),
        "without_strides": [SIDES[side][0] for side in FEET if all(stride.side != side for stride in strides)],
        "strides": len(strides),
        "on_plates": sum(stride.on_plates for stride in strides),
        "other_powers": None if powers is None else written(powers),
        **{kind: written(figure) for kind, figure in figures.items()},
    }


def _phase(figures: PhaseFigures) -> dict[str, Any]:
    """Collect everything that the templates show of the stances or landings of one task."""
    shown = dict.fromkeys((curve.trial, curve.stride) for curve in figures.curves)
    return {
        "id": f"{figures.phase}-{figures.task}",
        "phase": figures.phase,
        "task": figures.task,
        "trials": list(dict.fromkeys(trial for trial, _ in shown)),
        "count": len(shown),
        "peaks": peak_rows(figures.curves) if figures.phase == "landing" else [],
        **{kind: written(figure) for kind, figure in figures.figures.items()},
    }


class MeasureRow(NamedTuple):
    """One measure in words, with mean and standard deviation per side and of the controls.

    Attributes:
        measure: its name with the unit.
        right, left: as text.
        controls: mean and SD of the norms; empty without.
        verdicts: of right and left: "low" or "high" against the controls, else empty.
    """

    measure: str
    right: str
    left: str
    controls: str = ""
    verdicts: tuple[str, ...] = ("", "")


def stride_rows(fit: Fit, norms: Norms = MappingProxyType({})) -> list[MeasureRow]:
    """Return the table's rows; none where no trial has a stride."""
    columns = spatiotemporal_columns(fit.trials)
    if not columns["side"]:
        return []
    sides = np.array(columns["side"])
    right, left = (str(int((sides == side).sum())) for side in FEET)
    rows = [MeasureRow("strides", right, left)]
    for name, title, digits in _ROWS:
        by_side = [np.array(columns[name])[sides == side] for side in FEET]
        right, left = (_mean_and_sd(values, digits) for values in by_side)
        if norm := norms.get(name):
            controls = f"{norm.mean[0]:.{digits}f} ± {norm.sd[0]:.{digits}f}"
            rows.append(MeasureRow(title, right, left, controls, tuple(_against(norm, values) for values in by_side)))
        else:
            rows.append(MeasureRow(title, right, left))
    return rows


def _against(norm: Norm, values: np.ndarray) -> str:
    """Return whether the mean is "low" or "high": outside the range of 95 % of people like the controls.

    >>> _against(Norm(np.zeros(1), np.array([1.3]), np.array([0.1]), people=20), np.array([1.08, np.nan]))
    'low'
    """
    known = values[np.isfinite(values)]
    if not len(known) or not norm.sd[0] > 0.0 or (norm.people or FEWEST_PEOPLE) < FEWEST_PEOPLE:
        return ""
    people = np.inf if norm.people is None else norm.people
    sds = stdtrit(people - 1.0, 0.5 + 0.5 * _COVERED) * np.sqrt(1.0 + 1.0 / people)
    away = (known.mean() - norm.mean[0]) / norm.sd[0]
    return "" if abs(away) <= sds else "low" if away < 0.0 else "high"


def peak_rows(curves: Sequence[CycleCurve]) -> list[MeasureRow]:
    """Return the table's rows of peaks and impulses: mean over the strides that contain them ± its 95 % interval.

    The errors of the strides of a trial are mostly equal, so that their mean is taken to be as uncertain as each.
    """
    columns = peak_columns(curves)
    values, sds = (np.array(columns[name], dtype=float) for name in ("value", "sd"))
    rows = []
    for peak, unit in dict.fromkeys(zip(columns["peak"], columns["unit"], strict=True)):
        of_peak = np.array(columns["peak"]) == peak
        sides = [of_peak & (np.array(columns["side"]) == side) for side in FEET]
        right, left = (_with_interval(values[some], sds[some]) for some in sides)
        rows.append(MeasureRow(f"{peak} ({unit})", right, left))
    return rows


def _with_interval(values: np.ndarray, sd: np.ndarray) -> str:
    known = np.isfinite(values)
    if not known.any():
        return "–"
    bar = INTERVAL_SD * float(np.sqrt(np.mean(np.square(sd[known]))))
    return f"{values[known].mean():.2f}" + (f" ± {bar:.2f}" if np.isfinite(bar) else "")


def _mean_and_sd(values: np.ndarray, digits: int) -> str:
    """Format the mean, with the standard deviation if there are several values."""
    known = values[np.isfinite(values)]
    if not len(known):
        return "–"
    if len(known) == 1:
        return f"{known[0]:.{digits}f}"
    return f"{known.mean():.{digits}f} ± {known.std(ddof=1):.{digits}f}"


class ScoreRow(NamedTuple):
    """One variable in words, with its score per side, degrees."""

    variable: str
    right: str
    left: str


@dataclass(frozen=True)
class ProfileView:
    """Gait profile scores in words.

    Attributes:
        rows: the nine variables, then the score of each side.
        overall: score of the person, degrees.
        norm_people: number of people in the norms, if the file states it.
        remarks: sentences on differences between the norms' people and this person.
    """

    rows: tuple[ScoreRow, ...]
    overall: str
    norm_people: int | None
    remarks: tuple[str, ...]


def _profile(profile: GaitProfile) -> ProfileView:
    """Format the scores."""
    rows = [
        ScoreRow(title.title, *(_degrees(profile.gvs_deg[quantity, side]) for side in FEET))
        for quantity, title in CLINICAL_ANGLES.items()
    ]
    rows.append(ScoreRow("Gait Profile Score", *(_degrees(profile.gps_deg[side]) for side in FEET)))
    return ProfileView(tuple(rows), _degrees(profile.overall_deg), profile.norm_people, profile.remarks)


def map_figure(view: ProfileView) -> Figure:
    """Draw the Movement Analysis Profile: a bar per variable and side, the Gait Profile Score last."""
    traces = [
        {
            "type": "bar",
            "orientation": "h",
            "x": [_number(getattr(row, side)) for row in view.rows],
            "y": list(range(len(view.rows))),
            "name": side,
            "marker": {"color": SIDES[side[0]][1]},
            "hovertemplate": "%{x:.1f} degrees<extra>%{fullData.name}</extra>",
        }
        for side in ("right", "left")
    ]
    layout = base_layout("Movement Analysis Profile: Gait Variable Score of each angle, and Gait Profile Score.")
    layout |= {
        "height": 60 + 19 * len(view.rows),
        "margin": {"t": 30, "b": 40, "l": 130, "r": 14},
        "barmode": "group",
        "xaxis": {"title": {"text": "Gait Variable Score (degrees)", "font": {"size": 11}}, "rangemode": "tozero"},
        "yaxis": {
            "tickmode": "array",
            "tickvals": list(range(len(view.rows))),
            "ticktext": [row.variable for row in view.rows],
            "autorange": "reversed",
        },
    }
    return Figure(traces, layout)


def _number(degrees: str) -> float | None:
    return None if degrees == "–" else float(degrees)


def _degrees(value: float) -> str:
    return f"{value:.1f}" if np.isfinite(value) else "–"
