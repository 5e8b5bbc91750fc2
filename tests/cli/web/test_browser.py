"""The page in a browser: headless Chromium drops files on it and reads the verdict, as a user does."""

import re
import shutil
import sys
import zipfile
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")
pytest.importorskip("uvicorn", reason="needs the extra app (pip install -e '.[test]')")
from app_server import running
from app_tab import Tab, with_everything
from chromium import DESKTOP, PATIENCE_MS, PHONE, picture, playwright
from command_line import fitted
from kinertia.cli.web import work
from kinertia.cli.web.entries import recognise
from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.measures_file import measures_sheet
from kinertia.io.subject_file import read_subject
from kinertia.report.saved_fit import load_fit

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


def test_plug_in_gait_from_dropping_to_the_verdict_and_as_on_the_command_line(tab, tmp_path, c3d_lab):
    folder = tmp_path / "Subject A"
    folder.mkdir()
    for name in ("static.c3d", "walk.c3d"):
        shutil.copyfile(c3d_lab / name, folder / name)
    (folder / "letter.pdf").write_text("not for Kinertia")
    tab.drop(folder)
    playwright.expect(tab.page.locator(".problems")).to_contain_text("a '.pdf' file is none that Kinertia reads")
    tab.page.get_by_role("link", name="Go on").click()
    tab.arrived()
    assert tab.page.get_by_role("heading", level=1).inner_text() == "Subject A"
    playwright.expect(tab.page.locator(".message.warning")).to_contain_text("lacks 'sex'")
    tab.fill(sex="male", mass="72,6", height="1.803").check().checked()
    playwright.expect(tab.page.locator("section[aria-labelledby=check] .headline")).to_be_in_viewport()
    verdict = tab.estimate().verdict()
    theirs = load_fit(fitted(tmp_path / "out", c3d_lab / "subject.toml").folder)
    ours = load_fit(tab.person().results)
    assert (ours.estimate.table() == theirs.estimate.table()).all()
    assert verdict.lower() == ours.overview.line
    with tab.page.expect_download() as download:
        tab.page.get_by_role("link", name="Save all results (zip)").click()
    assert download.value.suggested_filename == "Subject A.zip"
    with tab.page.expect_download() as download:
        tab.page.get_by_text("The subject file, with all entries").click()
        tab.page.get_by_role("link", name="Save subject.toml").click()
    assert Path(download.value.path()).read_bytes() == tab.person().subject.read_bytes()
    tab.quiet()


def test_a_folder_is_dragged_onto_the_page_and_an_archive_is_refused(tab, tmp_path, c3d_lab):
    folder = tmp_path / "Dragged"
    folder.mkdir()
    for name in ("static.c3d", "walk.c3d"):
        shutil.copyfile(c3d_lab / name, folder / name)
    tab.drag(folder).arrived()
    assert tab.page.get_by_role("heading", level=1).inner_text() == "Dragged"
    assert tab.page.get_by_label("static.c3d is used as").input_value() == "static"
    with zipfile.ZipFile(tmp_path / "session.zip", "w") as archive:
        archive.write(c3d_lab / "walk.c3d", "walk.c3d")
    tab.page.get_by_text("Add files").click()
    tab.drag(tmp_path / "session.zip")
    said = "session.zip: not taken: an archive is not unpacked here; unpack it, and drop the folder"
    playwright.expect(tab.page.locator(".problems")).to_contain_text(said)
    tab.quiet()


def test_nobody_stays_in_the_library_of_whom_no_file_was_taken(browser, app, tmp_path):
    before = {person.name for person in app.library.people()}
    (tmp_path / "only.pdf").write_text("not for Kinertia")
    tab = Tab(browser, app).home().drop(tmp_path / "only.pdf")
    playwright.expect(tab.page.locator("[role=status]")).to_have_text("No file was taken.")
    playwright.expect(tab.page.locator(".problems")).to_contain_text("only.pdf: not taken")
    assert {person.name for person in app.library.people()} == before
    tab.quiet()


@pytest.mark.parametrize(
    ("names", "person"),
    [
        (("subject04_static.trc", "subject04_walk_1.trc", "subject04_walk_2.trc"), "subject04"),
        (("Eva Berg static.trc", "Eva Berg walk.trc"), "Eva Berg"),
        (("standing.trc", "w1.trc", "carla.toml"), "carla"),
        (("static.trc", "w1.trc", "subject.toml"), "Person"),
        (("walk_1.trc", "walk_2.trc"), "Person"),
    ],
)
def test_a_person_is_called_as_the_files_are(browser, tmp_path, names, person):
    for name in names:
        (tmp_path / name).write_text("no markers")
    with running(tmp_path / "library") as own:
        tab = Tab(browser, own).home().drop(*(tmp_path / name for name in names)).arrived()
        assert tab.page.get_by_role("heading", level=1).inner_text() == person
        tab.quiet()


def test_a_measured_segment_and_a_rucksack_are_entered_in_the_form(tab, c3d_lab):
    tab.drop(c3d_lab / "walk.c3d", c3d_lab / "static.c3d").arrived().fill(sex="male", mass="72.6", height="1.803")
    page = tab.page
    page.get_by_text("Segments that were measured").click()
    page.get_by_label("Segment", exact=True).first.fill("thigh_r")
    page.locator("[name='segment:0:mass_kg']").fill("4,9")
    page.get_by_label("Marker set").select_option("plug-in-gait")
    page.get_by_label("Population").select_option("child")
    page.get_by_label("Age (years)").fill("11")
    tab.check()
    assert 'like "8.9 +- 0.4"' in tab.message()
    page.locator("[name='segment:0:mass_kg']").fill("4,9 +- 0,4")
    page.get_by_text("What is worn or carried").click()
    for name, text in (("name", "rucksack"), ("segment", "torso"), ("mass_kg", "unknown"), ("com_mm", "-150 250 0")):
        page.locator(f"[name='attached:0:{name}']").fill(text)
    page.get_by_label("On the scale, too").first.select_option("no")
    tab.check().checked()
    wanted = read_subject(tab.person().subject)
    assert (wanted.subject.age_years, wanted.subject.population) == (11.0, "child")
    assert wanted.model.markers == "plug-in-gait"
    assert wanted.segments["thigh_r"].mass_kg == (4.9, 0.4)
    assert wanted.attached[0].mass_kg is None
    tab.quiet()


def test_the_demos_laboratory_files_to_the_verdict(tab, demo_run):
    lab = demo_run[1] / "lab"
    tab.drop(
        *(path for path in sorted(lab.iterdir()) if path.suffix in (".trc", ".mot")), lab / "subject.toml"
    ).arrived()
    assert tab.page.get_by_label("static.trc is used as").input_value() == "static"
    tab.text(lambda text: re.sub(r"(markers = \"walk.trc\".*)", "\\1\nwindow_s = [1.1, 1.4]", text))
    tab.checked().estimate()
    tab.verdict()
    tab.quiet()


def test_a_walk_with_a_model_to_the_verdict(tab, measured_folder):
    files = ("motion_capture_walk.trc", "grf_walk.mot", "grf_walk.xml", "scaled.osim")
    tab.drop(*(measured_folder / "rajagopal_walk" / name for name in files)).arrived()
    assert tab.page.get_by_label("scaled.osim is used as").input_value() == "osim"
    text = "[subject]\nmass_kg = 85.0\n[model]\nosim = 'scaled.osim'\n[[trial]]\nmarkers = 'motion_capture_walk.trc'\n"
    text += "forces = 'grf_walk.mot'\nloads = 'grf_walk.xml'\nwindow_s = [0.85, 1.15]\n"
    tab.text(lambda _: text)
    tab.checked().estimate()
    tab.verdict()
    assert tab.person().results.joinpath("model_changes.csv").is_file()
    tab.quiet()


def test_what_was_entered_is_kept_when_files_come_or_go_and_on_other_pages(tab, tmp_path, c3d_lab):
    folder = tmp_path / "Anna"
    folder.mkdir()
    for name in ("static.c3d", "walk.c3d"):
        shutil.copyfile(c3d_lab / name, folder / name)
    (folder / "list.csv").write_text("a,b\n1,2\n")
    tab.drop(folder).arrived()
    tab.fill(sex="male", mass="41,5")
    tab.page.get_by_role("button", name="Remove list.csv").click()
    playwright.expect(tab.page.get_by_text("list.csv")).to_have_count(0)
    sex, mass = tab.page.get_by_label("Sex"), tab.page.get_by_label("Body mass (kg)")
    playwright.expect(sex).to_have_value("male")
    playwright.expect(mass).to_have_value("41.5")
    mass.fill("42")
    tab.page.get_by_text("Add files").click()
    tab.page.get_by_label("Choose files").set_input_files(
        {"name": "other.csv", "mimeType": "text/csv", "buffer": b"a,b\n1,2\n"}
    )
    playwright.expect(tab.page.get_by_role("button", name="Remove other.csv")).to_be_visible()
    playwright.expect(mass).to_have_value("42.0")
    mass.fill("43")
    tab.page.get_by_role("link", name="Markers", exact=True).click()
    tab.page.wait_for_url("**/markers")
    tab.page.go_back()
    tab.page.reload()
    playwright.expect(mass).to_have_value("43.0")
    mass.fill("heavy")
    tab.page.get_by_role("button", name="Remove other.csv").click()
    playwright.expect(tab.page.locator(".message.error")).to_contain_text("heavy")
    playwright.expect(mass).to_have_value("heavy")
    playwright.expect(tab.page.get_by_role("button", name="Remove other.csv")).to_be_visible()
    tab.quiet()


def test_a_form_in_which_nobody_typed_is_not_sent(tab, c3d_lab):
    """What the page came with is compared with what stands there, in fields of every kind."""
    tab.drop(c3d_lab / "walk.c3d", c3d_lab / "static.c3d").arrived()
    kept = []
    tab.page.on("request", lambda request: request.url.endswith("/keep") and kept.append(request.url))
    tab.page.reload()
    tab.page.get_by_role("link", name="Markers", exact=True).click()
    tab.page.wait_for_url("**/markers")
    assert not kept
    tab.page.go_back()
    tab.page.reload()
    tab.page.get_by_label("Height (m)").fill("1.7")
    tab.page.get_by_role("link", name="Markers", exact=True).click()
    tab.page.wait_for_url("**/markers")
    assert len(kept) == 1
    tab.quiet()


def test_a_wrong_mass_is_said_in_place(tab, c3d_lab):
    tab.drop(c3d_lab / "walk.c3d", c3d_lab / "static.c3d").arrived().fill(
        sex="male", mass="7260", height="1.803"
    ).check()
    assert "S102" in tab.message()
    assert tab.page.get_by_role("button", name="Estimate", exact=True).count() == 0
    tab.fill(mass="heavy").check()
    assert "'heavy' is not a number; write it like 72.6" in tab.message()
    assert tab.page.get_by_label("Body mass (kg)").input_value() == "heavy"
    tab.fill(mass="70").check().checked()
    found = tab.page.locator(".findings")
    playwright.expect(found).to_contain_text("S103")
    tab.quiet()


def test_a_static_trial_may_be_missing(tab, c3d_lab):
    tab.drop(c3d_lab / "walk.c3d").arrived().fill(sex="male", mass="72.6", height="1.803").check().checked()
    playwright.expect(tab.page.get_by_role("button", name="Estimate", exact=True)).to_be_visible()
    tab.quiet()


def test_a_file_that_is_no_motion_is_said_in_place(tab, tmp_path, c3d_lab):
    (tmp_path / "broken.c3d").write_bytes(b"this is no motion" * 100)
    tab.drop(tmp_path / "broken.c3d", c3d_lab / "static.c3d").arrived()
    tab.fill(sex="male", mass="72.6", height="1.803").check()
    playwright.expect(tab.page.locator(".message.error")).to_contain_text("F103")
    assert "broken.c3d" in tab.message()
    tab.quiet()


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
    monkeypatch.setattr(work, "WORKER", (sys.executable, "-c", "pass"))
    person = app.library.add("Keyboard")
    with_everything(person, c3d_lab)
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
    monkeypatch.setattr(work, "WORKER", (sys.executable, "-c", "pass"))
    person = app.library.add("Rows by keyboard")
    for path in (*c3d_lab.glob("*.c3d"), c3d_lab / "subject.toml"):
        shutil.copyfile(path, person.folder / path.name)
    (person.folder / "measures.csv").write_text(measures_sheet(), encoding="utf-8")
    tab = Tab(browser, app)
    page = tab.page
    page.goto(f"{app.address}people/{quote(person.name)}")
    press(page, "measures.csv is used as", "w")
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


def test_an_unknown_marker_is_assigned_by_a_click(tab, app, c3d_lab):
    person = app.library.add("Unknown marker")
    for path in (*c3d_lab.glob("*.c3d"), c3d_lab / "subject.toml"):
        shutil.copyfile(path, person.folder / path.name)
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
    person = app.library.add("Pointed at")
    for path in (*c3d_lab.glob("*.c3d"), c3d_lab / "subject.toml"):
        shutil.copyfile(path, person.folder / path.name)
    tab.page.add_init_script(WRITTEN)
    tab.page.goto(f"{app.address}people/{quote(person.name)}/markers")
    canvas = tab.page.locator("canvas")
    tab.page.get_by_label("labels", exact=True).uncheck()
    assert {one["text"] for one in tab.page.evaluate("window.written")} == {"LFIN", "RFIN"}
    dark = np.argwhere(picture(canvas).max(axis=2) < 0.15)
    chosen = dark[np.abs(dark - dark[0]).max(axis=1) < 6]
    y, x = chosen.mean(axis=0)
    canvas.hover(position={"x": float(x), "y": float(y)})
    assert len(tab.page.evaluate("window.written")) == 3
    tab.quiet()


def test_pages_have_no_barriers_fit_a_phone_and_are_dark_where_the_system_is(browser, app, c3d_lab):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="needs axe-playwright-python")
    tab = Tab(browser, app).home()
    if app.library.person("Barrier-free") is None:
        with_everything(app.library.add("Barrier-free"), c3d_lab)
    for path in ("", "people/Barrier-free", "people/Barrier-free/markers", "compare", "people/nobody"):
        tab.page.goto(app.address + path)
        tab.page.evaluate("document.querySelectorAll('details').forEach((part) => (part.open = true))")
        for viewport, scheme in ((DESKTOP, "light"), (PHONE, "dark")):
            tab.page.set_viewport_size(viewport)
            tab.page.emulate_media(color_scheme=scheme)
            assert tab.page.evaluate("document.documentElement.scrollWidth") <= viewport["width"], path
            assert (picture(tab.page)[-20:, :10].mean() < 0.35) == (scheme == "dark")
            violations = axe.Axe().run(tab.page).response["violations"]
            found = [(one["id"], [node["target"] for node in one["nodes"]]) for one in violations]
            assert found == [], (path, viewport, scheme)
    tab.page.close()
