"""Writes `check.html`: what `kinertia check` found, as one self-contained page."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from kinertia.findings.finding import Finding
from kinertia.findings.overview import Overview, reported
from kinertia.io.results.output_folder import complete_folder
from kinertia.report.check_figures import MOST_CONTACTS, force_figure, pressure_figure
from kinertia.report.figure import Figure, written
from kinertia.report.finding_view import FindingView
from kinertia.report.marker_figures import gap_figure
from kinertia.report.marker_view import marker_scene
from kinertia.report.page import MOST_TRIALS, VIEW_FRAMES
from kinertia.report.rendering import rendered
from kinertia.report.scene import view
from kinertia.workflow.check import ModelOverview
from kinertia.workflow.recording import RecordingCheck

_LEFT_OUT = "left out"
_MOST_UNFOLDED = 4
"""Files listed above what to do next; of more, only the verdicts are counted there."""


@dataclass(frozen=True)
class Checked:
    """Verdict on one recording or model as a whole, and its findings by code."""

    name: str
    anchor: str
    verdict: str
    codes: tuple[str, ...]


def save_check_page(
    overviews: Sequence[Overview],
    recordings: Sequence[RecordingCheck],
    models: Sequence[ModelOverview],
    folder: str | Path,
) -> Path:
    """Write `check.html` into a folder and return the file.

    Args:
        overviews: findings of the person and of each model.
        recordings: contents of each recording, the static trial first.
        models: contents of each model.
        folder: folder to write to, made if necessary.

    Raises:
        FileError: the folder cannot be written to.
    """
    page = render_check(overviews, recordings, models)
    with complete_folder(folder, "check") as work:
        (work / "check.html").write_text(page, encoding="utf-8")
    return Path(folder) / "check.html"


def render_check(
    overviews: Sequence[Overview],
    recordings: Sequence[RecordingCheck],
    models: Sequence[ModelOverview] = (),
) -> str:
    """Render the page as text; arguments as in `save_check_page`. The first six recordings have pictures."""
    pictured = recordings[:MOST_TRIALS]
    most_frames = VIEW_FRAMES // max(len(pictured), 1)
    scenes = [(one.context.name, marker_scene(one.recording, one.used_set, most_frames)) for one in pictured]
    of_models = [model.overview for model in models]
    of_person = [one for one in overviews if not any(one is other for other in of_models)]
    headlines = [("", one) for one in of_person] + [(model.name, model.overview) for model in models]
    left_out = {name for one in of_person for name in one.left_out}
    return rendered(
        "check.html.j2",
        title="Kinertia check",
        headlines=headlines if len(headlines) > 1 else [("", one) for _, one in headlines],
        found=FindingView([*of_person, *(_named(model) for model in models)]),
        files=[
            *(_recording(one, f"recording{k}", left_out) for k, one in enumerate(recordings, start=1)),
            *(_checked(one.name, f"model{k}", one.overview.findings) for k, one in enumerate(models, start=1)),
        ],
        most_unfolded=_MOST_UNFOLDED,
        recordings=recordings,
        pictures=[check_figures(one) for one in pictured],
        scenes=view(scenes) if scenes else None,
        most_contacts=MOST_CONTACTS,
        models=models,
    )


def _named(model: ModelOverview) -> Overview:
    """Add the model's file to its findings, since several may be on the page."""
    return replace(model.overview, findings=[one.in_file(model.name) for one in model.overview.findings])


def _recording(one: RecordingCheck, anchor: str, left_out: set[str]) -> Checked:
    checked = _checked(one.context.name, anchor, one.findings)
    return replace(checked, verdict=_LEFT_OUT) if checked.name in left_out else checked


def _checked(name: str, anchor: str, findings: Sequence[Finding]) -> Checked:
    overview = Overview(findings, 0, 1)
    found = dict.fromkeys(one.code for one in (*overview.waived, *reported(findings)))
    return Checked(name, anchor, overview.verdict, tuple(found))


def check_figures(check: RecordingCheck) -> dict[str, Any]:
    """Draw the pictures of a recording: "forces", "pressure", "gaps"; None where there is nothing to draw."""
    labels = [one.label for one in check.markers]
    figures: dict[str, Figure | None] = {
        "forces": force_figure(check),
        "pressure": pressure_figure(check),
        "gaps": gap_figure(check.recording.markers.select(labels), check.windows, check.recording.name),
    }
    return {name: None if one is None else written(one) for name, one in figures.items()}
