"""Take the picture of `kinertia app`, `docs/figures/app.png`: the example's page in Chromium, with its report.

python docs/tools/app_picture.py
"""

import tempfile
from pathlib import Path

from playwright.sync_api import sync_playwright

from kinertia.cli.demo import write_measured_lab
from kinertia.cli.web.library import Library
from kinertia.cli.web.server import Server

PICTURE = Path(__file__).resolve().parents[1] / "figures" / "app.png"
_CHROMIUM = "/usr/bin/chromium"
_PATIENCE_MS = 300_000


def main() -> None:
    """Try the measured walk, and take the picture of its page."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as engine:
        server = Server(Library(Path(folder) / "Kinertia"), examples={"measured": write_measured_lab})
        with server.in_background() as address:
            browser = engine.chromium.launch(executable_path=_CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
            page = browser.new_page(viewport={"width": 1200, "height": 1840})
            page.set_default_timeout(_PATIENCE_MS)
            page.goto(address)
            page.get_by_role("button", name="Try it with a measured walk").click()
            page.wait_for_selector(".outlook .headline")
            page.get_by_role("button", name="Estimate", exact=True).click()
            page.get_by_role("link", name="Letter, to print").wait_for()
            page.goto(page.url.partition("#")[0].partition("?")[0])
            page.frame_locator("iframe.report").locator("#strides, #cycle").first.wait_for()
            page.evaluate("scrollTo(0, 0)")
            page.wait_for_timeout(3000)
            page.screenshot(path=str(PICTURE))
            browser.close()


if __name__ == "__main__":
    main()
