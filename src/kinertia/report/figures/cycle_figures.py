"""Draws curves over the gait cycle: all strides, right and left each from its own heel strike on.

Strides are thin; the mean of those that are complete, or were measured longest (`common_strides`), is thick with a band
of one standard deviation around it; the estimate's own 95 % band is the darker one. The result of the usual pipeline is
dotted. Gaps, where nothing was measured, are shaded in the side's colour.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from kinertia.estimation.result.cycles import (
    FORCES,
    MOST_STRIDES,
    UNITS,
    CycleCurve,
    Kind,
    curves_by_stage,
)
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.mean_cycles import common_strides, main_task, mean_of, mean_of_common
from kinertia.io.norms_file import Norm
from kinertia.model.skeleton import Skeleton, opposite_on_left
from kinertia.motion.gait_cycle import PERCENT, Phase
from kinertia.motion.joint_moments import body_joints, component_names, joint_and_side
from kinertia.motion.model_outputs import CLINICAL_ANGLES
from kinertia.report.figures.coordinate_titles import (
    convention_of,
    load_title,
    panels_of,
    power_title,
    signed_angles,
    signed_joint_moment,
)
from kinertia.report.figures.figure import GREY, SIDES, Figure, Panel, compact, faded, plain, shaded, small_multiples
from kinertia.report.wording import INTERVAL_SD, USUAL, start_of
from kinertia.settings import SignConvention
from kinertia.trial.data import FEET
from kinertia.trial.sampled_data import runs

_MOST_DRAWN = 5
"""Number of strides drawn per side; mean and bands are of all."""
_TRUNK = "lumbar"
_ROOT_COORDINATES = 6
_OF_FILES: Mapping[Kind, SignConvention] = {"joint_moment": "isb", "clinical": "clinical"}
"""Signs of the curves in `cycles.csv`."""
_SD_OPACITY, _BAND_OPACITY, _STRIDE_OPACITY, _GAP_OPACITY = 0.13, 0.25, 0.45, 0.08
_OF_LANDINGS: tuple[Kind, ...] = ("joint_moment", "moment", "angle", "power", "force")
_FLEXION_POWERS = frozenset({"hip_flexion_power", "knee_angle_power", "ankle_angle_power"})
_PANEL_PX = 100
_PERCENT_OF: Mapping[Phase, str] = {"stride": "the gait cycle", "stance": "stance", "landing": "the landing"}
_FORCE_TITLES = dict(zip(FORCES, ("Forward +", "Upward +", "Towards the other foot +"), strict=True))

Curves = Mapping[tuple[str, str], Sequence[CycleCurve]]
"""Curves by quantity and side."""
Norms = Mapping[str, Norm]
"""Norms by quantity, for both sides."""


def cycle_figures(fit: Fit, norms: Norms = MappingProxyType({}), legs: bool = False) -> dict[Kind, Figure]:
    """Draw all figures over the gait cycle, by kind; none where no trial has a stride, or no stride shows that kind.

    Only trials of the main task (`main_task`) are drawn: a mean of walks and turns is neither.

    Args:
        fit: the fit.
        norms: grey bands below.
        legs: leave out the trunk in figures of joint moments and of an OpenSim model's angles, and powers that are in
            `other_powers`.
    """
    drawn = _of_main_task(fit, norms, legs)
    figures = {} if drawn is None else {kind: drawn.figure(kind) for kind in UNITS}
    return {kind: figure for kind, figure in figures.items() if figure is not None}


def other_powers(fit: Fit) -> Figure | None:
    """Draw powers about axes other than flexion and extension; None without any."""
    drawn = _of_main_task(fit, {}, legs=True)
    return None if drawn is None else replace(drawn, without_flexion=True).figure("power")


def _of_main_task(fit: Fit, norms: Norms, legs: bool) -> "_Drawn | None":
    """Collect what the figures over the gait cycle show; None without strides."""
    shown = main_task(fit)
    if not any(trial.strides for trial in shown.trials):
        return None
    estimate, literature = (_by_quantity(shown.curves[stage]) for stage in ("estimate", "literature"))
    return _Drawn(shown, estimate, literature, norms, legs=legs)


@dataclass(frozen=True, eq=False)
class PhaseFigures:
    """Figures over contacts of one task that are no strides, by kind, and the curves that they show."""

    task: str
    phase: Phase
    curves: Sequence[CycleCurve]
    figures: dict[Kind, Figure]


def phase_figures(fit: Fit, legs: bool = False) -> tuple[PhaseFigures, ...]:
    """Draw the stances and landings of each task over their own percentages, apart from all others.

    Of stances the joint moments alone: angles and the rest are in the figures over the gait cycle, or over time.
    """
    known, result = fit.curves, []
    shown = [curve for curve in known["estimate"] if curve.stride.phase != "stride"]
    for task, phase in dict.fromkeys((curve.task, curve.stride.phase) for curve in shown):
        of_task = {stage: [curve for curve in some if curve.task == task] for stage, some in known.items()}
        estimate, literature = (_by_quantity(of_task[stage], phase) for stage in ("estimate", "literature"))
        drawn = _Drawn(fit, estimate, literature, {}, phase, legs)
        kinds: tuple[Kind, ...] = _OF_LANDINGS if phase == "landing" else ("joint_moment",)
        figures = {kind: drawn.figure(kind) for kind in kinds}
        of_phase = [curve for curve in of_task["estimate"] if curve.stride.phase == phase]
        result.append(
            PhaseFigures(task, phase, of_phase, {k: figure for k, figure in figures.items() if figure is not None})
        )
    return tuple(result)


def cycle_figure(fit: Fit, kind: Kind, norms: Norms = MappingProxyType({})) -> Figure | None:
    """Draw the figure of this kind; None where no trial has a stride."""
    return cycle_figures(fit, norms).get(kind)


def estimated_curves(fit: Fit) -> Curves:
    """Return the curves of the estimate from which figures are drawn."""
    return _by_quantity(curves_by_stage(main_task(fit).trials, fit.mass_kg, MOST_STRIDES, ["estimate"])["estimate"])


def _by_quantity(curves: Iterable[CycleCurve], phase: Phase = "stride") -> Curves:
    result: dict[tuple[str, str], list[CycleCurve]] = {}
    for curve in (candidate for candidate in curves if candidate.stride.phase == phase):
        result.setdefault((curve.quantity, curve.stride.side), []).append(curve)
    return result


def titled_quantities(skeleton: Skeleton, kind: Kind) -> list[tuple[str, str]]:
    """Return names and titles of the curves of a kind in `cycles.csv`, in the order of the panels; a title states the
    positive direction, which a coordinate's name does not do in every model.
    """
    if kind in ("joint_moment", "clinical"):
        return [(name, title) for name, title, _ in _signed_quantities(skeleton, kind, _OF_FILES[kind])]
    if kind == "force":
        return list(_FORCE_TITLES.items())
    coordinates = [coordinate for coordinate in panels_of(skeleton) if coordinate.rotational]
    if kind == "angle":
        return [(f"{coordinate.name}_angle", coordinate.title) for coordinate in coordinates]
    if kind == "power":  # powers of arms and trunk are negligible
        legs = _leg_coordinates(skeleton)
        coordinates = [coordinate for coordinate in coordinates if legs & set(coordinate.columns.values())]
        return [(f"{coordinate.name}_power", power_title(coordinate, coordinates)) for coordinate in coordinates]
    return [(f"{coordinate.name}_moment", load_title(coordinate, "moment")) for coordinate in coordinates]


def _signed_quantities(skeleton: Skeleton, kind: Kind, convention: SignConvention) -> list[tuple[str, str, float]]:
    """Return names, titles and signs of the curves of a kind by a convention."""
    if kind == "clinical":
        return [(name, *signed) for name, signed in signed_angles(convention).items()]
    if kind == "joint_moment":
        bases = dict.fromkeys(joint_and_side(joint.label)[0] for joint in body_joints(skeleton))
        names = [name for base in bases for name in component_names(base)]
        return [(f"{name}_joint_moment", *signed_joint_moment(name, skeleton, convention)) for name in names]
    return [(name, title, 1.0) for name, title in titled_quantities(skeleton, kind)]


@dataclass(frozen=True)
class _Drawn:
    """Data from which the figures are drawn."""

    fit: Fit
    estimate: Curves
    usual: Curves
    norms: Norms
    phase: Phase = "stride"
    legs: bool = False
    without_flexion: bool = False

    def figure(self, kind: Kind) -> Figure | None:
        panels = [
            Panel(
                f"{title} ({'internal ' if kind == 'joint_moment' else ''}{UNITS[kind]})",
                [*self._traces(quantity, self._usual_name(kind), sign)],
                [*self._gaps(quantity), *self._toe_offs()],
            )
            for quantity, title, sign in _signed_quantities(self.fit.skeleton, kind, convention_of(self.fit))
            if self._wanted(quantity, kind)
            and any((quantity, side) in curves for side in FEET for curves in (self.estimate, self.usual))
        ]
        if not panels:
            return None
        axis: dict[str, Any] = {"range": [0, 100], "tickvals": [0, 20, 40, 60, 80, 100]}
        axis["title"] = {"text": f"% of {_PERCENT_OF[self.phase]}", "font": {"size": 11}, "standoff": 2}
        return small_multiples(panels, self._alt(kind), axis, compact_px=_PANEL_PX)

    def _wanted(self, quantity: str, kind: Kind) -> bool:
        """Return whether a panel is drawn: with `legs` no moments of the trunk, nor angles of it if a model's own are
        shown; of powers over strides those of flexion, or the others.
        """
        if not self.legs or kind not in ("joint_moment", "angle", "power"):
            return True
        if kind == "power":
            known = {name for name, _ in self.estimate} & _FLEXION_POWERS if self.phase == "stride" else set()
            return (quantity not in known) == self.without_flexion if known else not self.without_flexion
        if kind == "joint_moment":
            return not quantity.startswith(_TRUNK)
        skeleton = self.fit.skeleton
        columns = skeleton.sides[quantity.removesuffix("_angle")].values()
        of_legs = {*range(_ROOT_COORDINATES), *_leg_coordinates(skeleton)}
        return convention_of(self.fit) != "opensim" or bool(of_legs & set(columns))

    def _usual_name(self, kind: Kind) -> str:
        """Name the dotted curves: body segment parameters only affect moments and powers."""
        return USUAL if kind in ("angle", "force") else start_of(self.fit).values

    def _traces(self, quantity: str, usual_name: str, sign: float) -> Iterator[dict[str, Any]]:
        if norm := self.norms.get(quantity):
            yield from _norm(replace(norm, mean=sign * norm.mean), self._opposite(quantity))
        for side in FEET:
            both = (curves_by_side.get((quantity, side), []) for curves_by_side in (self.estimate, self.usual))
            curves, usual = ([replace(curve, value=sign * curve.value) for curve in some] for some in both)
            word, colour = SIDES[side]
            if curves:
                yield from _estimate(curves, word, colour)
            if usual and quantity not in CLINICAL_ANGLES:  # which no estimate changes
                dotted = {"line": {"color": colour, "dash": "dot", "width": 1.6}, "showlegend": not curves}
                yield {**mean_line(usual_mean(usual, curves)), "name": f"{word}, {usual_name}", **dotted}

    def _opposite(self, quantity: str) -> bool:
        """Return whether the sides' curves of a quantity have opposite signs, though the norm is one."""
        base, _, kind = quantity.rpartition("_")
        return kind in ("angle", "moment") and base in opposite_on_left(self.fit.skeleton)

    def _gaps(self, quantity: str) -> list[dict[str, Any]]:
        """Shade what the mean of a side does not show, in its colour."""
        shapes = []
        for side in FEET:
            if curves := self.estimate.get((quantity, side)):
                colour = faded(SIDES[side][1], _GAP_OPACITY)
                unknown = runs(~np.isfinite(mean_curve(curves)))
                shapes += [shaded(max(a - 1.0, 0.0), min(b + 1.0, 100.0), colour) for a, b in unknown]
        return shapes

    def _toe_offs(self) -> list[dict[str, Any]]:
        """Draw a vertical line per side at its mean toe-off."""
        shapes = []
        for side in FEET if self.phase == "stride" else ():
            strides = [stride for trial in self.fit.trials for stride in trial.strides if stride.side == side]
            percents = [p for stride in strides if np.isfinite(p := stride.percent(stride.toe_off_s))]
            if percents:
                at = round(float(np.mean(percents)), 2)
                line = {"color": faded(SIDES[side][1], 0.6), "width": 1, "dash": "dash"}
                shapes.append({"type": "line", "x0": at, "x1": at, "y0": 0, "y1": 1, "yref": "domain", "line": line})
        return shapes

    def _alt(self, kind: Kind) -> str:
        names = {
            "angle": "Joint angles",
            "moment": "Moments of coordinates",
            "joint_moment": "Joint moments in three dimensions",
            "power": "Joint powers",
            "force": "Ground reactions",
            "clinical": "Clinical angles",
        }
        shown = {(curve.trial, curve.stride) for by_quantity in self.estimate.values() for curve in by_quantity}
        counts = [sum(stride.side == side for _, stride in shown) for side in FEET]
        against = "by inverse kinematics" if kind == "clinical" else f"estimate against {self._usual_name(kind)}"
        strides = f"{self.phase}s: {counts[0]} right, {counts[1]} left"
        return f"{names[kind]} ({UNITS[kind]}) over {_PERCENT_OF[self.phase]}, {against}; {strides}."


def _norm(norm: Norm, opposite: bool) -> Iterator[dict[str, Any]]:
    """Draw a grey band; for `kinertia norms` with opposite signs one per side in its colour, mirrored on the left."""
    low, high = norm.mean - norm.sd, norm.mean + norm.sd
    if not (opposite and norm.convention):
        yield {**_outline(norm.percent, low, high, faded(GREY, 0.3)), "name": "norm, mean ± SD"}
        return
    for (word, colour), (bottom, top) in zip((SIDES[side] for side in FEET), ((low, high), (-high, -low)), strict=True):
        yield {**_outline(norm.percent, bottom, top, faded(colour, _SD_OPACITY)), "name": f"norm, {word}"}


def has_spread(figure: Figure) -> bool:
    """Return whether strides overlap anywhere, so that there are means and SDs."""
    ends = tuple(f"{SIDES[side][0]}, mean" for side in FEET)
    return any(trace["name"].startswith(ends) for trace in figure.data)


def _leg_coordinates(skeleton: Skeleton) -> set[int]:
    """Return the coordinates that move a foot."""
    feet = [skeleton.segments.index(foot) for foot in skeleton.feet]
    return set(skeleton.map.owner[skeleton.support[feet].any(axis=0)].tolist())


def _estimate(curves: Sequence[CycleCurve], word: str, colour: str) -> Iterator[dict[str, Any]]:
    """Draw bands below, strides, and their mean on top, which alone is in the legend."""
    quiet = {"showlegend": False}
    values = np.array([curve.value for curve in curves])
    common = common_strides(values)
    mean, spread = mean_of(values[common]), _spread(values[common])
    if spread is not None:
        yield {
            **band(mean - spread, mean + spread, faded(colour, _SD_OPACITY)),
            "name": f"{word}, mean ± SD",
            **quiet,
        }
    half = INTERVAL_SD * mean_of(np.array([curve.sd for curve in curves])[common])
    if np.isfinite(half).any():
        name = f"{word}, 95 % of the estimate"
        yield {**band(mean - half, mean + half, faded(colour, _BAND_OPACITY)), "name": name, **quiet}
    if len(curves) > 1:
        shown = [curves[k] for k in np.unique(np.linspace(0, len(curves) - 1, _MOST_DRAWN).round().astype(int))]
        line = {"color": faded(colour, _STRIDE_OPACITY), "width": 0.8}
        yield {**_strides(shown), "name": f"{word}, {curves[0].stride.phase}s", "line": line, **quiet}
    phase = curves[0].stride.phase
    name = "mean" if spread is not None else f"one {phase}" if len(curves) < 2 else f"longest {phase}"
    yield {**mean_line(mean), "name": f"{word}, {name}", "line": {"color": colour, "width": 2.2}}


def mean_curve(curves: Sequence[CycleCurve]) -> np.ndarray:
    """Return the mean (101,) of the strides that are complete, or were measured longest; NaN where one has a gap."""
    return mean_of_common(np.array([curve.value for curve in curves]))


def usual_mean(usual: Sequence[CycleCurve], estimate: Sequence[CycleCurve]) -> np.ndarray:
    """Return the mean (101,) of the strides in the estimate's mean, so that they differ by the method alone."""
    if not estimate:
        return mean_curve(usual)
    common = common_strides(np.array([curve.value for curve in estimate]))
    same = {(curve.trial, curve.stride.number) for curve, taken in zip(estimate, common, strict=True) if taken}
    values = [curve.value for curve in usual if (curve.trial, curve.stride.number) in same]
    return mean_of(np.array(values).reshape(-1, len(PERCENT)))


def _spread(values: np.ndarray) -> np.ndarray | None:
    """Return the SD (101,) between the strides (n, 101) of a mean; None for a single stride."""
    return np.std(values, axis=0, ddof=1) if len(values) > 1 else None


def mean_line(values: np.ndarray) -> dict[str, Any]:
    """Draw one curve (101,)."""
    return {
        "type": "scatter",
        "mode": "lines",
        "x0": 0,
        "dx": 1,
        "y": compact(values),
        "hovertemplate": "%{x:.0f} %: %{y:.3g}<extra>%{fullData.name}</extra>",
    }


def _strides(curves: Sequence[CycleCurve]) -> dict[str, Any]:
    """Draw all strides as one line with gaps between them."""
    x = np.tile(np.append(PERCENT, 100), len(curves)).astype(np.uint8)
    y = np.concatenate([np.append(curve.value, np.nan) for curve in curves])
    titles = [f"{plain(curve.trial)}, {SIDES[curve.stride.side][0]} stride {curve.stride.number}" for curve in curves]
    hover = "%{x:.0f} %: %{y:.3g}<extra>" + (titles[0] if len(titles) == 1 else "%{fullData.name}") + "</extra>"
    return {"type": "scatter", "mode": "lines", "x": x, "y": compact(y), "hovertemplate": hover}


def band(low: np.ndarray, high: np.ndarray, colour: str) -> dict[str, Any]:
    """Draw a band around every interval without a gap; whole percents in one byte each."""
    outline = _outline(PERCENT, low, high, colour)
    return {**outline, "x": np.asarray(outline["x"]).astype(np.uint8)}


def _outline(percent: np.ndarray, low: np.ndarray, high: np.ndarray, colour: str) -> dict[str, Any]:
    """Draw a closed outline around every interval without a gap."""
    x: list[np.ndarray] = []
    y: list[np.ndarray] = []
    for first, last in runs(np.isfinite(low) & np.isfinite(high)):
        part = slice(first, last + 1)
        x += [percent[part], percent[part][::-1], np.zeros(1)]
        y += [low[part], high[part][::-1], np.full(1, np.nan)]
    return {
        "type": "scatter",
        "mode": "lines",
        "x": compact(np.concatenate(x)[:-1]) if x else [],
        "y": compact(np.concatenate(y)[:-1]) if y else [],
        "fill": "toself",
        "fillcolor": colour,
        "line": {"width": 0},
        "hoverinfo": "skip",
    }
