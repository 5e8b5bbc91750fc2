"""Libraries that only pictures need, and that are a sixth of an installation: the extra `plots`.

A report draws its own figures. matplotlib draws those of studies and for papers, plotly those of notebooks.
"""

from __future__ import annotations

from importlib.util import find_spec

from kinertia.errors import KinertiaError

HOW = "pip install 'kinertia[plots]'"


def has_matplotlib() -> bool:
    """Whether the studies' pictures and figures for papers can be drawn."""
    return find_spec("matplotlib") is not None


def expect_plotly() -> None:
    """Raise a KinertiaError that says how to install plotly, unless it is there."""
    if find_spec("plotly") is None:
        raise KinertiaError(f"figures in a notebook need plotly, which is not installed; install it: {HOW}")


def expect_matplotlib() -> None:
    """Raise a KinertiaError that says how to install matplotlib, unless it is there."""
    if not has_matplotlib():
        raise KinertiaError(f"figures in files need matplotlib, which is not installed; install it: {HOW}")
