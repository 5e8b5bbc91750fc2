"""What `--help` shows of the commands, and `--version`."""

import re
from importlib.metadata import version

import pytest
import typer
from rich.text import Text

from command_line import run
from kinertia.cli.commands import application
from kinertia.diagnostics.result.residuals import FORCE, MOMENT, PEAK_FORCE_SHARE


@pytest.mark.parametrize(
    ("command", "words"),
    [("app", 'pip install ".[app]"'), ("instruments", "under [instruments]"), ("population", "under [prior]")],
)
def test_help_shows_what_stands_in_brackets(command, words):
    assert words in " ".join(run(command, "--help").out.split())


def test_help_has_no_other_markup_than_bold():
    """What else stands in brackets would not be shown."""

    def helps(command):
        yield command.help or ""
        yield from (getattr(param, "help", None) or "" for param in command.params)
        for child in getattr(command, "commands", {}).values():
            yield from helps(child)

    texts = list(helps(typer.main.get_command(application())))
    assert {str(span.style) for text in texts for span in Text.from_markup(text).spans} == {"bold"}


def test_version_and_help():
    assert run("--version").out.strip() == version("kinertia")
    shown = run("fit", "--help")
    assert shown.status == 0
    for word in ("--static", "--forces", "--loads", "--mass", "--height", "--sex", "--markers", "--method", "-o"):
        assert word in shown.out


def test_help_reads_like_a_manual():
    shown = run("--help")
    text = " ".join(shown.out.split())
    assert max(map(len, shown.out.splitlines())) <= 80
    steps = [text.index(f"kinertia {command} ") for command in ("demo", "init", "check", "fit")]
    assert steps == sorted(steps)
    for status in (
        "0 done",
        "1 done, but an ERROR was found",
        "2 nothing could be computed: errors in files or options, one line each",
        "70 internal error",
        "130 interrupted",
    ):
        assert status in text
    # the manual says what the rules do
    for limit in (*FORCE.acceptable, *MOMENT.acceptable, 100 * PEAK_FORCE_SHARE):
        assert f" {limit:g} " in text
    assert "no such option" in run("fit", "--nonsense").err.lower()


def test_help_begins_with_what_a_laboratory_needs_first():
    """The rest stands below, under a heading of its own."""
    shown = run("--help").out
    first = ("demo", "app", "init", "check", "fit", "compare", "export", "cohort", "explain")
    places = [shown.index(f"│ {name} ") for name in first]
    assert places == sorted(places)
    assert places[-1] < shown.index("─ More ─") < shown.index("│ markers ")


@pytest.mark.parametrize("command", ["demo", "init", "check", "fit", "study table1", "study sensitivity"])
def test_every_command_has_an_example_and_every_example_can_be_parsed(command):
    shown = " ".join(run(*command.split(), "--help").out.split())
    assert re.search(rf"Examples? kinertia {command}", shown)
    known = {*run(*command.split(), "--help").out.split()}
    for option in re.findall(r"--\w+", shown.split("Example", 1)[1].split("╭", 1)[0]):
        assert option in known
