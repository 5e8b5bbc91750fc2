"""Every kind of page in a browser: accessible by axe's rules, silent, within its window, alone, and on paper."""

import io
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.image import imread

from chromium import DESKTOP, Opened, colour, playwright
from kinertia.checks.files import PersonFiles, check_files, files_by_name
from kinertia.model.bsp import PARAMETERS
from kinertia.report.check_page import save_check_page
from kinertia.report.comparison import render_comparison
from kinertia.report.page import render
from kinertia.report.plan_page import save_plan
from kinertia.report.rendering import _asset
from kinertia.report.result_page import Part, render_parts
from kinertia.report.row_figures import dot_figure
from kinertia.studies.plan import Plan

axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="needs axe (pip install -e '.[test]')")

pytestmark = pytest.mark.slow

SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 10 10"><rect width="10" height="10" fill="#0072B2"/></svg>'
REPORTS = ("report", "three trials", "two-level")
PAGES = (*REPORTS, "comparison", "check", "plan", "study")
AROUND_FIGURES = {"exclude": [[".main-svg"]]}
"""What plotly draws is a picture to axe; the element around it has its text."""
ON_PAPER_PX = 1100
"""Width of a sheet at the resolution of a screen, with room to spare."""


@pytest.fixture(scope="module")
def pages(demo_run, fit, two_level, measured_walk, tmp_path_factory):
    """A page of every kind, made when it is first asked for."""
    folder = tmp_path_factory.mktemp("pages")

    def check():
        wanted = files_by_name([measured_walk / "static.c3d", measured_walk / "walk.c3d"])
        recordings, mistakes = check_files(PersonFiles(wanted))
        return save_check_page(recordings, [], [*mistakes, "lost.trc: no such file"], folder / "check")

    def plan():
        prior = np.ones((2, len(PARAMETERS)))
        sd = {("walk",): 0.4 * prior, ("squat",): 0.9 * prior, ("walk", "squat"): 0.3 * prior}
        return save_plan(Plan(("shank_r", "shank_l"), prior, sd), folder / "plan") / "plan.html"

    def written(name, text):
        (folder / name).write_text(text, encoding="utf-8")
        return folder / name

    made = {
        "report": lambda: demo_run[1] / "report.html",
        "three trials": lambda: written("three.html", render(three_times(fit))),
        "two-level": lambda: demo_run[1] / "two-level" / "report.html",
        "comparison": lambda: written("compare.html", render_comparison({"one": fit, "two": two_level})),
        "check": check,
        "plan": plan,
        "study": lambda: written("study.html", study_page()),
    }
    return {name: make() for name, make in made.items()}


def without_plotly(path, folder):
    """A copy of a report that draws no curves: that takes most of the time, and other tests look at them."""
    page = path.read_text(encoding="utf-8")
    whole = _asset("plotly/plotly-basic.min.js")
    assert whole in page
    copy = folder / path.name
    copy.write_text(page.replace(whole, "const Plotly = {newPlot() {}, relayout() {}};"), encoding="utf-8")
    return copy


def three_times(fit):
    """The fit as if its trial were three."""
    kinematics = fit.trials[0].kinematics
    trials = tuple(
        replace(fit.trials[0], kinematics=replace(kinematics, trial=replace(kinematics.trial, name=name)))
        for name in ("walk 1", "walk 2", "walk 3")
    )
    noise = fit.posterior.marker_noise * 3
    return replace(fit, trials=trials, posterior=replace(fit.posterior, marker_noise=noise))


def study_page():
    dots = dot_figure(["one", "two"], {"error (N m)": {"before": [2.0, 1.0], "after": [1.0, 0.5]}}, "Errors.")
    table = {"headings": ("", "before", "after"), "rows": [["one", "2", "1"], ["two", "1", "0.5"]]}
    parts = [
        Part("Figure", ("Said above.",), dots, "A caption.", **table),
        Part("Picture", picture=SVG, alt="A square.", caption="A caption.", listed=("One.", "Two.")),
    ]
    return render_parts("A study", "Of something.", parts)


def shot(page):
    """Pixels (h, w, 3), 0 to 1, of what is in the window."""
    return imread(io.BytesIO(page.screenshot()), format="png")[..., :3]


@pytest.mark.parametrize(("width", "scheme"), [(1400, "light"), (390, "dark")])
@pytest.mark.parametrize("name", PAGES)
def test_page(browser, pages, name, width, scheme, tmp_path):
    path = pages[name]
    assert path.stat().st_size < 3_000_000
    if name in REPORTS:
        path = without_plotly(path, tmp_path)
    opened = Opened(browser, path, {"width": width, "height": 900}, scheme)
    page = opened.page
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert (shot(page)[:20, :20].mean() < 0.35) == (scheme == "dark")
    found = axe.Axe().run(page, AROUND_FIGURES).response
    told = [f"{one['id']}: {[node['target'] for node in one['nodes'][:3]]}" for one in found["violations"]]
    assert told == []
    assert len(found["passes"]) > 15
    assert opened.errors == []
    assert [url for url in opened.requests if not url.startswith(("data:", "blob:"))] == [path.as_uri()]
    page.emulate_media(media="print")
    page.set_viewport_size({"width": ON_PAPER_PX, "height": 900})
    assert page.evaluate("document.documentElement.scrollWidth") <= ON_PAPER_PX
    assert page.locator("button:visible:not(th *), nav:visible, input:visible").count() == 0
    assert shot(page)[:20, :20].min() > 0.99, "white paper in either scheme"
    page.close()


def test_axe_would_find_what_is_wrong(browser, tmp_path):
    (tmp_path / "bad.html").write_text(
        '<!doctype html><html><head><title>bad</title></head><body><img src="data:,"><button></button>'
        '<p style="color:#bbb;background:#fff">faint</p></body></html>',
        encoding="utf-8",
    )
    opened = Opened(browser, tmp_path / "bad.html")
    found = {one["id"] for one in axe.Axe().run(opened.page).response["violations"]}
    assert {"html-has-lang", "image-alt", "button-name", "color-contrast"} <= found
    opened.page.close()


def test_one_view_shows_the_trial_that_is_chosen_and_zooms_by_key_and_button(browser, pages, tmp_path):
    opened = Opened(browser, without_plotly(pages["three trials"], tmp_path))
    page = opened.page
    assert page.locator("canvas").count() == 1
    view, canvas = page.locator("#motion-view"), page.locator("#motion-view canvas")
    assert colour(opened.picture(canvas)) > 0.005
    view.get_by_label("Trial").select_option("walk 2")
    assert colour(opened.picture(canvas)) > 0.005
    canvas.focus()
    page.keyboard.press("+")
    assert canvas.get_attribute("data-zoom") == "1.250"
    view.get_by_role("button", name="Zoom out").click()
    assert canvas.get_attribute("data-zoom") == "1.000"
    page.keyboard.press("Tab")
    canvas.focus()
    page.keyboard.press(".")
    page.keyboard.press(".")
    assert canvas.get_attribute("data-frame") == "2"
    page.keyboard.press("End")
    assert int(canvas.get_attribute("data-frame")) > 50
    start = opened.picture(canvas)
    page.keyboard.press("1")
    front = opened.picture(canvas)
    page.keyboard.press("3")
    above = opened.picture(canvas)
    page.keyboard.press("0")
    np.testing.assert_array_equal(opened.picture(canvas), start)
    for one, other in ((start, front), (front, above)):
        assert (np.abs(one - other).max(axis=2) > 0.3).mean() > 0.005
    playwright.expect(canvas).to_be_focused()
    page.close()


def test_the_body_fills_the_view(browser, pages, tmp_path):
    """From top to bottom on a desktop, and on a phone as far as its width allows."""
    for viewport, least in ((DESKTOP, 0.85), ({"width": 390, "height": 844}, 0.6)):
        opened = Opened(browser, without_plotly(pages["report"], tmp_path), viewport)
        drawn = opened.picture(opened.page.locator("#motion-view canvas"))
        rows = np.flatnonzero((np.ptp(drawn, axis=2) > 0.15).any(axis=1))
        assert (rows[-1] - rows[0]) / len(drawn) > least
        opened.page.close()
