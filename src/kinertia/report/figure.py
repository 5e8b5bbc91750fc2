"""Defines a figure as plain data, for plotly.js in a report and plotly's package in a notebook.

Reports do not load plotly for this: its objects check every value against a schema, which took a fifth of a fit's time;
here the tests check every figure once.

A report carries it, and unpacks it when it is opened, so that it stays one file that needs no network.
"""

import base64
import gzip
import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from kinertia.errors import FileError
from kinertia.io.results.output_folder import write_then_rename
from kinertia.model.compiled import cache_folder

_BEST = 9


@dataclass(frozen=True)
class Figure:
    """Traces and layout, named and nested as in plotly's reference (https://plotly.com/javascript/reference).

    Attributes:
        data: traces; numbers may be lists, or the arrays that `compact` makes.
        layout: axes, shapes, annotations, height; `meta.alt` is the text alternative.
        frames: frames of an animation.
    """

    data: Sequence[Mapping[str, Any]]
    layout: Mapping[str, Any]
    frames: Sequence[Mapping[str, Any]] = ()

    @property
    def alt(self) -> str:
        """Description of the figure in words."""
        text: str = self.layout["meta"]["alt"]
        return text

    def to_json(self) -> str:
        """Return traces and layout as JSON for plotly.js.

        Raises:
            ValueError: a number outside of arrays is not finite, which JSON cannot represent.
        """
        plain = {"data": self.data, "layout": self.layout}
        return json.dumps(plain, default=_typed_array, allow_nan=False, separators=(",", ":"))


def written(figure: Figure) -> dict[str, Any]:
    """Return a figure for the templates: its text alternative, and the compressed input of plotly.js."""
    return {"alt": figure.alt, "packed": packed(figure.to_json().encode()), "height": figure.layout["height"]}


def compact(values: np.ndarray) -> np.ndarray:
    """Convert to single precision, in which `Figure.to_json` writes arrays: half the size, beyond visible accuracy."""
    return np.asarray(values, dtype=np.float32)


def _typed_array(values: object) -> dict[str, str]:
    """Return plotly.js' form of a binary array, little-endian in base64; NaN, a gap in a curve, is allowed here."""
    known = {np.dtype(np.float32): "f4", np.dtype(np.uint8): "u1"}
    if not (isinstance(values, np.ndarray) and values.dtype in known and values.ndim == 1):
        raise TypeError(f"a figure holds lists and one-dimensional arrays of float32 or uint8, not {values!r}")
    name = known[values.dtype]
    return {"dtype": name, "bdata": base64.b64encode(values.astype(f"<{name}").tobytes()).decode("ascii")}


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
