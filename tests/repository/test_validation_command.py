"""`python -m validation`: which pages there are, and what stands on each about where it comes from."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from validation import page
from validation.__main__ import EVIDENCE, TOOLS, application

ROOT = Path(__file__).parents[2]


def test_help_lists_every_command_with_a_line():
    shown = CliRunner().invoke(application(), ["--help"], env={"COLUMNS": "80"}).output
    for name in ("all", *EVIDENCE, *TOOLS):
        assert re.search(rf" {name} +\w.*[.?] ", shown), f"{name}: more than a line"
    modules = {path.stem.replace("_", "-") for path in (ROOT / "validation").glob("*.py")}
    assert set(EVIDENCE) | set(TOOLS) <= modules


def test_a_command_is_run_from_the_repository():
    command = [sys.executable, "-m", "validation", "usual-build", "--help"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == 0, done.stderr
    assert "FOLDER" in done.stdout.upper()


def test_a_page_says_what_made_it_and_when(tmp_path, monkeypatch):
    monkeypatch.setattr(page, "PAGES", tmp_path)
    monkeypatch.setattr(page, "made_at", lambda: ("1234abcd", "2026-11-25"))
    page.write_page("speed", "# Speed\n\nMilliseconds.\n")
    line = "*Made by `python -m validation speed` on 2026-11-25, at commit 1234abcd; not edited by hand.*"
    assert (tmp_path / "speed.md").read_text(encoding="utf-8") == f"# Speed\n\n{line}\n\nMilliseconds.\n"


def test_a_part_of_a_page_is_replaced(tmp_path, monkeypatch):
    monkeypatch.setattr(page, "PAGES", tmp_path)
    monkeypatch.setattr(page, "made_at", lambda: ("1234abcd", "2026-11-25"))
    path = tmp_path / "populations.md"
    path.write_text(
        "# Populations\n\n<!-- populations -->\n\nold\n\n<!-- end -->\n\nWritten by hand.\n", encoding="utf-8"
    )
    page.write_part("populations", "new\n")
    part = f"{page.made_by('populations')}\n\nnew"
    text = f"# Populations\n\n<!-- populations -->\n\n{part}\n\n<!-- end -->\n\nWritten by hand.\n"
    assert path.read_text(encoding="utf-8") == text


def test_commit_and_day_are_those_of_the_checkout():
    if not (ROOT / ".git").exists():
        pytest.skip("needs a Git clone")
    commit, day = page.made_at()
    head = subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, encoding="utf-8", check=True)
    assert head.stdout.startswith(commit.split()[0])
    assert re.fullmatch(r"20\d\d-\d\d-\d\d", day)


def test_outside_git_no_commit_is_claimed(tmp_path, monkeypatch):
    monkeypatch.setattr(page, "REPOSITORY", tmp_path)
    assert page.made_at.__wrapped__()[0] == "unknown (not a Git clone)"


@pytest.mark.parametrize("name", EVIDENCE)
def test_every_page_is_stamped(name):
    text = (page.PAGES / f"{name}.md").read_text(encoding="utf-8")
    made = rf"Made by `python -m validation {name}` on 20\d\d-\d\d-\d\d, at commit [0-9a-f]{{8}}; not edited by hand"
    assert re.search(rf"^\*{made}\.\*$", text, re.MULTILINE)
