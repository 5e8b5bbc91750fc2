"""The page in a browser: headless Chromium drops files on it and reads the verdict, as a user does."""

import io
import json
import re
import shutil
from pathlib import Path
from urllib.parse import quote, urlsplit

import numpy as np
import pytest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")
pytest.importorskip("uvicorn", reason="needs the extra app (pip install -e '.[test]')")
from app_server import running
from kinertia.cli.measured_demo import FILES
from kinertia.cli.web import jobs
from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.provenance import sha256
from kinertia.io.subject_file import read_subject
from kinertia.report.saved_fit import load_fit

playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright (pip install -e '.[test]')")

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking"]
DESKTOP, PHONE = {"width": 1400, "height": 1000}, {"width": 390, "height": 844}
PATIENCE_MS = 120_000
UNKNOWN = np.array([0xD5, 0x5E, 0x00]) / 255
"""Colour of markers without a place."""
WAITING = "import json, sys, time\nprint(json.dumps({'stage': 'estimate', 'share': 0.3}), flush=True)\ntime.sleep(90)"
"""A fit that is not done before it is cancelled."""

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def browser():
    if not CHROMIUM.exists():
        pytest.skip(f"needs {CHROMIUM} (apt-get install chromium)")
    with playwright.sync_playwright() as engine:
        started = engine.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        yield started
        started.close()


@pytest.fixture(scope="module")
def app(tmp_path_factory):
    with running(tmp_path_factory.mktemp("app") / "library", FILES) as served:
        yield served


class Tab:
    """A tab of the browser, with what went wrong in it and where its requests went."""

    def __init__(self, browser, app, viewport=None):
        self.app = app
        self.page = browser.new_page(viewport=viewport or DESKTOP)
        self.page.set_default_timeout(PATIENCE_MS)
        self.errors, self.hosts = [], set()
        self.page.on("console", lambda message: message.type in ("error", "warning") and self.heard(message.text))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", lambda request: self.hosts.add(urlsplit(request.url).netloc))

    def heard(self, text):
        """What Chromium itself says of an answer to wrong input is no error of the page's."""
        if "422 (Unprocessable Entity)" not in text:
            self.errors.append(text)

    def home(self):
        self.page.goto(self.app.address)
        return self

    def drop(self, *files):
        """Files for somebody new, who is called as the first of them or, of a folder, as it."""
        chosen = self.page.get_by_label("Choose a folder" if files[0].is_dir() else "Choose files")
        chosen.set_input_files([str(file) for file in files] if not files[0].is_dir() else str(files[0]))
        return self

    def arrived(self):
        self.page.wait_for_url("**/people/*")
        playwright.expect(self.page.get_by_role("heading", name="1. Files and person")).to_be_visible()
        return self

    def fill(self, **entries):
        for label, value in entries.items():
            field = self.page.get_by_label({"sex": "Sex", "mass": "Body mass (kg)", "height": "Height (m)"}[label])
            field.select_option(value) if label == "sex" else field.fill(value)
        return self

    def check(self):
        self.page.get_by_role("button", name="Save and check").click()
        return self

    def text(self, changed):
        """Change the text of the subject file."""
        self.page.get_by_text("The subject file, with all entries").click()
        field = self.page.get_by_label("Subject file", exact=True)
        field.fill(changed(field.input_value()))
        self.page.get_by_role("button", name="Save this text and check").click()
        return self

    def checked(self):
        playwright.expect(self.page.locator("section[aria-labelledby=check] .headline")).to_be_visible(
            timeout=PATIENCE_MS
        )
        playwright.expect(self.page.locator("[data-progress]")).to_have_count(0, timeout=PATIENCE_MS)
        return self

    def estimate(self):
        self.page.get_by_role("button", name="Estimate", exact=True).click()
        return self

    def verdict(self):
        """The headline on the page, which the report inside it has as well."""
        headline = self.page.locator("section[aria-labelledby=results] > .headline")
        playwright.expect(headline).to_be_visible(timeout=PATIENCE_MS)
        report = self.page.frame_locator("iframe.report").locator("#verdict .headline, .headline").first
        playwright.expect(report).to_have_text(headline.inner_text(), timeout=PATIENCE_MS)
        return headline.inner_text()

    def person(self):
        name = self.page.get_by_role("heading", level=1).inner_text()
        return self.app.library.person(name)

    def message(self):
        return self.page.locator(".message.fail").first.inner_text()

    def quiet(self):
        assert self.errors == []
        assert self.hosts == {urlsplit(self.app.address).netloc}
        self.page.close()


@pytest.fixture
def tab(browser, app):
    opened = Tab(browser, app).home()
    yield opened
    opened.page.close()


def test_plug_in_gait_from_dropping_to_the_verdict_and_as_on_the_command_line(tab, tmp_path, measured_demo):
    folder = tmp_path / "Subject A"
    folder.mkdir()
    for name in ("static.c3d", "walk.c3d"):
        shutil.copyfile(FILES / name, folder / name)
    (folder / "letter.pdf").write_text("not for Kinertia")
    tab.drop(folder)
    playwright.expect(tab.page.locator(".problems")).to_contain_text("a '.pdf' file cannot be checked; expected")
    tab.page.get_by_role("link", name="Go on").click()
    tab.arrived()
    assert tab.page.get_by_role("heading", level=1).inner_text() == "Subject A"
    playwright.expect(tab.page.locator(".message.caution")).to_contain_text("lacks 'sex'")
    tab.fill(sex="male", mass="41,5", height="1.61").check().checked().estimate()
    verdict = tab.verdict()
    ours, theirs = load_fit(tab.person().results), measured_demo.fit
    assert (ours.estimate.table() == theirs.estimate.table()).all()
    assert "Do not use" in verdict or "Usable" in verdict or "passed" in verdict
    with tab.page.expect_download() as download:
        tab.page.get_by_role("link", name="Save all results (zip)").click()
    assert download.value.suggested_filename == "Subject A.zip"
    with tab.page.expect_download() as download:
        tab.page.get_by_text("The subject file, with all entries").click()
        tab.page.get_by_role("link", name="Save subject.toml").click()
    assert Path(download.value.path()).read_bytes() == tab.person().subject.read_bytes()
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


def test_a_walk_with_a_model_to_the_verdict(tab, shared_data):
    files = ("motion_capture_walk.trc", "grf_walk.mot", "grf_walk.xml", "scaled.osim")
    tab.drop(*(shared_data / "rajagopal_walk" / name for name in files)).arrived()
    assert tab.page.get_by_label("scaled.osim is used as").input_value() == "osim"
    text = "[subject]\nmass_kg = 85.0\n[model]\nosim = 'scaled.osim'\n[[trial]]\nmarkers = 'motion_capture_walk.trc'\n"
    text += "forces = 'grf_walk.mot'\nloads = 'grf_walk.xml'\nwindow_s = [0.85, 1.15]\n"
    tab.text(lambda _: text)
    tab.checked().estimate()
    tab.verdict()
    assert tab.person().results.joinpath("model_changes.csv").is_file()
    tab.quiet()


def test_a_wrong_mass_is_said_in_place(tab):
    tab.drop(FILES / "walk.c3d", FILES / "static.c3d").arrived().fill(sex="male", mass="4150", height="1.61").check()
    assert "mass_kg = 4150" in tab.message()
    assert tab.page.get_by_role("button", name="Estimate", exact=True).count() == 0
    tab.fill(mass="heavy").check()
    assert "'heavy' is not a number; write it like 72.6" in tab.message()
    assert tab.page.get_by_label("Body mass (kg)").input_value() == "heavy"
    tab.fill(mass="70").check().checked()
    found = tab.page.locator(".findings")
    playwright.expect(found).to_contain_text("stated mass 70.0 kg")
    tab.quiet()


def test_a_missing_static_trial_is_said_in_place(tab):
    tab.drop(FILES / "walk.c3d").arrived().fill(sex="male").check()
    assert "[model] lacks 'static'" in tab.message()
    tab.quiet()


def test_a_file_that_is_no_motion_is_said_in_place(tab, tmp_path):
    (tmp_path / "broken.c3d").write_bytes(b"this is no motion" * 100)
    tab.drop(tmp_path / "broken.c3d", FILES / "static.c3d").arrived()
    tab.fill(sex="male", mass="41.5", height="1.61").check().checked()
    assert "broken.c3d" in tab.message()
    tab.quiet()


@pytest.fixture
def waiting(monkeypatch, app):
    """A person whose fit does not end by itself."""
    person = app.library.add("Waiting")
    for path in FILES.glob("*.c3d"):
        shutil.copyfile(path, person.folder / path.name)
    shutil.copyfile(FILES / "subject.toml", person.subject)
    monkeypatch.setattr(jobs, "WORKER", (jobs.sys.executable, "-c", WAITING))
    return person


def test_reload_second_tab_and_cancel_during_a_fit(browser, app, waiting):
    first, second = Tab(browser, app), Tab(browser, app)
    address = f"{app.address}people/{waiting.name}"
    first.page.goto(address)
    first.estimate()
    stage = first.page.locator("[data-stage]")
    playwright.expect(stage).to_have_text("estimate", timeout=PATIENCE_MS)
    playwright.expect(first.page.locator("[data-left]")).to_contain_text("left")
    assert first.page.get_by_label("Body mass (kg)").is_disabled() or first.page.locator("fieldset[disabled]").count()
    first.page.reload()
    playwright.expect(stage).to_have_text("estimate", timeout=PATIENCE_MS)
    second.home()
    playwright.expect(second.page.locator(".people li").filter(has_text=waiting.name)).to_contain_text("Fit: estimate")
    second.page.goto(address)
    playwright.expect(second.page.locator("progress")).to_have_attribute("value", "0.3")
    second.page.get_by_role("button", name="Cancel").click()
    for one in (second, first):
        playwright.expect(one.page.locator(".message.caution")).to_contain_text("Cancelled.", timeout=PATIENCE_MS)
        playwright.expect(one.page.get_by_role("button", name="Estimate", exact=True)).to_be_visible()
        one.quiet()


def press(page, name, key="Enter", most=60):
    """Go to a control by the tab key alone, and press a key there."""
    for _ in range(most):
        page.keyboard.press("Tab")
        focused = page.evaluate(
            "() => { const on = document.activeElement; return on.ariaLabel || (on.labels && on.labels[0] && "
            "on.labels[0].innerText) || on.innerText || ''; }"
        )
        if focused.strip().startswith(name):
            page.keyboard.press(key)
            return
    raise AssertionError(f"no way to {name} by the keyboard")


def test_everything_is_reached_by_the_keyboard_alone(browser, app, monkeypatch):
    monkeypatch.setattr(jobs, "WORKER", (jobs.sys.executable, "-c", "pass"))
    person = app.library.add("Keyboard")
    _with_everything(person)
    tab = Tab(browser, app).home()
    page = tab.page
    for control in ("Choose files", "Choose a folder", "Try it with a measured walk", "Compare Keyboard"):
        press(page, control, "Shift")
    press(page, "Keyboard")
    tab.arrived()
    press(page, "Sex", "f")
    assert page.get_by_label("Sex").input_value() == "female"
    press(page, "Save and check")
    playwright.expect(page.locator("[data-progress]")).to_have_count(0, timeout=PATIENCE_MS)
    assert 'sex = "female"' in person.subject.read_text(encoding="utf-8")
    press(page, "Markers")
    page.wait_for_url("**/markers")
    press(page, "The markers in space", "ArrowLeft")
    press(page, "LFIN")
    assert page.locator("canvas").get_attribute("data-chosen") == "LFIN"
    assert page.evaluate("document.activeElement.name") == "segment:LFIN"
    tab.quiet()


def test_an_unknown_marker_is_assigned_by_a_click(tab, app):
    person = app.library.add("Unknown marker")
    for path in (*FILES.glob("*.c3d"), FILES / "subject.toml"):
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


def picture(locator):
    """Pixels (h, w, 3), 0 to 1."""
    from matplotlib.image import imread

    return imread(io.BytesIO(locator.screenshot()), format="png")[..., :3]


@pytest.mark.parametrize("viewport", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_pages_have_no_barriers_and_fit_a_phone(browser, app, viewport):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="needs axe-playwright-python")
    tab = Tab(browser, app, viewport).home()
    if app.library.person("Barrier-free") is None:
        _with_everything(app.library.add("Barrier-free"))
    for path in ("", "people/Barrier-free", "people/Barrier-free/markers", "compare", "people/nobody"):
        tab.page.goto(app.address + path)
        tab.page.evaluate("document.querySelectorAll('details').forEach((part) => (part.open = true))")
        assert tab.page.evaluate("document.documentElement.scrollWidth") <= viewport["width"], path
        if viewport is PHONE:
            continue
        violations = axe.Axe().run(tab.page).response["violations"]
        assert [(one["id"], [node["target"] for node in one["nodes"]]) for one in violations] == [], path
    tab.page.close()


def _with_everything(person):
    """Files, findings and results, without computing any."""
    for path in (*FILES.glob("*.c3d"), FILES / "subject.toml"):
        shutil.copyfile(path, person.folder / path.name)
    person.check.mkdir()
    found = [{"title": "walk", "verdicts": [{"level": level, "sentence": "s"} for level in ("fail", "caution")]}]
    outcome = {"inputs": "", "mistakes": ["a file"], "advice": "more", "findings": found}
    (person.check / "outcome.json").write_text(json.dumps(outcome))
    person.results.mkdir()
    (person.results / "fit.json").write_text("{}")
    page = "<!doctype html><html lang=en><title>report</title><main><h1>report</h1></main>"
    (person.results / "report.html").write_text(page)
    outcome = {"inputs": "", "level": "caution", "headline": "Usable with care.", "ended": 1.7e9}
    outcome["summary"] = sha256(person.results / "fit.json")
    (person.results / "outcome.json").write_text(json.dumps(outcome))


def test_a_report_reaches_nothing(browser, app):
    """Whatever a file made a report say, it has no way to the page, the library or the network."""
    person = app.library.add("Curious report")
    _with_everything(person)
    tries = {
        "asked": "fetch(location.href.replace('results/report.html', 'subject.toml')).then(() => 'yes', () => 'no')",
        "out": "fetch('http://127.0.0.1:9/').then(() => 'yes', () => 'no')",
        "page": "(() => { try { return parent.document ? 'yes' : 'no'; } catch { return 'no'; } })()",
    }
    tab = Tab(browser, app)
    tab.page.goto(f"{app.address}people/{quote(person.name)}")
    tab.page.frame_locator("iframe.report").get_by_role("heading", name="report").wait_for()
    (frame,) = [frame for frame in tab.page.frames if frame.url.endswith("results/report.html")]
    assert {name: frame.evaluate(tried) for name, tried in tries.items()} == dict.fromkeys(tries, "no")
    assert any("Content Security Policy" in error for error in tab.errors)
    tab.page.close()


def test_it_ends_by_its_button_and_says_so(browser, tmp_path):
    with running(tmp_path / "library") as own:
        tab = Tab(browser, own).home()
        tab.page.get_by_role("button", name="Close Kinertia").click()
        playwright.expect(tab.page.get_by_role("heading", name="Kinertia has ended")).to_be_visible()
        tab.page.close()
