"""Where a page of evidence goes, and the line on it that says what made it, at which commit and on which day."""

import subprocess
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
PAGES = REPOSITORY / "docs" / "validation"
_CODE = ("src", "validation", "pyproject.toml")
"""Paths that results depend on; changed pages, for example, do not count."""


def write_page(name: str, text: str, command: str | None = None) -> None:
    """Write PAGES/NAME.md: the text with `made_by` below its title; also print where it is.

    Args:
        name: name of the page.
        text: text of the page.
        command: command that made it; the name by default.
    """
    title, _, rest = text.partition("\n")
    path = PAGES / f"{name}.md"
    path.write_text(f"{title}\n\n{made_by(command or name)}\n{rest}", encoding="utf-8", newline="\n")
    print(f"written to {path}")


def write_part(name: str, text: str) -> None:
    """Replace what PAGES/NAME.md has between `<!-- NAME -->` and `<!-- end -->`, `made_by` first; print where it is."""
    path = PAGES / f"{name}.md"
    before, start, rest = path.read_text(encoding="utf-8").partition(f"<!-- {name} -->\n")
    _, end, after = rest.partition("<!-- end -->")
    content = f"{before}{start}\n{made_by(name)}\n\n{text.strip()}\n\n{end}{after}"
    path.write_text(content, encoding="utf-8", newline="\n")
    print(f"written to {path}")


def made_by(command: str) -> str:
    """Return the line of a page on the command that made it, with date and commit."""
    commit, day = made_at()
    return f"*Made by `python -m validation {command}` on {day}, at commit {commit}; not edited by hand.*"


@cache
def made_at() -> tuple[str, str]:
    """Return commit and day (UTC, ISO) of this process at the first call: a page takes hours to make.

    Uncommitted code is noted beside the commit; outside Git there is none.
    """
    day = datetime.now(UTC).date().isoformat()
    try:
        commit = _git("rev-parse", "--short=8", "HEAD")
        changed = _git("status", "--porcelain", "--", *_CODE)
    except (OSError, subprocess.CalledProcessError):
        return "unknown (not a Git clone)", day
    return f"{commit} with changes that are not committed" if changed else commit, day


def _git(*arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=REPOSITORY, capture_output=True, encoding="utf-8", check=True)
    return done.stdout.strip()
