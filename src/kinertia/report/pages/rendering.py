"""Renders pages from the templates of reports; one template serves all commands that compare or study."""

from __future__ import annotations

import io
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.util import cache_from_source
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jinja2
from jinja2.bccache import Bucket
from markupsafe import Markup

from kinertia.findings.display import outlined
from kinertia.io.versions import VERSION
from kinertia.report.figures.figure import Figure, packed_script, written
from kinertia.report.pages.finding_view import LOOKS, linked, unbroken
from kinertia.report.wording import fixed

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture


def rendered(template: str, **content: Any) -> str:
    """Render a page from a template; characters that UTF-8 lacks, as in old file names, become question marks."""
    page = _environment().get_template(template).render(version=VERSION, **content)
    return page.encode("utf-8", errors="replace").decode("utf-8")


class _CompiledTemplates(jinja2.FileSystemBytecodeCache):
    """Cache of compiled templates in the folder of Python's compiled modules, where that is writable.

    Compiling takes more time than all the rest of a report.
    """

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Store compiled templates if possible."""
        if not sys.dont_write_bytecode:
            with suppress(OSError):
                super().dump_bytecode(bucket)


def templates_of(package: str) -> jinja2.Environment:
    """Return the templates of a package: shown content is escaped, and an undefined name is an error."""
    return jinja2.Environment(
        loader=jinja2.PackageLoader(package),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
        bytecode_cache=_CompiledTemplates(str(Path(cache_from_source(__file__)).parent)),
    )


@cache
def _environment() -> jinja2.Environment:
    environment = templates_of("kinertia.report")
    environment.globals.update(asset=_asset, packed_script=lambda: Markup(packed_script()))  # nosec B704
    environment.globals.update(looks=LOOKS)
    environment.filters.update(fixed=fixed, outlined=outlined, linked=linked, unbroken=unbroken)
    return environment


def _asset(name: str) -> Markup:
    """Return a style sheet or script unchanged."""
    loader = _environment().loader
    assert loader is not None
    return Markup(loader.get_source(_environment(), name)[0])  # nosec B704 - of the package itself


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
