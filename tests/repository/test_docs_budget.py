"""How much there is to read: at most sixteen pages and 20,000 words for users; front door and changelog stay short.

What counts: every page directly in `docs/`, tables and examples included. What does not: evidence (`validation.md` and
the folder `validation/`), functions and classes (`api.md` and `api/`, generated from docstrings) and `architecture.md`,
which is for developers. The pages of `findings/`, generated from the catalogue and looked up by code, count as one with
`findings.md`, their index, whose words count; theirs are those of `kinertia explain`.
"""

import re

import pytest

from examples import ROOT

USER_PAGES = sorted(
    page for page in (ROOT / "docs").glob("*.md") if page.stem not in ("validation", "api", "architecture")
)


def words(text: str) -> int:
    """Words of a page: what stands between spaces and has a letter or digit, comments left out."""
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    return sum(bool(re.search(r"[^\W_]", word)) for word in text.split())


def test_words_are_counted_as_a_reader_would():
    assert words("| a table | of six words |\n|---|---|\n<!-- mark -->\n## Heading") == 6


def test_users_read_at_most_sixteen_pages():
    assert 10 <= len(USER_PAGES) <= 16, [page.name for page in USER_PAGES]


def test_users_read_at_most_twenty_thousand_words():
    counted = {page.name: words(page.read_text(encoding="utf-8")) for page in USER_PAGES}
    assert sum(counted.values()) <= 20_000, counted


@pytest.mark.parametrize(("page", "most"), [("quickstart", 450), ("architecture", 2_000), ("validation", 1_000)])
def test_pages_that_must_be_short(page, most):
    assert words((ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")) <= most


@pytest.mark.parametrize(("name", "most"), [("README.md", 120), ("CHANGELOG.md", 60)])
def test_front_door_and_changelog_stay_short(name, most):
    assert len((ROOT / name).read_text(encoding="utf-8").splitlines()) <= most
