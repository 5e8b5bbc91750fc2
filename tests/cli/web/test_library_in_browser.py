"""The life of the page in a browser: several tabs, reloads, cancelled and crashed fits, the library, the end."""

import json
import shutil
import sys
from urllib.parse import quote

import pytest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")
pytest.importorskip("uvicorn", reason="needs the extra app (pip install -e '.[test]')")
from app_server import running
from app_tab import Tab, ready, with_everything
from chromium import DESKTOP, PHONE, playwright
from kinertia.cli.web import jobs

WAITING = "import json, sys, time\nprint(json.dumps({'stage': 'estimate', 'share': 0.3}), flush=True)\ntime.sleep(90)"
"""A fit that is not done before it is cancelled."""

pytestmark = pytest.mark.slow


@pytest.fixture
def waiting(monkeypatch, app, c3d_lab):
    """A person whose fit does not end by itself."""
    monkeypatch.setattr(jobs, "WORKER", (sys.executable, "-c", WAITING))
    return ready(app.library, "Waiting", c3d_lab)


def test_reload_second_tab_and_cancel_during_a_fit(browser, app, waiting):
    first, second = Tab(browser, app), Tab(browser, app)
    address = f"{app.address}people/{waiting.name}"
    first.page.goto(address)
    first.estimate()
    playwright.expect(first.page.locator("progress")).to_be_in_viewport()
    stage = first.page.locator("[data-stage]")
    playwright.expect(stage).to_have_text("estimate")
    playwright.expect(first.page.locator("[data-left]")).to_contain_text("left")
    assert first.page.get_by_label("Body mass (kg)").is_disabled() or first.page.locator("fieldset[disabled]").count()
    first.page.reload()
    playwright.expect(stage).to_have_text("estimate")
    second.home()
    playwright.expect(second.page.locator(".people li").filter(has_text=waiting.name)).to_contain_text("Fit: estimate")
    second.page.goto(address)
    playwright.expect(second.page.locator("progress")).to_have_attribute("value", "0.3")
    second.page.get_by_role("button", name="Cancel").click()
    for tab in (second, first):
        playwright.expect(tab.page.locator(".message.warning")).to_contain_text("Cancelled.")
        playwright.expect(tab.page.get_by_role("button", name="Estimate", exact=True)).to_be_visible()
        tab.quiet()


def test_a_fit_that_ends_repeats_no_form(browser, app, monkeypatch, tmp_path, c3d_lab):
    """A tab that shows the answer to a form shows the person's page when the fit is done."""
    go = tmp_path / "go"
    code = f"import os, time\nwhile not os.path.exists({str(go)!r}): time.sleep(0.05)"
    monkeypatch.setattr(jobs, "WORKER", (sys.executable, "-c", code))
    person = ready(app.library, "Copied", c3d_lab)
    person.results.mkdir()
    (person.results / "fit.json").write_text('{"kinertia": "x"}')
    tab = Tab(browser, app)
    page, sent = tab.page, []
    page.on("request", lambda request: request.method == "POST" and sent.append(request.url.rpartition("/")[2]))
    page.goto(f"{app.address}people/{person.name}")
    page.get_by_role("button", name="Estimate again").click()
    playwright.expect(page.locator("[data-progress]")).to_have_count(1)  # else the page that answers closes the list
    page.get_by_text("Single files, or into a folder").click()
    page.get_by_label("Folder on this computer").fill(str(tmp_path / "mine"))
    page.get_by_role("button", name="Write the results there").click()
    playwright.expect(page.locator(".message.info")).to_contain_text("The results are in")
    playwright.expect(page).to_have_url(f"{app.address}people/{person.name}")
    go.touch()
    playwright.expect(page.locator("[data-progress]")).to_have_count(0)
    playwright.expect(page).to_have_url(f"{app.address}people/{person.name}#outcome")
    page.reload()
    assert sent == ["fit", "copy"]
    page.close()


def test_a_crash_of_one_fit_is_said_and_the_next_one_is_done(browser, app, monkeypatch, c3d_lab):
    crash = "import os, sys\nif 'Crashing' in sys.argv[2]: os.abort()"
    monkeypatch.setattr(jobs, "WORKER", (sys.executable, "-c", crash))
    tab = Tab(browser, app)
    for name, said in (("Crashing", "Internal error of Kinertia"), ("Next", "")):
        tab.page.goto(f"{app.address}people/{ready(app.library, name, c3d_lab).name}")
        tab.estimate()
        playwright.expect(tab.page.locator("[data-progress]")).to_have_count(0)
        messages = tab.page.locator("section[aria-labelledby=results] .message.error")
        playwright.expect(messages).to_have_count(1 if said else 0)
        if said:
            assert said in tab.message()
            assert "failure.log" in tab.message()
    tab.quiet()


def test_results_are_listed_opened_again_compared_and_deleted(browser, demo_run, two_level_run, tmp_path):
    library = tmp_path / "library"
    with running(library) as server:
        for name, results in (("Spring", demo_run[1]), ("Autumn", two_level_run[1])):
            folder = server.library.add(name).results
            folder.mkdir()
            for file in ("fit.npz", "fit.json", "report.html"):
                shutil.copyfile(results / file, folder / file)
        tab = Tab(browser, server).home()
        page = tab.page
        assert page.locator(".people a").all_inner_texts() in (["Spring", "Autumn"], ["Autumn", "Spring"])
        page.get_by_role("link", name="Spring").click()
        report = page.frame_locator("iframe.report")
        playwright.expect(report.get_by_role("heading", name="synthetic walker")).to_be_visible()
        tab.home()
        for name in ("Spring", "Autumn"):
            page.get_by_label(f"Compare {name}").check()
        page.get_by_role("button", name="Compare the chosen").click()
        compared = page.frame_locator("iframe")
        playwright.expect(compared.get_by_role("columnheader", name="Autumn").first).to_be_visible()
        tab.home()
        page.get_by_label("Delete Autumn").click()
        page.get_by_role("button", name="Delete Autumn").click()
        playwright.expect(page.locator(".people a")).to_have_text(["Spring"])
        assert [path.name for path in library.iterdir() if not path.name.startswith(".")] == ["Spring"]
        tab.quiet()


def test_a_person_is_renamed_and_results_stay_those_of_the_files(tab, app, c3d_lab):
    person = with_everything(app.library, "Person to rename", c3d_lab)
    outcome = json.loads((person.results / "outcome.json").read_text())
    (person.results / "outcome.json").write_text(json.dumps({**outcome, "inputs": person.inputs}))
    tab.page.goto(f"{app.address}people/{quote(person.name)}")
    tab.page.get_by_text("Rename", exact=True).click()
    tab.page.get_by_label("Name in the library").fill("Eva (spring)")
    tab.page.get_by_label("Name in the library").press("Enter")
    playwright.expect(tab.page.get_by_role("heading", level=1)).to_have_text("Eva (spring)")
    results = tab.page.locator("section[aria-labelledby=results]")
    playwright.expect(tab.page.locator(".outlook .headline")).to_have_class("headline warning")
    playwright.expect(results.get_by_text("before your last change")).to_have_count(0)
    tab.quiet()


@pytest.mark.parametrize("viewport", [DESKTOP, PHONE])
def test_the_first_screen_has_what_may_be_used_and_what_to_do_next(browser, app, c3d_lab, viewport):
    person = with_everything(app.library, f"First screen {viewport['width']}", c3d_lab)
    outcome = json.loads((person.results / "outcome.json").read_text())
    moments = {"name": "Joint moments and powers", "use": "use with care", "reason": ""}
    current = {**outcome, "inputs": person.inputs, "purposes": [moments]}
    (person.results / "outcome.json").write_text(json.dumps(current))
    tab = Tab(browser, app, viewport)
    tab.page.goto(f"{app.address}people/{quote(person.name)}")
    first = tab.page.get_by_label("Outcome", exact=True)
    playwright.expect(first.locator(".purposes .level")).to_have_text(["use with care"])
    codes = [finding["code"] for finding in outcome["steps"]]
    assert codes
    assert len(codes) <= 3
    playwright.expect(first.locator("> .findings a")).to_have_text(codes)
    steps = first.locator("> .findings").bounding_box()
    assert steps["y"] + steps["height"] <= viewport["height"]
    tab.quiet()


def test_what_is_of_other_files_is_not_on_the_first_screen(tab, app, c3d_lab):
    person = with_everything(app.library, "Old outcome", c3d_lab)
    tab.page.goto(f"{app.address}people/{quote(person.name)}")
    playwright.expect(tab.page.get_by_text("before your last change").first).to_be_visible()
    playwright.expect(tab.page.get_by_label("Outcome", exact=True)).to_have_count(0)
    tab.quiet()


def test_a_report_reaches_nothing(browser, app, c3d_lab):
    """Whatever a file made a report say, it has no way to the page, the library or the network."""
    person = with_everything(app.library, "Curious report", c3d_lab)
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
    with running(tmp_path / "library") as server:
        tab = Tab(browser, server).home()
        tab.page.get_by_role("button", name="Close Kinertia").click()
        playwright.expect(tab.page.get_by_role("heading", name="Kinertia has ended")).to_be_visible()
        tab.page.close()
