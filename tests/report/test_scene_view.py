"""The 3-D view in a browser: it plays, is turned by pointer and keys, and shows what is chosen."""

import re

import numpy as np
import pytest

from chromium import Opened, colour, playwright
from report_page import without_plotly

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def demo(browser, demo_run, tmp_path_factory):
    """The report in a tab that the tests of this file share."""
    opened = Opened(browser, without_plotly(demo_run[1] / "report.html", tmp_path_factory.mktemp("view")))
    yield opened
    opened.page.close()


@pytest.fixture
def canvas(demo):
    demo.page.locator("#motion-view input[type=range]").evaluate(
        "slider => { slider.value = 0; slider.dispatchEvent(new Event('input')); }"
    )
    return demo.page.locator("#motion-view canvas")


BORDER = """canvas => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    const drawn = (x, y) => {
        const at = 4 * (y * canvas.width + x);
        const [r, g, b] = data.slice(at, at + 3);
        return data[at + 3] > 30 && !(r === g && g === b && r > 200);
    };
    let count = 0;
    for (let x = 0; x < canvas.width; x++) count += drawn(x, 0) + drawn(x, canvas.height - 1);
    for (let y = 0; y < canvas.height; y++) count += drawn(0, y) + drawn(canvas.width - 1, y);
    return count;
}"""
"""Pixels of the canvas's edge that have a colour, as limbs and ellipsoids have; lines of the floor are pale grey."""


@pytest.mark.parametrize(("width", "height"), [(900, 360), (260, 700)])
@pytest.mark.measured
def test_the_whole_body_is_in_view_from_every_side_that_has_a_key(browser, fit_of, tmp_path, width, height):
    """Of somebody without markers on the head, whose ellipsoid is above them all."""
    page = Opened(browser, without_plotly(fit_of("rajagopal").folder / "report.html", tmp_path)).page
    page.add_style_tag(content=f".view canvas {{ width: {width}px !important; height: {height}px !important; }}")
    view = page.locator("#motion-view")
    view.locator("[data-show=arrows]").uncheck()
    canvas = view.locator("canvas")
    page.wait_for_function(
        "([canvas, wide]) => Math.abs(canvas.width - wide) < 4", arg=[canvas.element_handle(), width]
    )
    canvas.focus()
    for key in "0123":
        page.keyboard.press(key)
        for share in (0, 0.3, 0.6, 1):
            view.locator("input[type=range]").evaluate(
                "(slider, share) => { slider.value = share * slider.max; slider.dispatchEvent(new Event('input')); }",
                share,
            )
            assert canvas.evaluate(BORDER) == 0, (key, share)
    page.close()


def frame(canvas):
    return int(canvas.get_attribute("data-frame"))


def test_view_plays_and_pauses(demo, canvas):
    before = demo.picture(canvas)
    assert colour(before) > 0.005
    button = demo.page.locator("#motion-view [data-do=play]")
    button.click()
    playwright.expect(button).to_have_text("Pause")
    playwright.expect(canvas).to_have_attribute("data-frame", re.compile(r"^([6-9]|\d\d+)$"))
    button.click()
    playwright.expect(button).to_have_text("Play")
    stopped = frame(canvas)
    assert stopped > 5
    assert (np.abs(demo.picture(canvas) - before).max(axis=2) > 0.3).mean() > 0.002
    demo.page.wait_for_timeout(200)
    assert frame(canvas) == stopped


def test_view_plays_in_real_time_and_starts_again(demo, canvas):
    """At full speed a second of the trial takes a second, whatever the number of frames, and the end leads back."""
    view = demo.page.locator("#motion-view")
    view.locator("select[data-set=speed]").select_option("1")
    seen = canvas.evaluate(
        """canvas => new Promise(resolve => {
            const seen = [], started = performance.now();
            const look = () => {
                seen.push([performance.now() - started, Number(canvas.dataset.frame)]);
                if (seen.at(-1)[0] < 1500) requestAnimationFrame(look); else resolve(seen);
            };
            document.querySelector("#motion-view [data-do=play]").click();
            look();
        })"""
    )
    view.locator("[data-do=play]").click()
    view.locator("select[data-set=speed]").select_option("0.5")
    times, frames = np.array(seen).T
    back = np.flatnonzero(np.diff(frames) < 0)
    until = back[0] + 1 if len(back) else len(frames)
    assert until > 10
    rate = np.polyfit(times[:until] / 1e3, frames[:until], 1)[0]
    assert rate == pytest.approx(100.0, rel=0.15)


def test_drawing_300_frames_is_quick_enough_for_60_a_second(demo, canvas):
    """Median time of one frame, so that a busy machine does not decide."""
    milliseconds = demo.page.locator("#motion-view input[type=range]").evaluate(
        """slider => {
            const spent = [];
            for (let k = 1; k <= 300; k++) {
                slider.value = k % (Number(slider.max) + 1);
                const started = performance.now();
                slider.dispatchEvent(new Event("input"));
                spent.push(performance.now() - started);
            }
            return spent.sort((a, b) => a - b)[150];
        }"""
    )
    assert milliseconds < 16


def test_view_is_scrubbed_and_turned_by_keyboard_and_pointer(demo, canvas):
    slider = demo.page.locator("#motion-view input[type=range]")
    slider.focus()
    for _ in range(3):
        demo.page.keyboard.press("ArrowRight")
    assert frame(canvas) == 3
    assert slider.get_attribute("aria-valuetext").endswith(" s")
    canvas.focus()
    for turn in (
        lambda: demo.page.keyboard.press("ArrowLeft"),
        lambda: demo.page.keyboard.press("ArrowUp"),
        lambda: drag(demo.page, canvas),
        lambda: demo.page.locator("#motion-view [data-do=right]").click(),
    ):
        before = demo.picture(canvas)
        turn()
        assert (np.abs(demo.picture(canvas) - before).max(axis=2) > 0.3).mean() > 0.001
    assert frame(canvas) == 3
    canvas.focus()
    demo.page.keyboard.press(" ")
    demo.page.wait_for_timeout(300)
    demo.page.keyboard.press(" ")
    assert frame(canvas) != 3


def drag(page, canvas):
    box = canvas.bounding_box()
    page.mouse.move(box["x"] + 200, box["y"] + 200)
    page.mouse.down()
    page.mouse.move(box["x"] + 260, box["y"] + 200)
    page.mouse.up()


def test_parts_of_the_view_are_switched_off(demo, canvas):
    boxes = demo.page.locator("#motion-view [data-show]")
    for box in boxes.all():
        before = demo.picture(canvas)
        box.uncheck()
        changed = np.abs(demo.picture(canvas) - before).max(axis=2) > 0.05
        assert changed.mean() > 1e-4, box.get_attribute("data-show")
    for box in boxes.all():
        box.check()
