"""Headless Chromium, which opens a page as a user does, from a file."""

import io
import os
from pathlib import Path

import numpy as np
import pytest

playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright (pip install -e '.[test]')")

CHROMIUM = Path(os.environ.get("CHROMIUM", "/usr/bin/chromium"))
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
DESKTOP, PHONE = {"width": 1400, "height": 900}, {"width": 390, "height": 844}
PATIENCE_MS = 120_000
VIOLATIONS = {"resultTypes": ["violations"]}
"""Option of axe: what is right is told with one element per rule. To tell of all takes most of the time."""
playwright.expect.set_options(timeout=PATIENCE_MS)


class Opened:
    """A report in a tab, with what it said and asked for."""

    def __init__(self, browser, path, viewport=None, scheme="light"):
        self.page = browser.new_page(viewport=viewport or DESKTOP, color_scheme=scheme)
        self.errors, self.requests = [], []
        # whatever is said: plotly.js warns in messages of type "trace"
        self.page.on("console", lambda message: self.errors.append(message.text))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(path.as_uri())
        self.page.evaluate("document.querySelectorAll('details').forEach((part) => (part.open = true))")
        # looks at every frame; `expect` looks once a second
        self.page.wait_for_function("() => !document.querySelector('.plot:not([data-drawn])')", timeout=PATIENCE_MS)

    def picture(self, locator):
        return picture(locator)


def picture(shown, **options):
    """Pixels (h, w, 3), 0 to 1, of a page or a part of one."""
    from matplotlib.image import imread  # takes longer to load than most tests

    return imread(io.BytesIO(shown.screenshot(**options)), format="png")[..., :3]


def ink(pixels):
    """Share of the pixels that are not white."""
    return float((pixels.min(axis=2) < 0.9).mean())


def colour(pixels):
    """Share of the pixels that are neither white, grey nor black: lines and markers, not axes and letters."""
    return float((np.ptp(pixels, axis=2) > 0.25).mean())
