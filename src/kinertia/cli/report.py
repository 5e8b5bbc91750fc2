"""`kinertia report`: the report of a fit again, from its results alone."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from kinertia.cli.options import Quiet
from kinertia.cli.terminal import out
from kinertia.io.output_folder import complete_folder
from kinertia.report.page import render
from kinertia.report.saved_fit import read_saved


def report(
    results: Annotated[Path, typer.Argument(help="Folder that kinertia fit has written.")],
    quiet: Quiet = False,
) -> None:
    """Write the report of a fit again, without the recordings: report.html in its folder is replaced.

    [bold]Example[/]

    kinertia report out
    """
    saved = read_saved(results)
    page = render(saved.fit, saved.provenance, saved.versions)
    with complete_folder(results, "report") as work:
        (work / "report.html").write_text(page, encoding="utf-8")
    out.print(f"report in {results / 'report.html'}", soft_wrap=True)
