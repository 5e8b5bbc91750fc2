"""Renders the page of a command that compares or studies: one template for all of them."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from markupsafe import Markup

from kinertia.report.figure import Figure, written
from kinertia.report.rendering import rendered

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture


@dataclass(frozen=True)
class Part:
    """A section of a page.

    Attributes:
        title: its heading.
        text: paragraphs above everything else.
        figure: figure drawn by plotly.
        caption: text under the figure or the picture.
        picture: an SVG document, where there is no figure; see `drawing`.
        alt: text alternative of the picture.
        headings, rows: a table; the first cell is the row's name.
        listed: sentences below.
    """

    title: str
    text: Sequence[str] = ()
    figure: Figure | None = None
    caption: str = ""
    picture: str = ""
    alt: str = ""
    headings: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    listed: Sequence[str] = ()


def render_parts(title: str, lead: str, parts: Sequence[Part]) -> str:
    """Render the page as text; `lead` is the paragraph below its title."""
    drawn = [
        {
            "part": part,
            "figure": None if part.figure is None else written(part.figure),
            "numeric": [all(map(_is_number, column)) for column in zip(*part.rows, strict=True)],
            "picture": Markup(part.picture[max(part.picture.find("<svg"), 0) :]),  # nosec B704 - drawn here
        }
        for part in parts
    ]
    return rendered("result.html.j2", title=title, lead=lead, parts=drawn)


def _is_number(cell: str) -> bool:
    """Return whether a cell is a number: text cells are aligned to the left."""
    return not cell or cell[0] in "0123456789+-−–.<±"


def drawing(picture: Picture) -> str:
    """Convert a matplotlib figure to an SVG document."""
    buffer = io.StringIO()
    picture.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()
