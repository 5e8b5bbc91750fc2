"""Renders pages from the templates beside this module."""

import sys
from contextlib import suppress
from functools import cache
from importlib.util import cache_from_source
from pathlib import Path
from typing import Any

import jinja2
from jinja2.bccache import Bucket
from markupsafe import Markup

from kinertia.findings.display import outlined
from kinertia.io.versions import VERSION
from kinertia.report.figure import packed_script
from kinertia.report.finding_view import LOOKS, linked, unbroken
from kinertia.report.wording import fixed


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
