"""The markers in space, in a browser: assigned by a click, labels that can be read."""

import shutil
from urllib.parse import quote

import numpy as np
import pytest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")
pytest.importorskip("uvicorn", reason="needs the extra app (pip install -e '.[test]')")
from app_tab import Tab, ready
from chromium import DESKTOP, PHONE, picture, playwright
from kinertia.cli.web.entries import recognise
from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.subject.reader import read_subject

UNKNOWN = np.array([0xD5, 0x5E, 0x00]) / 255
"""Colour of markers without a place."""
WRITTEN = """
const write = CanvasRenderingContext2D.prototype.fillText, begin = CanvasRenderingContext2D.prototype.setTransform;
CanvasRenderingContext2D.prototype.setTransform = function (...all) {
  window.written = [];
  return begin.apply(this, all);
};
CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
  window.written.push({ text, x, y, wide: this.measureText(text).width });
  return write.call(this, text, x, y);
};
"""
"""Keeps what was last written on a canvas, and where."""
pytestmark = pytest.mark.slow


def test_an_unknown_marker_is_assigned_by_a_click(tab, app, c3d_lab):
    person = ready(app.library, "Unknown marker", c3d_lab)
    tab.page.goto(f"{app.address}people/{quote(person.name)}/markers")
    canvas = tab.page.locator("canvas")
    orange = np.argwhere(np.abs(picture(canvas) - UNKNOWN).max(axis=2) < 0.02)
    chosen = orange[np.abs(orange - orange[0]).max(axis=1) < 12]  # one of the dots
    y, x = chosen.mean(axis=0)
    canvas.click(position={"x": float(x), "y": float(y)})
    label = canvas.get_attribute("data-chosen")
    assert label in ("LFIN", "RFIN")
    side = {"L": "left", "R": "right"}[label[0]]
    place = tab.page.get_by_label(f"{label} moves with")
    playwright.expect(place).to_be_focused()
    place.select_option(f"{side} forearm")
    tab.page.get_by_role("button", name="Save as this person's marker set").click()
    tab.arrived()
    saved = read_marker_set(person.folder / "markers.toml")
    assert label in saved.segments[f"forearm_{label[0].lower()}"]
    assert read_subject(person.subject).model.markers == (person.folder / "markers.toml").resolve()
    tab.quiet()


def test_labels_of_markers_do_not_overprint_one_another(browser, app, measured_folder):
    files = ("motion_capture_walk.trc", "grf_walk.mot", "grf_walk.xml", "scaled.osim")
    person = app.library.add("Labels")
    for name in files:
        shutil.copyfile(measured_folder / "rajagopal_walk" / name, person.folder / name)
    recognise(person)
    for viewport in (DESKTOP, PHONE):
        tab = Tab(browser, app, viewport)
        tab.page.add_init_script(WRITTEN)
        tab.page.goto(f"{app.address}people/Labels/markers")
        playwright.expect(tab.page.locator("canvas[data-chosen]")).to_have_count(1)
        for _ in range(8):
            tab.page.get_by_role("button", name="Turn left").click()
            shown = tab.page.evaluate("window.written")
            assert len(shown) >= 20
            boxes = np.array([[box["x"], box["y"], box["x"] + box["wide"], box["y"] + 9] for box in shown])
            near = (boxes[:, None, :2] < boxes[None, :, 2:]).all(axis=2)
            assert (near & near.T).sum() == len(shown), "labels cover one another"
        tab.quiet()


def test_a_marker_tells_its_label_when_it_is_pointed_at(tab, app, c3d_lab):
    person = ready(app.library, "Pointed at", c3d_lab)
    tab.page.add_init_script(WRITTEN)
    tab.page.goto(f"{app.address}people/{quote(person.name)}/markers")
    canvas = tab.page.locator("canvas")
    tab.page.get_by_label("labels", exact=True).uncheck()
    assert {label["text"] for label in tab.page.evaluate("window.written")} == {"LFIN", "RFIN"}
    dark = np.argwhere(picture(canvas).max(axis=2) < 0.15)
    chosen = dark[np.abs(dark - dark[0]).max(axis=1) < 6]
    y, x = chosen.mean(axis=0)
    canvas.hover(position={"x": float(x), "y": float(y)})
    assert len(tab.page.evaluate("window.written")) == 3
    tab.quiet()
