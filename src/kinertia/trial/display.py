"""Finds what shows and saves data (`kinertia.report.display`) when it is first asked for: data know no reports."""

from collections.abc import Callable
from importlib import import_module
from typing import Any

_SHOWN_BY = "kinertia.report.display"


def of_report(name: str) -> Callable[..., Any]:
    """Return the function of this name that shows or saves data."""
    function: Callable[..., Any] = getattr(import_module(_SHOWN_BY), name)
    return function
