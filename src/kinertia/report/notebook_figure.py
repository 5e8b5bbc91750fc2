"""Shows a plotly figure wherever a notebook is read; apart from others, since it loads plotly."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, repeat

import plotly.graph_objects as go
import plotly.io as pio

_JUPYTER = "plotly_mimetype"
_library: Iterator[bool | str] = chain([True], repeat("cdn"))
"""Where each figure's page gets plotly.js (5 MB) from: the first of a notebook carries it, for the others as well; they
name plotly's server, too, for the case that the first is not kept."""


class NotebookFigure(go.Figure):  # type: ignore[misc]  # plotly has no types
    """As plotly's own, but drawn in pages that `nbconvert --to html` makes of a notebook, too.

    In Jupyter plotly leaves in a cell what only Jupyter's extension draws, so that cells of such a page are empty. Here
    HTML stands beside it, unless somebody has chosen another of plotly's renderers.
    """

    def _ipython_display_(self) -> None:
        if not pio.renderers.render_on_display or pio.renderers.default != _JUPYTER:
            super()._ipython_display_()
            return
        from IPython.display import display

        page = self.to_html(full_html=False, include_plotlyjs=next(_library))
        display({**self._repr_mimebundle_(), "text/html": page}, raw=True)  # type: ignore[no-untyped-call]
