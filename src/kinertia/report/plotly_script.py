"""Provides plotly.js for reports: the installed package's script, compressed once per installation.

A report carries it, and unpacks it when it is opened, so that it stays one file that needs no network.
"""

import base64
import gzip
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

from kinertia.errors import FileError
from kinertia.io.results.output_folder import write_then_rename
from kinertia.model.compiled import cache_folder

_BEST = 9


def script_path() -> Path:
    """Return the path of the script in the plotly package, which is not imported."""
    spec = find_spec("plotly")
    assert spec is not None, "plotly is a dependency"
    assert spec.origin is not None
    return Path(spec.origin).parent / "package_data" / "plotly.min.js"


def packed_script() -> str:
    """Return the script, gzip in base64; compressed again only where another plotly was installed since."""
    script = script_path()
    state = script.stat()
    kept = cache_folder() / f"plotly-{state.st_size}-{state.st_mtime_ns}.txt"
    with suppress(OSError):
        return kept.read_text(encoding="ascii")
    text = packed(script.read_bytes(), _BEST)
    with suppress(OSError, FileError):  # where nothing can be kept, every report compresses it
        for older in kept.parent.glob("plotly-*.txt"):
            older.unlink()
        write_then_rename(kept, text)
    return text


def packed(text: bytes, level: int = 6) -> str:
    """Compress a text to gzip and base64, reproducibly, at a level from 1 (fast) to 9 (small)."""
    return base64.b64encode(gzip.compress(text, level, mtime=0)).decode("ascii")
