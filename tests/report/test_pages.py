"""Every kind of page in a browser: accessible by axe's rules, silent, within its window, alone, and on paper."""

import functools
import io
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.image import imread

import study_results
from chromium import DESKTOP, VIOLATIONS, Opened, colour, playwright
from found import FAULTY, UNUSABLE
from kinertia.cohort.page import PAGE, write_cohort_page
from kinertia.report.comparison.side_by_side import render_comparison
from kinertia.report.pages.check_page import save_check_page
from kinertia.report.pages.page import render
from kinertia.report.pages.study_pages import render_crossval, render_plan, render_sensitivity
from kinertia.report.pages.table1 import render_table1, render_variants
from kinertia.settings import Subject
from kinertia.workflow.check import check_person, files_by_name, read_files
from kinertia.workflow.person import Person
from report_page import without_plotly
from study_results import HELD_OUT, PLAN

axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="needs axe (pip install -e '.[test]')")

pytestmark = pytest.mark.slow

REPORTS = ("report", "findings", "three trials", "two-level")
"""One page with other data: the first is looked at in all looks, the others in two."""
STUDIES = ("plan", "crossval", "cohort", "sensitivity", "table1", "variants")
"""Pages of one template."""
LOOKS = ((1400, "light"), (390, "light"), (390, "dark"), (1400, "dark"))
"""Widths of windows, and the system's colours in them."""
AROUND_FIGURES = {"exclude": [[".main-svg"]]}
"""What plotly draws is a picture to axe; the element around it has its text."""
COVERED = "words => words.filter(word => word.scrollWidth > word.clientWidth + 1).map(word => word.innerText)"
"""Words that what stands beside them lies on."""
ON_PAPER_PX = 1100
"""Width of a sheet at the resolution of a screen, with room to spare."""


@pytest.fixture(scope="module")
def pages(demo_run, two_level_run, fit, two_level, c3d_lab, tmp_path_factory):
    """A page of every kind, made when it is first asked for."""
    folder = tmp_path_factory.mktemp("pages")

    def check():
        files = files_by_name([c3d_lab / "static.c3d", c3d_lab / "walk.c3d"])
        checked = check_person(read_files(files, Person(Subject(name="person", mass_kg=80.0), ())))
        found = replace(checked.overview, findings=(*checked.findings, *FAULTY), left_out=("walk 2",))
        return save_check_page([found], checked.recordings, [], folder / "check")

    def cohort():
        (folder / "cohort").mkdir()
        study_results.write_cohort(fit, folder / "cohort")
        write_cohort_page(folder / "cohort")
        return folder / "cohort" / PAGE

    def written(name, text):
        (folder / name).write_text(text, encoding="utf-8")
        return folder / name

    made = {
        "report": lambda: demo_run[1] / "report.html",
        "findings": lambda: written("findings.html", render(replace(fit, findings=UNUSABLE, rules=61))),
        "three trials": lambda: written("three.html", render(three_times(fit))),
        "two-level": lambda: two_level_run[1] / "report.html",
        "comparison": lambda: written("compare.html", render_comparison({"one": fit, "two": two_level})),
        "check": check,
        "cohort": cohort,
        "plan": lambda: written("plan.html", render_plan(PLAN)),
        "crossval": lambda: written("crossval.html", render_crossval(HELD_OUT, "literature")),
        "sensitivity": lambda: written("sensitivity.html", render_sensitivity(study_results.sensitivity())),
        "table1": lambda: written("table1.html", render_table1(study_results.table1())),
        "variants": lambda: written("variants.html", render_variants(study_results.variants())),
    }
    return functools.cache(lambda name: made[name]())


def three_times(fit):
    """The fit as if its trial were three."""
    kinematics = fit.trials[0].kinematics
    trials = tuple(
        replace(fit.trials[0], kinematics=replace(kinematics, trial=replace(kinematics.trial, name=name)))
        for name in ("walk 1", "walk 2", "walk 3")
    )
    noise = fit.posterior.marker_noise * 3
    return replace(fit, trials=trials, posterior=replace(fit.posterior, marker_noise=noise))


def shot(page):
    """Pixels (h, w, 3), 0 to 1, of what is in the window, at the top of the page."""
    page.evaluate("scrollTo(0, 0)")
    return imread(io.BytesIO(page.screenshot()), format="png")[..., :3]


def few_rows(page):
    """Leave three rows of each kind in every table: the others are alike, and axe would look at each cell."""
    page.evaluate(
        """document.querySelectorAll("tbody").forEach((body) => {
            const seen = {};
            [...body.rows].forEach((row) => {
                seen[row.className] = (seen[row.className] ?? 0) + 1;
                if (seen[row.className] > 3) row.remove();
            });
        })"""
    )


def violations(page):
    """What axe finds, in one line each."""
    found = axe.Axe().run(page, AROUND_FIGURES, VIOLATIONS).response
    assert len(found["passes"]) > 15
    return [
        f"{violation['id']}: {[node['target'] for node in violation['nodes'][:3]]}" for violation in found["violations"]
    ]


def look(opened, width, scheme):
    """Show it in a window of this width, where it fits, in the system's colours."""
    opened.page.emulate_media(color_scheme=scheme)
    opened.page.set_viewport_size({"width": width, "height": 900})
    assert opened.page.evaluate("document.documentElement.scrollWidth") <= width
    assert opened.page.locator(".checks .level").evaluate_all(COVERED) == []
    assert (shot(opened.page)[:20, :20].mean() < 0.35) == (scheme == "dark")


def assert_alone_and_on_paper(opened):
    """Nothing was said or asked for, and print is white, within its width, and without what is pressed."""
    page = opened.page
    assert opened.errors == []
    assert [url for url in opened.requests if not url.startswith(("data:", "blob:"))] == [page.url]
    page.emulate_media(media="print")
    page.set_viewport_size({"width": ON_PAPER_PX, "height": 900})
    assert page.evaluate("document.documentElement.scrollWidth") <= ON_PAPER_PX
    assert page.locator("button:visible:not(th *), nav:visible, input:visible").count() == 0
    assert shot(page)[:20, :20].min() > 0.99, "white paper in either scheme"
    page.close()


def assert_good(opened, looks=LOOKS):
    """It fits with all that it holds; a few rows of each table are enough for axe."""
    for width, scheme in looks[:2]:
        look(opened, width, scheme)
    few_rows(opened.page)
    for width, scheme in looks:
        look(opened, width, scheme)
        assert violations(opened.page) == [], (width, scheme)


@pytest.mark.parametrize("name", [*REPORTS, "comparison", "check"])
def test_page(browser, pages, name, tmp_path):
    path = pages(name)
    assert path.stat().st_size < 3_200_000
    if name in REPORTS:
        path = without_plotly(path, tmp_path)
    opened = Opened(browser, path)
    assert_good(opened, LOOKS[::2] if name in REPORTS[1:] else LOOKS)
    assert_alone_and_on_paper(opened)


@pytest.mark.parametrize("name", STUDIES)
def test_page_of_a_study(browser, pages, name):
    opened = Opened(browser, pages(name))
    plots = opened.page.locator(".plot")
    assert plots.count() + opened.page.locator(".picture, img").count() > 0
    for plot in plots.all():
        assert colour(opened.picture(plot)) > 0.0005
    assert_good(opened)
    assert_alone_and_on_paper(opened)


def test_axe_would_find_what_is_wrong(browser, tmp_path):
    (tmp_path / "bad.html").write_text(
        '<!doctype html><html><head><title>bad</title></head><body><img src="data:,"><button></button>'
        '<p style="color:#bbb;background:#fff">faint</p></body></html>',
        encoding="utf-8",
    )
    opened = Opened(browser, tmp_path / "bad.html")
    found = {violation["id"] for violation in axe.Axe().run(opened.page, None, VIOLATIONS).response["violations"]}
    assert {"html-has-lang", "image-alt", "button-name", "color-contrast"} <= found
    opened.page.close()


def test_one_view_shows_the_trial_that_is_chosen_and_zooms_by_key_and_button(browser, pages, tmp_path):
    opened = Opened(browser, without_plotly(pages("three trials"), tmp_path))
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
    for before, other in ((start, front), (front, above)):
        assert (np.abs(before - other).max(axis=2) > 0.3).mean() > 0.005
    playwright.expect(canvas).to_be_focused()
    page.close()


def test_the_body_fills_the_view(browser, pages, tmp_path):
    """From top to bottom on a desktop, and on a phone as far as its width allows; least shares of height and width."""
    for viewport, high, wide in ((DESKTOP, 0.85, 0.33), ({"width": 390, "height": 844}, 0.6, 0.45)):
        opened = Opened(browser, without_plotly(pages("report"), tmp_path), viewport)
        drawn = opened.picture(opened.page.locator("#motion-view canvas"))
        inked = np.ptp(drawn, axis=2) > 0.15
        for axis, least in ((0, high), (1, wide)):
            seen = np.flatnonzero(inked.any(axis=1 - axis))
            assert (seen[-1] - seen[0]) / inked.shape[axis] > least
        opened.page.close()
