"""Defines a figure as plain data, for plotly.js in a report and plotly's package in a notebook.

Reports do not load plotly for this: its objects check every value against a schema, which took a fifth of a fit's time;
here the tests check every figure once.
"""

import base64
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kinertia.report.plotly_script import packed


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
