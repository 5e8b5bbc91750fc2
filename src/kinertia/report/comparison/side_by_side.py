"""Compares several results: what differs by more than the error bars.

Sessions of one person, two methods or two models on one recording: rows are body segment parameters and strides; the
others are compared with the first result.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from kinertia.estimation.result.cycles import UNITS as UNITS_OF_CURVES
from kinertia.estimation.result.fit import Fit
from kinertia.model.bsp import PARAMETERS, UNITS
from kinertia.report.figures.bsp_figures import NAMES, segment_name
from kinertia.report.figures.coordinate_titles import (
    convention_of,
    panels_of,
    same_segment,
    same_sign,
    signed_load_title,
)
from kinertia.report.figures.cycle_figures import estimated_curves, mean_curve, mean_line
from kinertia.report.figures.figure import COMPARED, SIDES, Figure, Panel, plain, small_multiples, written
from kinertia.report.figures.time_figures import MOST_FRAMES
from kinertia.report.pages.cycle_view import stride_rows
from kinertia.report.pages.file_outputs import outputs_summary, outputs_view
from kinertia.report.pages.rendering import rendered
from kinertia.report.wording import INTERVAL_SD, decimals, fixed, read_in
from kinertia.trial.data import FEET

CHANGED_SD = INTERVAL_SD
"""A difference of more than this many of its own SDs is a change."""
_COLOURS = COMPARED
MOST_FITS = len(_COLOURS)
_MOST_TRIALS = 3
"""Number of trials of each result whose files' own outputs are shown."""
_MOMENTS = ("hip_flexion", "hip_adduction", "knee_angle", "ankle_angle")


@dataclass(frozen=True)
class Difference:
    """Difference of one parameter of one segment between two results.

    Attributes:
        segment, parameter, unit: what is compared; SI units.
        first, other: values of the two results.
        sd: SD of the difference, from both error bars as if they were independent. They are not: both use the same
            prior, which makes the true one smaller. NaN where a result has no error bars, and where `same` is false.
        same: whether the segment is the same in both models (`same_segment`).
    """

    segment: str
    parameter: str
    unit: str
    first: float
    other: float
    sd: float
    same: bool

    @property
    def change(self) -> float:
        """Change of the value, other minus first."""
        return self.other - self.first

    @property
    def changed(self) -> bool | None:
        """Whether the values differ beyond the error bars; None without them, and between different segments."""
        return None if np.isnan(self.sd) else bool(self.sd > 0 and abs(self.change) > CHANGED_SD * self.sd)


def differences(first: Fit, other: Fit) -> list[Difference]:
    """Compare all parameters of the segments that both have, segment by segment."""
    compared = []
    for segment in first.estimate.segments:
        if segment not in other.estimate.segments:
            continue
        rows = [fit.estimate.segments.index(segment) for fit in (first, other)]
        values = [fit.estimate.table()[row] for fit, row in zip((first, other), rows, strict=True)]
        sds = [_sd(fit)[row] for fit, row in zip((first, other), rows, strict=True)]
        same = same_segment(segment, first.skeleton, other.skeleton)
        for k, parameter in enumerate(PARAMETERS):
            sd = float(np.hypot(sds[0][k], sds[1][k])) if same else np.nan
            pair = float(values[0][k]), float(values[1][k])
            compared.append(Difference(segment, parameter, UNITS[k], *pair, sd, same))
    return compared


def judged(compared: Sequence[Difference]) -> list[Difference]:
    """Return the differences that have error bars to test a change by."""
    return [difference for difference in compared if difference.changed is not None]


def outcome_of(compared: Sequence[Difference]) -> str:
    """State in words how many parameters changed."""
    distinguished = judged(compared)
    if not distinguished:
        without = (
            "no error bars"
            if any(difference.same for difference in compared)
            else "no segment is the same in both models"
        )
        return f"{without}, differences only"
    changed = sum(bool(difference.changed) for difference in distinguished)
    their = "their" if changed else "its"
    counted = f"{changed or 'none'} of {len(distinguished)} body segment parameters"
    return f"{counted} changed beyond {their} error bars"


def _sd(fit: Fit) -> np.ndarray:
    return np.full(fit.estimate.table().shape, np.nan) if fit.posterior is None else fit.posterior.sd


def remarks(fits: Mapping[str, Fit]) -> list[str]:
    """List limitations of a comparison."""
    (name, first), *others = fits.items()
    notes = []
    for other_name, other in others:
        if abs(first.mass_kg - other.mass_kg) > 0.1 * first.mass_kg:
            notes.append(
                f"{name} has {first.mass_kg:.1f} kg, {other_name} {other.mass_kg:.1f} kg: is it the same person?"
            )
        lacking = sorted(set(first.estimate.segments) ^ set(other.estimate.segments))
        if lacking:
            notes.append(f"{name} and {other_name} do not share these segments: {', '.join(lacking)}")
        if unlike := sorted(
            {segment_name(difference.segment) for difference in differences(first, other) if not difference.same}
        ):
            notes.append(
                f"{name} and {other_name} use different models: {', '.join(unlike)} differ in origin and extent (other "
                "joints or neighbours), so their parameters cannot be compared"
            )
        notes += [
            sentence for joint in _MOMENTS if (sentence := _sign_remark(joint, (name, first), (other_name, other)))
        ]
    without = [result for result, fit in fits.items() if fit.posterior is None]
    if without:
        subjects = f"{name}, the reference of the comparison" if name in without else ", ".join(without)
        notes.append(
            f"the two-level method gives no error bars, so a change cannot be distinguished from chance: {subjects}"
        )
    return notes


def _sign_remark(joint: str, first: tuple[str, Fit], other: tuple[str, Fit]) -> str:
    """Explain how a moment of the other result is drawn, where the models define it differently."""
    (name, fit), (other_name, other_fit) = first, other
    both = [f"{joint}_{side}" for side in FEET]
    if not all(set(both) & set(compared.skeleton.coordinates) for compared in (fit, other_fit)):
        return ""
    signs = {same_sign(joint, side, fit.skeleton, other_fit.skeleton) for side in FEET}
    if -1 in signs:
        return f"{joint} of {other_name} has the opposite sign: its moments are drawn with the sign of {name}"
    return (
        f"{joint} of {other_name} rotates about a different axis than in {name}: its moments are not drawn"
        if 0 in signs
        else ""
    )


def comparison_columns(fits: Mapping[str, Fit]) -> dict[str, list[Any]]:
    """Return the table of `compare.csv`: a row per other result, segment and parameter."""
    (name, first), *others = fits.items()
    rows = [(name, other_name, difference) for other_name, other in others for difference in differences(first, other)]
    return {
        "first": [row[0] for row in rows],
        "other": [row[1] for row in rows],
        **{key: [getattr(difference, key) for *_, difference in rows] for key in ("segment", "parameter", "unit")},
        "first_value": [difference.first for *_, difference in rows],
        "other_value": [difference.other for *_, difference in rows],
        **{key: [getattr(difference, key) for *_, difference in rows] for key in ("change", "sd", "changed")},
    }


def comparison_summary(fits: Mapping[str, Fit]) -> dict[str, Any]:
    """Return what `kinertia compare --json` prints: remarks, and every parameter against the first result; SI units."""
    (first_name, first), *others = fits.items()
    return {
        "first": first_name,
        "remarks": remarks(fits),
        "file_outputs": {name: outputs_summary(fit) for name, fit in fits.items()},
        "against_first": {
            name: [
                {**asdict(difference), "change": difference.change, "changed": difference.changed}
                for difference in differences(first, other)
            ]
            for name, other in others
        },
    }


def render_comparison(fits: Mapping[str, Fit], changes: Mapping[str, Any] | None = None, not_compared: str = "") -> str:
    """Render the page of `kinertia compare`, which titles results by these names.

    Args:
        fits: results.
        changes: what is shown of joint moments and angles (`Comparison.shown`).
        not_compared: why these are not compared.
    """
    (name, first), *others = fits.items()
    figure = moments_figure(fits)
    pairs = [(other_name, differences(first, other)) for other_name, other in others]
    return rendered(
        "side_by_side.html.j2",
        title="Comparison: " + ", ".join(fits),
        first=name,
        changes=changes,
        not_compared=not_compared,
        results=[_head(result, fit) for result, fit in fits.items()],
        remarks=remarks(fits),
        judged=any(judged(compared) for _, compared in pairs),
        pairs=[
            {
                "name": other,
                "outcome": outcome_of(compared),
                "changed": any(difference.changed for difference in compared),
                "judged": bool(judged(compared)),
                "rows": [_row(difference) for difference in compared],
            }
            for other, compared in pairs
        ],
        strides={result: stride_rows(fit) for result, fit in fits.items() if _strides(fit)},
        measures=[row.measure for row in next((stride_rows(fit) for fit in fits.values() if _strides(fit)), [])],
        figure=None if figure is None else written(figure),
        beside=[
            {**output, "name": f"{result}, {output['name']}"}
            for result, fit in fits.items()
            for output in outputs_view(fit, fit.trials[:_MOST_TRIALS], MOST_FRAMES // _MOST_TRIALS)
        ],
        sd=CHANGED_SD,
    )


def _strides(fit: Fit) -> bool:
    return any(trial.strides for trial in fit.trials)


def _head(name: str, fit: Fit) -> dict[str, Any]:
    return {
        "name": name,
        "subject": fit.subject.name,
        "mass": fit.mass_kg,
        "method": fit.settings.method,
        "model": fit.skeleton.name,
        "trials": ", ".join(trial.name for trial in fit.trials),
        "verdict": fit.overview.verdict,
    }


def _row(difference: Difference) -> dict[str, Any]:
    k = PARAMETERS.index(difference.parameter)
    unit, factor = read_in(k)
    digits = decimals(
        k, difference.sd if difference.sd > 0 else 0.1 * max(abs(difference.first), abs(difference.other))
    )
    numbers = {"first": difference.first, "other": difference.other, "change": difference.change, "sd": difference.sd}
    cells = {
        key: {"value": value * factor, "text": fixed(value * factor, digits, sign=key == "change")}
        for key, value in numbers.items()
        if np.isfinite(value)
    }
    return {
        "segment": segment_name(difference.segment),
        "parameter": f"{NAMES[k]} ({unit})",
        "changed": difference.changed,
        **cells,
    }


def moments_figure(fits: Mapping[str, Fit]) -> Figure | None:
    """Draw mean joint moments of the legs over the gait cycle, a colour per result, with the first one's convention of
    signs; None where none has strides.
    """
    walked = {name: fit for name, fit in fits.items() if _strides(fit)}
    if not walked:
        return None
    curves = {name: estimated_curves(fit) for name, fit in walked.items()}
    convention, first = convention_of(next(iter(fits.values()))), next(iter(fits.values())).skeleton
    titles = {
        coordinate.name: signed_load_title(coordinate, "moment", convention)
        for coordinate in panels_of(first)
        if coordinate.name in _MOMENTS
    }
    panels = []
    for joint, (title, turned) in titles.items():
        for side in FEET:
            traces = [
                {
                    **mean_line(turned * sign * mean_curve(own_curves)),
                    "name": plain(name),
                    "line": {"color": colour, "width": 2},
                }
                for (name, shown), colour in zip(curves.items(), _COLOURS, strict=False)
                if (own_curves := shown.get((f"{joint}_moment", side)))
                and (sign := same_sign(joint, side, first, walked[name].skeleton))
            ]
            if traces:
                side_word = SIDES[side][0].capitalize()
                panels.append(Panel(f"{side_word} {title[0].lower()}{title[1:]} ({UNITS_OF_CURVES['moment']})", traces))
    if not panels:
        return None
    axis: dict[str, Any] = {"range": [0, 100], "tickvals": [0, 20, 40, 60, 80, 100]}
    axis["title"] = {"text": "% of the gait cycle", "font": {"size": 11}, "standoff": 2}
    return small_multiples(panels, f"Mean joint moments (N m/kg) over the gait cycle of {', '.join(walked)}.", axis)
