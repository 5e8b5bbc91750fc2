"""plotly.js in reports: the installed one, compressed once, drawn from by every browser that can unpack it."""

import base64
import gzip
import os

import plotly.graph_objects as go
import pytest

from kinertia.report.figures import figure as figure_module
from kinertia.report.figures.figure import Figure, packed_script, script_path
from kinertia.report.pages.rendering import Part, render_parts
from report_page import TRACE_TYPES


@pytest.fixture
def cache(monkeypatch, tmp_path):
    """An empty folder in place of the one that keeps compiled functions."""
    folder = tmp_path / "cache"
    folder.mkdir()
    monkeypatch.setattr(figure_module, "cache_folder", lambda: folder)
    return folder


def test_it_is_the_installed_script():
    assert gzip.decompress(base64.b64decode(packed_script())) == script_path().read_bytes()


def test_it_is_compressed_once(cache, monkeypatch):
    first = packed_script()
    monkeypatch.setattr(gzip, "compress", lambda *given, **named: pytest.fail("compressed again"))
    assert packed_script() == first
    assert len(list(cache.iterdir())) == 1


def test_another_plotly_takes_its_place(cache, monkeypatch, tmp_path):
    packed_script()
    other = tmp_path / "plotly.min.js"
    other.write_text("another", encoding="utf-8")
    monkeypatch.setattr(figure_module, "script_path", lambda: other)
    assert gzip.decompress(base64.b64decode(packed_script())) == b"another"
    other.write_text("a third", encoding="utf-8")
    os.utime(other, (1.0, 1.0))
    assert gzip.decompress(base64.b64decode(packed_script())) == b"a third"
    assert len(list(cache.iterdir())) == 1


def test_where_nothing_can_be_kept(monkeypatch, tmp_path):
    monkeypatch.setattr(figure_module, "cache_folder", lambda: tmp_path / "missing")
    assert gzip.decompress(base64.b64decode(packed_script())) == script_path().read_bytes()


@pytest.mark.parametrize("kind", TRACE_TYPES)
def test_the_installed_plotly_has_the_types_of_traces_that_figures_use(kind):
    assert go.Figure([{"type": kind}]).data[0].type == kind
    assert f'name:"{kind}"' in script_path().read_text(encoding="utf-8")


def two_points(kind="scatter"):
    layout = {"height": 200, "meta": {"alt": "Two points, for a test of what draws them."}}
    return Figure([{"type": kind, "x": [0, 1], "y": [0, 1]}], layout)


@pytest.fixture
def page(tmp_path):
    path = tmp_path / "page.html"
    path.write_text(render_parts("A figure", "", [Part("Points", figure=two_points())]), encoding="utf-8")
    return path


def test_the_script_in_the_page_knows_the_types(browser, page):
    from chromium import Opened

    opened = Opened(browser, page)
    known = opened.page.evaluate("Object.keys(Plotly.PlotSchema.get().traces)")
    assert set(TRACE_TYPES) <= set(known)
    assert opened.errors == []
    assert opened.requests == [page.as_uri()]


def test_a_browser_that_is_too_old_says_so(browser, page):
    """With tables as ever, and without an error."""
    tab, errors = browser.new_page(), []
    tab.on("console", lambda message: errors.append(message.text))
    tab.on("pageerror", lambda error: errors.append(str(error)))
    tab.add_init_script("delete window.DecompressionStream")
    tab.goto(page.as_uri())
    note = tab.locator("main [role=alert]")
    assert "too old to draw the figures" in note.text_content()
    tab.get_by_role("button", name="CSV").click()
    assert errors == []
    tab.close()
