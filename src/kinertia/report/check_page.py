"""`check.html`: the findings of `kinertia check` as one page that needs nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from kinertia.checks.model import ModelCheck
from kinertia.checks.recording import RecordingCheck
from kinertia.io.output_folder import complete_folder
from kinertia.report.rendering import rendered


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
    page = rendered("check.html.j2", recordings=recordings, models=models, mistakes=mistakes)
    with complete_folder(folder, "check") as work:
        (work / "check.html").write_text(page, encoding="utf-8")
    return Path(folder) / "check.html"
