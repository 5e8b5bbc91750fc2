"""The documentation's site: built once, and looked at."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import kinertia
from examples import PAGES, ROOT


@pytest.mark.slow
def test_site_is_whole_and_needs_no_network(tmp_path, request):
    for module in ("material", "mkdocstrings_handlers.python", "latex2mathml"):
        pytest.importorskip(module, reason='needs the documentation tools: pip install -e ".[docs]"')
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)]
    done = subprocess.run(
        command, cwd=ROOT, env=os.environ | {"NO_MKDOCS_2_WARNING": "1"}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    expect_every_page_without_equations_left_over(tmp_path)
    expect_nothing_from_the_network(tmp_path)
    expect_every_exported_name(tmp_path)
    expect_search_from_the_disk(tmp_path, request.getfixturevalue("browser"))


def expect_every_page_without_equations_left_over(site: Path) -> None:
    for page in PAGES[:-1]:
        built = site / page.relative_to(ROOT / "docs").with_suffix(".html")
        assert "arithmatex" not in built.read_text(encoding="utf-8")
    method = (site / "method.html").read_text(encoding="utf-8")
    assert method.count('<math xmlns="http://www.w3.org/1998/Math/MathML" display="block">') >= 5


def expect_nothing_from_the_network(site: Path) -> None:
    for page in site.rglob("*.html"):
        built = page.read_text(encoding="utf-8")
        for tag in re.findall(r"<(?:script|link|img|iframe)[^>]*>", built):
            assert not re.search(r'(?:src|href)="(?:https?:)?//', tag), f"{page.name}: {tag}"
    for style in site.rglob("*.css"):
        assert not re.search(r"url\([\"']?https?:", style.read_text(encoding="utf-8")), style.name


def expect_every_exported_name(site: Path) -> None:
    api_page = "".join(page.read_text(encoding="utf-8") for page in (site / "api").glob("*.html"))
    for name in kinertia.__all__:
        assert re.search(rf'id="kinertia\.[\w.]*{name}"', api_page), name
    assert (site / "search" / "search_index.json").is_file()


def expect_search_from_the_disk(site: Path, browser) -> None:
    from chromium import playwright

    page = browser.new_page()
    page.goto((site / "api" / "fit.html").as_uri())
    page.locator("input.md-search__input").press_sequentially("knee adduction")  # fill() releases no key
    first = page.locator(".md-search-result__link").first
    playwright.expect(first).to_have_attribute("href", re.compile(rf"{re.escape(site.as_uri())}/.+\.html"))
    page.close()
