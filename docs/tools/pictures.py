"""Take the pictures of the pages: the tutorial's report with numbers on what the text explains, and figures for papers.

    PYTHONPATH=. python docs/tools/pictures.py

Needs Chromium and the measured files of the tutorial.
"""

import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from playwright.sync_api import Page, sync_playwright

import kinertia
from examples import ROOT, blocks, link_measured

FOLDER = ROOT / "docs" / "figures"
PAGES = {
    "report": ("report.html", "#verdict", [".headline", ".uses"], 1480, 900),
    "report-cycle": ("report.html", "#moments", ["#cycle-joint-moments", ".save button"], 1480, 600),
    "report-view": ("report.html", "#view", ["canvas", "#view .controls"], 1180, 920),
    "check": ("check.html", "#recording2", ["#recording2-forces", "#recording2-pressure"], 1180, 1060),
}
"""Picture: page, the part of it, what is numbered there, width, and height from its top in px."""
GALLERY = ("moments", "angles", "bsp")

_NUMBERED = """([part, marked]) => {
    const place = document.querySelector(part).getBoundingClientRect();
    marked.forEach((selector, k) => {
        const element = document.querySelector(part + " " + selector) ?? document.querySelector(selector);
        const box = element.getBoundingClientRect();
        const badge = document.body.appendChild(document.createElement("div"));
        badge.textContent = k + 1;
        badge.style = `position:absolute;left:${box.left + scrollX - 30}px;top:${box.top + scrollY}px;width:26px;`
            + "height:26px;border-radius:50%;background:#D55E00;color:#fff;font:bold 15px/26px sans-serif;"
            + "text-align:center;z-index:9";
    });
    scrollTo(0, place.top + scrollY - 10);
}"""

_UNDRAWN = (
    "[...document.querySelectorAll('.plot:not([data-drawn])')].some(plot => !plot.closest('details:not([open])'))"
)


def main() -> None:
    """Write all pictures."""
    tutorial = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
    with TemporaryDirectory() as made:
        link_measured("pig_c3d", Path(made))
        subject = Path(made) / "subject.toml"
        subject.write_text(next(block.text for block in blocks(tutorial) if block.file), encoding="utf-8")
        for command in ("check", "fit"):
            subprocess.run(["kinertia", command, subject, "-o", Path(made) / command, "--quiet"], check=True)
        with sync_playwright() as engine:
            browser = engine.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
            for name, (page, part, marked, width, height) in PAGES.items():
                opened = browser.new_page(viewport={"width": width, "height": height})
                opened.goto((Path(made) / ("fit" if page == "report.html" else "check") / page).as_uri())
                take(opened, part, marked, FOLDER / f"{name}.png")
            browser.close()
        fit = kinertia.load_fit(Path(made) / "fit")
        for name in GALLERY:
            fit.figure(name, FOLDER / f"gallery-{name}.svg")


def take(page: Page, part: str, marked: list[str], path: Path) -> None:
    """A picture of what is in the window, from the top of a part on, with numbers on what is marked."""
    page.evaluate(
        "part => document.querySelectorAll(part + '.more > details').forEach((one) => (one.open = true))", part
    )
    while page.evaluate(_UNDRAWN):
        page.wait_for_timeout(200)
    page.evaluate(_NUMBERED, [part, marked])
    page.wait_for_timeout(300)
    page.screenshot(path=path)


if __name__ == "__main__":
    main()
