"""Takes a report apart again."""

import base64
import gzip
import json
import re
from html.parser import HTMLParser

import numpy as np

from kinertia.report.figures.figure import packed_script

TRACE_TYPES = ("bar", "scatter", "scatter3d")
"""Types of traces that figures have; the last one in notebooks only."""


class Elements(HTMLParser):
    """Tags with their attributes, and the text outside of scripts and styles."""

    def __init__(self, page):
        super().__init__()
        self.tags, self.text, self._inside = [], "", None
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        self._inside = tag

    def handle_data(self, data):
        if self._inside not in ("script", "style"):
            self.text += data

    def handle_endtag(self, tag):
        self._inside = None

    def named(self, tag):
        return [attrs for name, attrs in self.tags if name == tag]


def figures_of(page):
    """The figures as plotly gets them, by the id of their element."""
    scripts = re.findall(r'<script type="text/plain" data-for="([^"]+)">(.*?)</script>', page)
    return {name: json.loads(gzip.decompress(base64.b64decode(text))) for name, text in scripts}


def numbers(array):
    """A plotly array, binary or not."""
    if isinstance(array, dict):
        return np.frombuffer(base64.b64decode(array["bdata"]), array["dtype"].replace("f", "<f").replace("i", "<i"))
    return np.asarray(array, dtype=float)


def without_plotly(path, folder):
    """A copy of a report that draws no curves: that takes most of the time, and other tests look at them."""
    page = path.read_text(encoding="utf-8")
    whole = packed_script()
    assert whole in page
    copy, nothing = folder / path.name, gzip.compress(b"const Plotly = {newPlot() {}, relayout() {}};")
    copy.write_text(page.replace(whole, base64.b64encode(nothing).decode()), encoding="utf-8")
    return copy
