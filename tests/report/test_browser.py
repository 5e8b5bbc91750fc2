"""Report and comparison in a browser: headless Chromium opens it as a user does, from a file."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from chromium import DESKTOP, PATIENCE_MS, PHONE, Opened, colour, ink, playwright
from found import FAULT_FREE, UNUSABLE
from kinertia.estimation.result.mean_cycles import profiles_by_task
from kinertia.io.norms_file import Norm
from kinertia.model.bsp import BodySegmentParameters
from kinertia.motion.model_outputs import CLINICAL_ANGLES
from kinertia.motion.spatiotemporal import MEASURES
from kinertia.report.comparison.side_by_side import render_comparison
from kinertia.report.pages.page import render
from report_page import without_plotly

SWITCHED = """plot => {
    const panel = plot.closest(".panel");
    if (!panel) return null;
    const siblings = [...panel.parentElement.children].filter(other => other.classList.contains("panel"));
    return [panel.parentElement.querySelector("input").name, siblings.indexOf(panel)];
}"""
"""Name of the choice that shows a plot, and which of its answers; null for a plot that always shows."""

SMALLEST_LETTERS_PX = 11
POINTS_PER_PX = 0.75
PAPER_PX = 703
"""Width of A4 between its margins of 12 mm."""

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", params=["demo", pytest.param("gait2354", marks=pytest.mark.measured)])
def opened(request, browser, demo_run):
    """The reports that every check of drawing and silence goes over."""
    folder = demo_run[1] if request.param == "demo" else request.getfixturevalue("fit_of")("gait2354").folder
    report = Opened(browser, folder / "report.html")
    yield report
    report.page.close()


def test_nothing_goes_wrong_and_nothing_is_asked_for(opened):
    assert opened.errors == []
    outside = [url for url in opened.requests if not url.startswith(("data:", "blob:"))]
    assert outside == [opened.page.url]


def test_every_plot_is_drawn(opened):
    plots = opened.page.locator(".plot").all()
    assert len(plots) >= 5
    for plot in plots:
        name = plot.get_attribute("id")
        if choice := plot.evaluate(SWITCHED):
            opened.page.locator(f"[name={choice[0]}]").nth(choice[1]).check()
        assert plot.locator(".trace").count() > 0, name
        pixels = opened.picture(plot)
        assert ink(pixels) > 0.005, name
        assert colour(pixels) > 0.0005, name


def test_every_curve_has_a_path(demo):
    lines = demo.page.locator("#trial1-coordinates .cartesianlayer .js-line")
    paths = lines.evaluate_all("lines => lines.map(line => line.getAttribute('d') || '')")
    assert len(paths) == 4 * 27, "before and after, and the two edges of the band"
    assert min(len(path) for path in paths) > 100


def test_a_page_without_data_would_be_found_blank(demo):
    """The measures above tell a drawn plot from an empty one."""
    demo.page.evaluate(
        "Plotly.newPlot(Object.assign(document.body.appendChild(document.createElement('div')), {id: 'empty'}), [], {})"
    )
    empty = demo.page.locator("#empty")
    assert colour(demo.picture(empty)) < 0.0005
    empty.evaluate("element => element.remove()")


# --- table, width, print


def column(page, number):
    cells = page.locator(f"#bsp-table tbody td:nth-child({number})")
    return cells.evaluate_all("cells => cells.map(cell => Number(cell.dataset.sort))")


def test_table_sorts_by_pointer_and_keyboard(demo):
    heading = demo.page.locator("#bsp-table thead th").filter(has_text="estimate")
    heading.locator("button").click()
    assert heading.get_attribute("aria-sort") == "ascending"
    values = column(demo.page, 3)
    assert len(values) == 120
    assert values == sorted(values)
    heading.locator("button").focus()
    demo.page.keyboard.press("Enter")
    assert heading.get_attribute("aria-sort") == "descending"
    assert column(demo.page, 3) == values[::-1]
    words = demo.page.locator("#bsp-table thead th").filter(has_text="segment")
    words.locator("button").click()
    assert heading.get_attribute("aria-sort") is None
    names = demo.page.locator("#bsp-table tbody th").all_text_contents()
    assert names == sorted(names)


def test_table_shows_what_changed_and_products_of_inertia_when_asked(demo):
    rows = demo.page.locator("#bsp-table tbody tr")

    def seen(kind=""):
        return rows.locator("visible=true").and_(demo.page.locator(f"tr{kind}")).count()

    changed, products = (
        demo.page.locator(f"#bsp-all [data-filter={name}]") for name in ("only-changed", "with-products")
    )
    assert (seen(), seen(".product")) == (84, 0)
    products.check()
    assert (seen(), seen(".product")) == (120, 36)
    changed.check()
    assert seen() == seen(".changed") == rows.and_(demo.page.locator(".changed")).count()
    demo.page.evaluate("document.querySelector('#bsp-table tr.unchanged').classList.replace('unchanged', 'changed')")
    assert 0 < seen() == seen(".changed") < 120, "of the demo none need be beyond its error bars"
    for box in (changed, products):
        box.uncheck()
    assert seen() == 84


def test_panels_are_switched(demo):
    mass, information = (demo.page.locator(f"#body-{name}") for name in ("mass", "information"))
    playwright.expect(mass).to_be_visible()
    playwright.expect(information).not_to_be_visible()
    demo.page.get_by_role("radio", name="what the data show").check()
    playwright.expect(information).to_be_visible()
    playwright.expect(mass).not_to_be_visible()
    assert colour(demo.picture(information)) > 0.01
    demo.page.get_by_role("radio", name="what the data show").press("ArrowLeft")
    playwright.expect(mass).to_be_visible()


def test_page_fits_a_phone_and_then_a_desktop(browser, demo_run):
    """All panels below one another on a phone, three beside one another once the window is wider."""
    report = Opened(browser, demo_run[1] / "report.html", PHONE)
    page = report.page
    for viewport, beside, columns in ((PHONE, 1, 4), (DESKTOP, 3, 9)):
        page.set_viewport_size(viewport)
        page.wait_for_timeout(1500)
        assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]
        assert len(panel_places(page)) == 6
        assert len(set(panel_places(page))) == beside
        assert columns_seen(page) == columns
        assert covered_legends(page) == []
        assert cut_titles(page) == []
        assert wider_than_their_place(page) == []
    assert page.locator(".modebar-btn").count() == 0
    assert report.errors == []
    page.close()


def columns_seen(page):
    """How many columns of the table of parameters are there without scrolling, of nine."""
    rights = page.locator("#bsp-table thead th").evaluate_all(
        "cells => cells.map(cell => cell.getBoundingClientRect().right"
        " - cell.closest('.scroll').getBoundingClientRect().right)"
    )
    assert len(rights) == 9
    return sum(right <= 0 for right in rights)


def wider_than_their_place(page):
    return page.locator(".plot").evaluate_all(
        "plots => plots.filter(plot => plot.querySelector('.main-svg').clientWidth > plot.clientWidth + 1)"
        ".map(plot => plot.id)"
    )


def covered_legends(page):
    """Words of legends that a title lies on, or that leave their figure."""
    return page.locator(".plot").evaluate_all(
        """plots => plots.flatMap(plot => {
            const box = element => element.getBoundingClientRect();
            const titles = [...plot.querySelectorAll(".annotation")].map(box);
            const clash = text => titles.some(title => box(text).bottom > title.top + 4
                && box(text).right > title.left && box(text).left < title.right);
            return [...plot.querySelectorAll(".legendtext")].filter(
                text => clash(text) || box(text).right > box(plot).right + 1).map(text => plot.id + text.textContent);
        })"""
    )


def cut_titles(page):
    """Titles of panels that leave their figure."""
    return page.locator(".plot").evaluate_all(
        """plots => plots.flatMap(plot => [...plot.querySelectorAll(".annotation")].filter(
            title => title.getBoundingClientRect().right > plot.getBoundingClientRect().right + 1
        ).map(title => title.textContent))"""
    )


def panel_places(page):
    """Left edge of the title of each panel of the residuals, in steps of 20 px."""
    return page.locator("#trial1-residuals .annotation").evaluate_all(
        "notes => notes.map(note => Math.round(note.getBoundingClientRect().left / 20))"
    )


def test_print_draws_everything_in_the_width_of_the_paper(demo):
    demo.page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    widths = demo.page.locator(".plot .main-svg").evaluate_all("drawn => drawn.map(svg => svg.clientWidth)")
    assert set(widths) == {370, 580, 960}
    beside = demo.page.locator(".overview .plot .main-svg").evaluate_all("all => all.map(svg => svg.clientWidth)")
    assert set(beside) == {370, 580}, "body and changes share the width"
    assert demo.page.locator("details:not([open])").count() == 0
    demo.page.evaluate("window.dispatchEvent(new Event('afterprint'))")


def test_the_letter_is_two_pages_that_say_whose_they_are(demo):
    page = demo.page
    page.evaluate("window.print = () => {}")
    page.locator("details.print").evaluate("part => (part.open = true)")
    page.get_by_label("Laboratory").fill("Ward <5>")
    page.get_by_role("button", name="Letter, two pages").click()
    page.emulate_media(media="print")
    shown = page.locator("h2:visible, h3:visible").all_text_contents()
    headings = page.locator(".ident:visible").all_inner_texts()
    blank = page.locator(".paper .line:visible").count()
    scales = page.locator(".plot:visible").evaluate_all(
        "plots => plots.map(plot => Number(getComputedStyle(plot).zoom))"
    )
    page.emulate_media(media="null")
    assert len(scales) == 3
    assert min(scales) * SMALLEST_LETTERS_PX * POINTS_PER_PX > 5.5, "points, of the smallest letters"
    assert shown == ["Verdict", "Strides", "Joint angles", "Joint moments", "Joint powers", "What to do next"]
    assert len(headings) == 2
    assert all(
        "synthetic walker" in heading and "72.6 kg" in heading and "Laboratory: Ward <5>" in heading
        for heading in headings
    )
    assert blank >= 3
    assert pages(page, prefer_css_page_size=True) == 2
    assert page.locator("body.summary").count() == 0, "once it is printed, everything is there again"
    assert page.locator("#verdict + #next").count() == 1, "and where it was"
    assert pages(page, prefer_css_page_size=True) > 8


def pages(page, **paper):
    return len(re.findall(rb"/Type\s*/Page\b", page.pdf(**paper)))


@pytest.mark.parametrize(("findings", "norms"), [(FAULT_FREE, False), (UNUSABLE, False), (UNUSABLE, True)])
def test_the_letter_is_two_pages_whatever_was_found(browser, fit, tmp_path, findings, norms):
    """On A4 and on Letter; the three steps that come first are on it."""
    path = tmp_path / "report.html"
    path.write_text(page_of(replace(fit, findings=findings, rules=61), norms), encoding="utf-8")
    page = Opened(browser, path).page
    page.evaluate("window.print = () => {}")
    for paper in ({"prefer_css_page_size": True}, {"format": "Letter"}):
        page.locator("details.print").evaluate("part => (part.open = true)")
        page.get_by_role("button", name="Letter, two pages").click()
        page.emulate_media(media="print")
        steps = page.locator("#next ol li:visible").count()
        wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
        page.emulate_media(media="null")
        assert pages(page, **paper) == 2
        assert wide <= 0
        assert steps == (3 if findings is UNUSABLE else 0)
    page.close()


@pytest.mark.parametrize("viewport", [DESKTOP, PHONE])
def test_codes_lead_to_what_they_mean(browser, fit, tmp_path, viewport):
    path = tmp_path / "report.html"
    path.write_text(render(replace(fit, findings=UNUSABLE, rules=61)), encoding="utf-8")
    page = Opened(browser, without_plotly(path, tmp_path), viewport).page
    meaning = page.locator("#explain-P244")
    playwright.expect(meaning).not_to_be_in_viewport()
    page.evaluate("document.querySelectorAll('details').forEach((part) => (part.open = false))")
    page.locator("#next .steps a.code").first.click()
    playwright.expect(meaning).to_be_in_viewport()
    assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]
    page.close()


@pytest.mark.parametrize("viewport", [DESKTOP, PHONE])
@pytest.mark.parametrize(("findings", "norms"), [(FAULT_FREE, False), (FAULT_FREE, True), (UNUSABLE, False)])
def test_the_first_screen_has_what_may_be_used_and_why(browser, fit, tmp_path, findings, norms, viewport):
    """On a desktop what to do next, too, and within two screens all curves; everything is at most 8,000 px long."""
    path = tmp_path / "report.html"
    path.write_text(page_of(replace(fit, findings=findings, rules=61), norms), encoding="utf-8")
    page = browser.new_page(viewport=viewport)
    page.goto(path.as_uri())
    last = page.locator("#verdict .uses").bounding_box()
    assert last["y"] + last["height"] <= viewport["height"]
    assert page.locator("#verdict .level:visible").count() == 3
    assert page.locator("#verdict .uses li > :nth-child(3):visible").count() == 3
    assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]
    clipped = page.locator("nav a, .uses span, #cycle th, #cycle td, #moments th, #moments td").evaluate_all(
        "all => all.filter(one => one.offsetParent && one.getBoundingClientRect().right > innerWidth + 1).length"
    )
    assert clipped == 0
    page.wait_for_function("() => document.querySelector('#cycle-forces[data-drawn]')", timeout=PATIENCE_MS)
    assert page.evaluate("document.documentElement.scrollHeight") <= 8000
    if viewport is DESKTOP:
        assert bottom(page, "#next") <= viewport["height"]
        for part in ("cycle-clinical", "cycle-joint-moments", "cycle-powers", "cycle-forces"):
            assert bottom(page, f"#{part}") <= 2 * viewport["height"], part
    page.get_by_text("output by output, and why").click()
    assert page.locator("#outputs .level:visible").count() == 5
    page.close()


def page_of(fit, normed, **options):
    """A report, with norms of angles and strides or without any."""
    if not normed:
        return render(fit, **options)
    norms = {name: Norm(np.array([0.0, 100.0]), np.zeros(2), np.ones(2)) for name in CLINICAL_ANGLES}
    norms |= {name: Norm(np.zeros(1), np.zeros(1), np.full(1, 0.1)) for name in MEASURES}
    return render(fit, norms=norms, profiles=profiles_by_task(fit, norms), **options)


def bottom(page, part):
    box = page.locator(part).bounding_box()
    return box["y"] + box["height"]


@pytest.mark.parametrize("form", ["svg", "png", "csv"])
def test_figures_are_saved_by_a_button(demo, fit, form):
    with demo.page.expect_download() as saving:
        demo.page.locator(f'.save[data-of="cycle-moments"] button[data-form="{form}"]').click()
    saved = saving.value
    assert saved.suggested_filename == f"cycle-moments.{form}"
    path = Path(saved.path())
    if form == "png":
        assert path.read_bytes().startswith(b"\x89PNG")
    elif form == "svg":
        assert "Knee moment" in path.read_text(encoding="utf-8")
    else:
        assert_same_moments(pd.read_csv(path), fit.cycles())


def numbers_of(page, figure):
    with page.expect_download() as saving:
        page.locator(f'.save[data-of="{figure}"] button[data-form="csv"]').click()
    return pd.read_csv(saving.value.path())


def test_saved_numbers_of_error_bars_and_of_the_map_are_those_of_the_fit(demo, fit):
    changes = numbers_of(demo.page, "bsp-change")
    masses = changes[(changes.panel == "mass (kg)") & changes.curve.str.startswith("estimate")].set_index("y")
    ours = fit.bsp[fit.bsp.parameter == "mass"].set_index("segment")
    for segment, words in (("thigh_r", "thigh, right"), ("torso", "torso")):
        row = ours.loc[segment]
        assert masses.x[words] == pytest.approx(row.estimate - row.literature, rel=1e-5)
        assert masses.plus_minus[words] == pytest.approx(1.96 * row.sd, rel=1e-5)
    told = numbers_of(demo.page, "bsp-information").set_index(["y", "x"]).value
    assert len(told) == 120
    information = fit.bsp.set_index(["segment", "parameter"]).information
    assert told["thigh, right", "mass"] == round(100 * information["thigh_r", "mass"])
    assert told["shank, left", "CoM upward"] == round(100 * information["shank_l", "com_y"])
    assert "value" not in changes, "only where there is one"
    over_time = numbers_of(demo.page, "trial1-moments")
    assert over_time.curve.notna().all()


def assert_same_moments(table, cycles):
    """What is in the figure's CSV is what `fit.cycles` says, in single precision."""
    for side, word in (("r", "right"), ("l", "left")):
        curve = table[
            (table.panel == "Knee moment, flexion + (N m/kg)")
            & table.curve.isin([f"{word}, mean", f"{word}, one stride"])
        ]
        rows = cycles[(cycles.quantity == "knee_angle_moment") & (cycles.side == side)]
        assert curve.x.tolist() == list(range(101))
        np.testing.assert_allclose(curve.y, rows.groupby("percent").value.mean(), rtol=1e-5, atol=1e-6)


# --- comparison, dark mode


@pytest.fixture(scope="module")
def comparison(fit, tmp_path_factory):
    """The page that compares the demo's fit with itself, but for a heavier trunk."""
    table = fit.estimate.table().copy()
    table[1, 0] += 5.0 * fit.posterior.sd[1, 0]
    other = replace(fit, estimate=BodySegmentParameters.from_table(fit.estimate.segments, table))
    path = tmp_path_factory.mktemp("comparison") / "compare.html"
    path.write_text(render_comparison({"before": fit, "after": other}), encoding="utf-8")
    return path


@pytest.mark.parametrize("width", [390, 1400])
def test_comparison_is_drawn_fits_the_window_and_sorts(browser, comparison, width):
    opened = Opened(browser, comparison, {"width": width, "height": 900})
    page = opened.page
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.locator("#compare-moments .js-line").count() > 10
    assert colour(opened.picture(page.locator("#compare-moments"))) > 0.0005
    changed = page.locator("details", has_text="Changed").first
    assert changed.locator("tbody tr").all_inner_texts()[0].startswith("torso\tmass (kg)")
    everything = page.locator("details", has_text="Not shown to have changed").first
    heading = everything.locator("thead th", has_text="change").first
    heading.locator("button").click()
    assert heading.get_attribute("aria-sort") == "ascending"
    cells = everything.locator("tbody td:nth-child(5)").evaluate_all("cells => cells.map(cell => +cell.dataset.sort)")
    assert cells == sorted(cells)
    assert len(cells) == 120 - changed.locator("tbody tr").count()
    page.evaluate("document.querySelectorAll('details').forEach((part) => (part.open = false))")
    assert page.evaluate("document.documentElement.scrollHeight") <= 8000
    assert opened.errors == []
    assert [url for url in opened.requests if not url.startswith(("data:", "blob:"))] == [page.url]
    page.close()


def test_a_letter_with_norms_is_as_wide_as_the_paper(browser, fit, tmp_path):
    """The chart of gait scores was wider, so that the browser printed everything smaller."""
    path = tmp_path / "letter.html"
    path.write_text(page_of(fit, True, template="letter"), encoding="utf-8")
    page = Opened(browser, path).page
    page.set_viewport_size({"width": PAPER_PX, "height": 900})
    page.emulate_media(media="print")
    page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    assert page.locator("#map .trace").count() > 0
    assert page.evaluate("document.documentElement.scrollWidth") <= PAPER_PX
    page.emulate_media(media="null")
    assert pages(page, prefer_css_page_size=True) == 2
    page.close()


def test_a_letter_has_only_what_is_printed(browser, fit, tmp_path):
    path = tmp_path / "letter.html"
    path.write_text(render(fit, template="letter"), encoding="utf-8")
    opened = Opened(browser, path)
    page = opened.page
    page.evaluate("window.print = () => {}")
    assert page.locator(".plot:visible").count() == 3
    assert page.locator("#cycle-forces:visible, .save:visible, .paper:visible").count() == 0
    page.get_by_label("Laboratory").fill("Ward 5")
    for paper in ({"prefer_css_page_size": True}, {"format": "Letter"}):
        page.get_by_role("button", name="Print, two pages").click()
        page.emulate_media(media="print")
        assert page.locator(".paper .line:visible").count() == 3
        assert page.locator(".ident:visible").all_inner_texts()[0].count("Laboratory: Ward 5") == 1
        page.emulate_media(media="null")
        assert pages(page, **paper) == 2
    assert opened.errors == []
    page.close()
