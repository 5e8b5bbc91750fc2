"""Loads matplotlib, of the extra `plots`, which draws studies and figures for papers."""

from importlib.util import find_spec

from kinertia.errors import KinertiaError, how_to_install

HOW = how_to_install("plots")


def has_matplotlib() -> bool:
    """Return whether the studies' pictures and figures for papers can be drawn."""
    return find_spec("matplotlib") is not None


def expect_matplotlib() -> None:
    """Raise a KinertiaError, with how to install matplotlib, unless it is installed."""
    if not has_matplotlib():
        raise KinertiaError(f"figures in files need matplotlib, which is not installed: {HOW}")
