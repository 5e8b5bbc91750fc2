"""Defines the figure that notebooks and pages made of them draw; a module of its own, since it loads plotly."""

from collections.abc import Iterator
from itertools import chain, repeat

import plotly.graph_objects as go
import plotly.io as pio

_JUPYTER = "plotly_mimetype"
_library: Iterator[bool | str] = chain([True], repeat("cdn"))
"""Where each figure's page gets plotly.js (5 MB) from: the first of a notebook carries it, for the others as well; they
name plotly's server, too, for the case that the first is not kept."""


class NotebookFigure(go.Figure):  # type: ignore[misc]  # plotly has no types
    """Figure like plotly's own that is also drawn in pages made of a notebook by `nbconvert --to html`.

    Plotly's cell output is drawn only by Jupyter's extension, so such a page would have empty cells. Here HTML is added
    to it, unless another of plotly's renderers was chosen.
    """

    def _ipython_display_(self) -> None:
        if not pio.renderers.render_on_display or pio.renderers.default != _JUPYTER:
            super()._ipython_display_()
            return
        from IPython.display import display

        page = self.to_html(full_html=False, include_plotlyjs=next(_library))
        display({**self._repr_mimebundle_(), "text/html": page}, raw=True)  # type: ignore[no-untyped-call]
