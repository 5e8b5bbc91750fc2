"""`check.html`: the findings of `kinertia check` as one page that needs nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from kinertia.diagnostics.model.model_check import ModelCheck
from kinertia.io.output_folder import complete_folder
from kinertia.report.check_figures import MOST_CONTACTS, force_figure, pressure_figure
from kinertia.report.figure import Figure, written
from kinertia.report.marker_figures import gap_figure
from kinertia.report.marker_view import marker_scene
from kinertia.report.page import MOST_TRIALS, VIEW_FRAMES
from kinertia.report.rendering import rendered
from kinertia.report.scene import view
from kinertia.workflow.recording import RecordingCheck


def save_check_page(
    recordings: Sequence[tuple[str, RecordingCheck]],
    models: Sequence[tuple[str, ModelCheck]],
    mistakes: Sequence[str],
    folder: str | Path,
) -> Path:
    """Write `check.html` into a folder; returns the file.

    Args:
        recordings, models: findings, each with its title.
        mistakes: one sentence for each file that could not be read.
        folder: is made if need be.

    Raises:
        FileError: the folder cannot be written to.
    """
    page = render_check(recordings, models, mistakes)
    with complete_folder(folder, "check") as work:
        (work / "check.html").write_text(page, encoding="utf-8")
    return Path(folder) / "check.html"


def render_check(
    recordings: Sequence[tuple[str, RecordingCheck]],
    models: Sequence[tuple[str, ModelCheck]] = (),
    mistakes: Sequence[str] = (),
) -> str:
    """The page as text; arguments as those of `save_check_page`. The first six recordings have pictures."""
    pictured = recordings[:MOST_TRIALS]
    most_frames = VIEW_FRAMES // max(len(pictured), 1)
    scenes = [(title, marker_scene(found.recording, found.used_set, most_frames)) for title, found in pictured]
    return rendered(
        "check.html.j2",
        title="Kinertia check",
        recordings=recordings,
        pictures=[check_figures(found) for _, found in pictured],
        scenes=view(scenes) if scenes else None,
        most_contacts=MOST_CONTACTS,
        models=models,
        mistakes=mistakes,
    )


def check_figures(check: RecordingCheck) -> dict[str, Any]:
    """What the page draws of a recording: "forces", "pressure", "gaps"; None where there is nothing to draw."""
    labels = [one.label for one in check.markers]
    figures: dict[str, Figure | None] = {
        "forces": force_figure(check),
        "pressure": pressure_figure(check),
        "gaps": gap_figure(check.recording.markers.select(labels), check.windows, check.recording.name),
    }
    return {name: None if one is None else written(one) for name, one in figures.items()}
