"""Writes `report.html`: one self-contained file.

plotly.js is in the page once, compressed; its policy (Content-Security-Policy) forbids every request.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from kinertia.diagnostics.result.suitability import suitability
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.gait_scores import GaitProfile
from kinertia.estimation.result.leg_moments import coverage_sentence, forces_used, full_bandwidth, gaps_sentence
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.estimation.simultaneous.instruments.instrument_errors import SHOWN_UNIT, item_text, quantity_text
from kinertia.io.subject.provenance import Provenance
from kinertia.io.versions import versions
from kinertia.model.bsp import PARAMETERS, BodySegmentParameters
from kinertia.report.figures.body_figure import body_figure
from kinertia.report.figures.bsp_figures import (
    MAIN,
    MASS_AND_COM,
    NAMES,
    PRODUCTS,
    change_figure,
    departure_figure,
    information_figure,
    segment_name,
)
from kinertia.report.figures.coordinate_titles import convention_of
from kinertia.report.figures.cycle_figures import (
    Norms,
)
from kinertia.report.figures.figure import SIDE_COLOURS, Figure, written
from kinertia.report.figures.marker_figures import fit_gap_figure, marker_figure
from kinertia.report.figures.skeleton_view import scene, view
from kinertia.report.figures.time_figures import (
    MOST_EVENTS,
    MOST_FRAMES,
    bandwidths,
    coordinate_figure,
    joint_moment_figure,
    moment_figure,
    residual_figure,
)
from kinertia.report.pages.cycle_view import cycles_view
from kinertia.report.pages.file_outputs import outputs_view
from kinertia.report.pages.finding_view import FindingView
from kinertia.report.pages.headline import impossible, purposes, without_repetition, words
from kinertia.report.pages.rendering import rendered
from kinertia.report.pages.truth_comparison import Truth, truth_rows
from kinertia.report.pages.vicon_differences import differences_view
from kinertia.report.wording import INTERVAL_SD, decimals, expected_of, fixed, read_in, start_of
from kinertia.trial.sampled_data import rms_by_marker, rms_length, runs
from kinertia.trial.stances import gait_events

MOST_TRIALS = 6
"""Trials whose curves are shown; all are in the table of residuals and in the files."""
VIEW_FRAMES = 300
"""Frames in the 3-D view, shared by the trials like those of the curves, so that the page stays below 3.2 MB."""


Template = Literal["report", "letter"]
"""The report, or of it what belongs into a patient's file: two printed pages."""


def render(
    fit: Fit,
    provenance: Provenance | None = None,
    computed_by: Mapping[str, str] | None = None,
    norms: Norms = MappingProxyType({}),
    profiles: Mapping[str, GaitProfile] = MappingProxyType({}),
    truth: Truth | None = None,
    template: Template = "report",
) -> str:
    """Render the report of a fit, or its letter.

    Args:
        fit: the fit.
        provenance: files and command; a fit made in Python has none.
        computed_by: versions that computed the fit, where they are not the present ones.
        norms: norms of the curves over the gait cycle, drawn as bands behind them.
        profiles: scores against these norms, by task (`profiles_by_task`).
        truth: truth of a synthetic person.
        template: which page.
    """
    true_bsp, about = None if truth is None else truth.bsp, _about(fit, provenance)
    shown = fit.trials[:MOST_TRIALS]
    gaps, covered = gaps_sentence(shown), coverage_sentence(fit.trials)
    outputs = suitability(fit, fit.findings, fit.left_out)
    phases, cycle, more_cycles = cycles_view(fit, norms, profiles)
    # where there are strides their section says it
    rated, said = without_repetition(purposes(outputs, impossible(fit)), covered if cycle else ""), words(fit)
    return rendered(
        f"{template}.html.j2",
        title=f"{fit.subject.name}: gait report",
        fit=fit,
        words=said,
        outputs=outputs,
        purposes=rated,
        start=start_of(fit),
        expected=expected_of(fit),
        found=FindingView([fit.overview]),
        held=said.held,
        hidden=said.hidden,
        asymmetry=said.asymmetry,
        total_mass=[fit.subject.mass_kg, fit.literature.total_mass_kg, fit.estimate.total_mass_kg],
        phases=phases,
        cycle=cycle,
        more_cycles=more_cycles,
        convention=convention_of(fit),
        about=about,
        sides={side: name for side, (_, name) in SIDE_COLOURS.items()},
        covered=covered,
        gaps=gaps if "%" in covered else "",
        all_gaps=gaps,
        beside=outputs_view(fit, shown, MOST_FRAMES // len(shown)),
        vicon=differences_view(fit),
        walks=any(gait_events(trial.kinematics.trial) for trial in fit.trials),
        body={
            "mass": _written(body_figure(fit)),
            "information": _written(body_figure(fit, "information")),
            "changes": written(change_figure(fit, MASS_AND_COM, true_bsp)),
        },
        bsp=_parameters(fit, true_bsp),
        information=_written(information_figure(fit)),
        residuals=residual_rows(fit.trials),
        truth=None if truth is None else truth_rows(fit, truth),
        trials=[_trial(fit, trial, k, len(shown), truth) for k, trial in enumerate(shown)],
        scenes=view([(trial.name, scene(fit, trial, VIEW_FRAMES // len(shown))) for trial in shown]),
        settings=fit.settings.model_dump(),
        subject=fit.subject.model_dump(),
        provenance=provenance,
        versions=computed_by or versions(),
        shown_unit=SHOWN_UNIT,
        item_text=item_text,
        quantity_text=quantity_text,
        most_events=MOST_EVENTS,
        seconds={trial.name: dict(trial.seconds) for trial in fit.trials},
    )


def _parameters(fit: Fit, true_bsp: BodySegmentParameters | None) -> dict[str, Any]:
    """Collect everything that the template shows of the body segment parameters."""
    figures = {
        name: {
            "change": written(change_figure(fit, some, true_bsp)),
            "departure": _written(departure_figure(fit, some)),
        }
        for name, some in (("main", MAIN), ("products", PRODUCTS))
    }
    return {**figures, "rows": bsp_rows(fit)}


def _about(fit: Fit, provenance: Provenance | None) -> list[str]:
    """List who was recorded, when and under which conditions, as far as it is known."""
    person = fit.subject
    parts = [person.sex, "" if person.age_years is None else f"{person.age_years:g} years", f"{fit.mass_kg:.1f} kg"]
    parts += ["" if person.height_m is None else f"{person.height_m:.2f} m"]
    conditions = dict.fromkeys(trial.kinematics.trial.condition for trial in fit.trials)
    named = [f"{trial.name}" for trial in fit.trials[:MOST_TRIALS]]
    more = len(fit.trials) - len(named)
    about = [", ".join(filter(None, parts)), "" if provenance is None else provenance.date, *conditions]
    return [*filter(None, about), ", ".join(named) + (f" and {more} more trials" if more else "")]


def _written(figure: Figure | None) -> dict[str, Any] | None:
    return None if figure is None else written(figure)


def _trial(fit: Fit, trial: TrialFit, k: int, count: int, truth: Truth | None) -> dict[str, Any]:
    """Collect everything that the templates show of one trial."""
    frames = MOST_FRAMES // count
    noise = None if fit.posterior is None else fit.posterior.marker_noise[k]
    return {
        "id": f"trial{k + 1}",
        "name": trial.name,
        "window_s": trial.kinematics.window_s,
        "intervals": len(trial.kinematics.windows_s),
        "frames": len(trial.time),
        "every": -(-len(trial.time) // frames),
        "all_frames": len(trial.kinematics.trial.markers.time),
        "residuals": written(residual_figure(trial, frames, start_of(fit))),
        "coordinates": written(coordinate_figure(trial, fit.skeleton, frames)),
        "moments": written(
            moment_figure(
                trial,
                fit.skeleton,
                fit.mass_kg,
                frames,
                start_of(fit),
                None if truth is None else truth.joint_loads[trial.name],
            )
        ),
        "joint_moments": _written(joint_moment_figure(trial, fit.mass_kg, convention_of(fit), frames // 2)),
        "bands": trial.deviations is not None,
        "forces": forces_used(trial.reactions, fit.settings, trial.motion_hz),
        "markers": written(marker_figure(trial, () if noise is None else noise.drifting)),
        "marker_rows": _marker_rows(
            trial, {} if noise is None else noise.sd_m, () if noise is None else noise.drifting
        ),
        "noise": noise,
        "gaps": _written(fit_gap_figure(trial)),
    }


def residual_rows(trials: Sequence[TrialFit]) -> list[dict[str, Any]]:
    """Return RMS and peak of force and moment, per trial, bandwidth of the forces and stage."""
    rows = []
    for trial in trials:
        if not trial.kinematics.complete:
            continue
        narrow = f"motion's bandwidth ({bandwidths(trial)})"
        full = full_bandwidth(trial.reactions).removeprefix("forces ").removeprefix("at ")
        for k, (bandwidth, residuals) in enumerate(((narrow, trial.residuals), (full, trial.full_residuals))):
            row: dict[str, Any] = {"name": "" if k else trial.name, "bandwidth": bandwidth, "stages": {}}
            for stage, values in residuals.items():
                parts = values[:, :3], values[:, 3:]
                row["stages"][stage] = [(rms_length(p), float(np.linalg.norm(p, axis=1).max())) for p in parts]
            rows.append(row)
    return rows


def bsp_rows(fit: Fit) -> list[dict[str, Any]]:
    """Return table rows in kg, mm and kg m2; each number as a value, for sorting, and as text."""
    away, posterior = fit.departures, fit.posterior
    before, after = fit.literature.table(), fit.estimate.table()
    rows = []
    for i, segment in enumerate(fit.estimate.segments):
        for k in range(len(PARAMETERS)):
            unit, factor = read_in(k)
            values = {"before": before[i, k], "estimate": after[i, k]}
            row: dict[str, Any] = {"segment": segment_name(segment), "parameter": f"{NAMES[k]} ({unit})"}
            row |= {"product": k in PRODUCTS, "changed": bool(after[i, k] != before[i, k])}
            # without a deviation, inertias have about three digits
            size = 0.1 * max(abs(before[i, k]), abs(after[i, k]))
            if posterior is not None and away is not None:
                held = not posterior.prior_sd[i, k] > 0
                values |= {"prior_sd": posterior.prior_sd[i, k], "sd": posterior.sd[i, k]}
                size = size if held else posterior.sd[i, k]
                information = float(posterior.information[i, k])
                row |= {"away": away[i, k], "information": 0.0 if held else max(100 * information, 0.0), "held": held}
                row["evidence"] = fit.evidence[i, k]
                row["changed"] = not held and abs(after[i, k] - before[i, k]) > INTERVAL_SD * posterior.sd[i, k]
            for name, value in values.items():
                row[name] = {"value": value * factor, "text": fixed(value * factor, decimals(k, size))}
            rows.append(row)
    return rows


def _marker_rows(trial: TrialFit, sd_m: Mapping[str, float], drifting: tuple[str, ...]) -> list[dict[str, Any]]:
    """Return per marker the distances in mm, share of frames that show it (whole trial), and longest gap in s."""
    kinematics = trial.kinematics
    markers = kinematics.trial.markers.select(kinematics.ik.labels)
    seen = markers.seen
    distances_m = {stage: rms_by_marker(errors) for stage, errors in trial.marker_errors_m.items()}
    rows = []
    for k, label in enumerate(markers.labels):
        longest = max((last - first + 1 for first, last in runs(~seen[:, k])), default=0)
        rows.append(
            {
                "label": label,
                "ik": 1e3 * distances_m["ik"][k],
                "final": 1e3 * distances_m["final"][k],
                "seen": 100 * float(seen[:, k].mean()),
                "gap": longest / markers.rate_hz,
                "sd": 1e3 * sd_m[label] if label in sd_m else None,
                "drifting": label in drifting,
            }
        )
    return rows
