"""Ask which BSPs survive noisy kinematics."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from kinertia.report.pages.study_pages import save_sensitivity
from kinertia.studies.sensitivity import run_sensitivity
from validation.page import PAGES, write_page


def main(
    draws: Annotated[int, typer.Option(min=2, help="People in each condition.")] = 24,
    seed: Annotated[int, typer.Option(help="Of people and noise.")] = 1,
    workers: Annotated[int | None, typer.Option(help="Processes (default: one per core).")] = None,
) -> None:
    """Run the study, and write the page and its picture."""
    result = run_sensitivity(draws, seed, workers)
    with TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        save_sensitivity(result, out)
        (PAGES / "sensitivity.png").write_bytes((out / "sensitivity.png").read_bytes())
        write_page("sensitivity", (out / "sensitivity.md").read_text(encoding="utf-8"))
