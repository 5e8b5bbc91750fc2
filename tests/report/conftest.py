"""The demo's report, as text and opened in a browser."""

import pytest

from kinertia.report.pages.page import render


@pytest.fixture(scope="session")
def page(fit):
    return render(fit)


@pytest.fixture(scope="module")
def demo(browser, demo_run):
    """The report in a tab that the tests of a file share."""
    from chromium import Opened

    opened = Opened(browser, demo_run[1] / "report.html")
    yield opened
    opened.page.close()
