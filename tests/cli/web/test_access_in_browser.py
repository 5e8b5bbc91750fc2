"""The page for everybody: by the keyboard alone, without barriers, on a phone, in the dark."""

import sys
from urllib.parse import quote

import pytest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")
pytest.importorskip("uvicorn", reason="needs the extra app (pip install -e '.[test]')")
from app_tab import Tab, ready, with_everything
from chromium import DESKTOP, PATIENCE_MS, PHONE, VIOLATIONS, picture, playwright
from kinertia.cli.web import jobs
from kinertia.io.subject.body_files import measures_sheet
from kinertia.io.subject.reader import read_subject

pytestmark = pytest.mark.slow


def press(page, name, key="Enter", most=60):
    """Go to a control by the tab key alone, and press a key there. A page that has just begun to load has no focus."""
    for _ in range(most):
        page.keyboard.press("Tab")
        focused = page.evaluate(
            "() => { const on = document.activeElement; return on && (on.ariaLabel || (on.labels && on.labels[0] && "
            "on.labels[0].innerText) || on.innerText) || ''; }"
        )
        if focused.strip().startswith(name):
            page.keyboard.press(key)
            return
    raise AssertionError(f"no way to {name} by the keyboard")


def test_everything_is_reached_by_the_keyboard_alone(browser, app, monkeypatch, c3d_lab):
    monkeypatch.setattr(jobs, "WORKER", (sys.executable, "-c", "pass"))
    person = with_everything(app.library, "Keyboard", c3d_lab)
    tab = Tab(browser, app).home()
    page = tab.page
    for control in ("Choose files", "Choose a folder", "Try it with a synthetic person", "Compare Keyboard"):
        press(page, control, "Shift")
    press(page, "Keyboard")
    tab.arrived()
    press(page, "Sex", "f")
    assert page.get_by_label("Sex").input_value() == "female"
    # the page before has no progress either
    with page.expect_event("domcontentloaded", timeout=PATIENCE_MS):
        press(page, "Save and check")
    playwright.expect(page.locator("[data-progress]")).to_have_count(0)
    assert 'sex = "female"' in person.subject.read_text(encoding="utf-8")
    press(page, "Markers")
    page.wait_for_url("**/markers")
    press(page, "The markers in space", "ArrowLeft")
    press(page, "LFIN")
    assert page.locator("canvas").get_attribute("data-chosen") == "LFIN"
    assert page.evaluate("document.activeElement.name") == "segment:LFIN"
    tab.quiet()


def test_rows_of_the_form_are_filled_in_by_the_keyboard_alone(browser, app, monkeypatch, c3d_lab):
    monkeypatch.setattr(jobs, "WORKER", (sys.executable, "-c", "pass"))
    person = ready(app.library, "Rows by keyboard", c3d_lab)
    (person.folder / "measures.csv").write_text(measures_sheet(), encoding="utf-8")
    tab = Tab(browser, app)
    page = tab.page
    page.goto(f"{app.address}people/{quote(person.name)}")
    press(page, "measures.csv is used as", "b")
    press(page, "Population", "c")
    press(page, "Marker set", "p")
    for title, entries in (
        ("Segments that were measured", {"Segment": "thigh_r", "Mass (kg)": "4.9 +- 0.4", "Measured by": "DXA"}),
        (
            "What is worn or carried",
            {"Name": "rucksack", "Segment": "torso", "Mass (kg)": "unknown", "On the scale": "no", "CoM": "-150 250 0"},
        ),
    ):
        press(page, title)
        for label, text in entries.items():
            press(page, label, "Home")
            page.keyboard.type(text)
    press(page, "Save and check")
    playwright.expect(page.get_by_text("Segments that were measured (1)")).to_be_visible()
    wanted = read_subject(person.subject)
    assert wanted.prior.measures == (person.folder / "measures.csv").resolve()
    assert (wanted.subject.population, wanted.model.markers) == ("child", "plug-in-gait")
    assert (wanted.segments["thigh_r"].mass_kg, wanted.segments["thigh_r"].source) == ((4.9, 0.4), "DXA")
    assert (wanted.attached[0].name, wanted.attached[0].com_mm) == ("rucksack", (-150.0, 250.0, 0.0))
    tab.quiet()


def test_pages_have_no_barriers_fit_a_phone_and_are_dark_where_the_system_is(browser, app, c3d_lab):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="needs axe-playwright-python")
    tab = Tab(browser, app).home()
    if app.library.person("Barrier-free") is None:
        with_everything(app.library, "Barrier-free", c3d_lab)
    for path in ("", "people/Barrier-free", "people/Barrier-free/markers", "compare", "people/nobody"):
        tab.page.goto(app.address + path)
        tab.page.evaluate("document.querySelectorAll('details').forEach((part) => (part.open = true))")
        for viewport, scheme in ((DESKTOP, "light"), (PHONE, "dark")):
            tab.page.set_viewport_size(viewport)
            tab.page.emulate_media(color_scheme=scheme)
            assert tab.page.evaluate("document.documentElement.scrollWidth") <= viewport["width"], path
            assert (picture(tab.page)[-20:, :10].mean() < 0.35) == (scheme == "dark")
            violations = axe.Axe().run(tab.page, None, VIOLATIONS).response["violations"]
            found = [(violation["id"], [node["target"] for node in violation["nodes"]]) for violation in violations]
            assert found == [], (path, viewport, scheme)
    tab.page.close()
