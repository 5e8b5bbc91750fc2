"""The pages against the program: every example runs, every table says what is there, every link leads somewhere."""

import re
import shlex
from importlib.util import find_spec
from pathlib import Path

import pandas as pd
import pytest
import typer

import findings
import house
import reference
import signs
from command_line import run
from examples import MEASURED, PAGES, ROOT, SYNTHETIC, blocks, difference, link_measured, renewed
from kinertia.cli.commands import application
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm, LoadTerm
from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.samples import NAME, SHA256
from kinertia.io.subject.reader import read_subject


def _examples():
    """Blocks that run, by page and folder: they run in order in a folder of their own."""
    groups = {}
    for page in PAGES:
        for block in blocks(page.read_text(encoding="utf-8")):
            if block.language in ("console", "python") or block.file:
                groups.setdefault((page, block.folder), []).append(block)
    return [
        pytest.param(group, folder, id=f"{page.stem}-{folder}", marks=_marks(group))
        for (page, folder), group in groups.items()
    ]


def _marks(group):
    measured = group[0].folder in MEASURED or _of_the_measured_demo(group)
    return [pytest.mark.slow] * group[0].slow + [pytest.mark.measured] * measured


def _of_the_measured_demo(group):
    return any("demo --measured" in block.text for block in group)


@pytest.fixture
def workshop(tmp_path, monkeypatch, request):
    """Makes an example's folder, with links to the measured files that it names."""

    def make(name):
        if name in MEASURED:
            request.getfixturevalue("measured_folder")
            link_measured(name, tmp_path)
        if name == SYNTHETIC:
            pytest.importorskip("qualisys_lab", exc_type=ImportError).write_qualisys_lab(tmp_path)
        monkeypatch.chdir(tmp_path)
        return tmp_path

    return make


@pytest.mark.parametrize(("group", "folder"), _examples())
def test_examples_run(group, folder, workshop, request):
    if _of_the_measured_demo(group):
        request.getfixturevalue("file_of")("gait2354/subject01_walk1.trc")
        request.getfixturevalue("sample_walk")
    workshop(folder)
    namespace = {}
    for block in group:
        if block.file:
            Path(block.file).write_text(block.text, encoding="utf-8")
            continue
        if block.language == "python":
            if "import opensim" in block.text and not find_spec("opensim"):
                continue
            exec(compile(block.text, f"example in {folder}", "exec"), namespace)
            continue
        for command, shown in block.commands():
            program, *arguments = shlex.split(command)
            assert program == "kinertia"
            outcome = run(*arguments)
            expected = 1 if "\nDo not use. " in f"\n{shown}" else 0
            assert outcome.status == expected, f"{command}\n{outcome.out}\n{outcome.err}"
            missing = difference(shown, outcome.out)
            assert missing is None, f"{command}\nshown on the page:\n{missing}\nreally:\n{outcome.out}"


def test_differences_of_outputs_are_seen():
    assert difference("a 1.0\n...\nb (2.5)", "x\na 1.1 ── c\nb (2.5)\ny") is None
    assert difference("a 1.0", "a 1.5") == "a 1.0"
    assert difference("b\n...\na", "a\nb") == "a"
    assert difference("mass 10.3*", "mass 10.3") == "mass 10.3*"


def test_numbers_on_pages_can_be_renewed():
    assert renewed("a 1.0\n...\nb (2.5)\n", "x\n a  7.0 \nc\nb (-3)\n") == " a  7.0\n...\nb (-3)\n"
    with pytest.raises(ValueError, match="b"):
        renewed("b 1", "a 1")


def test_subject_file_examples_are_valid(sample_walk, tmp_path):
    known = {}
    for name in SHA256:
        (tmp_path / name).symlink_to(sample_walk / NAME / name)
    for name in ("static.trc", "walk.trc", "walk_grf.mot", "squats.trc"):  # tests/workflow/test_functional_trial.py
        (tmp_path / name).touch()
    for block in blocks((ROOT / "docs" / "subject-file.md").read_text(encoding="utf-8")):
        assert block.language == "toml"
        path = tmp_path / f"example{len(known)}.toml"
        path.write_text(block.text)
        known[path] = read_subject(path) if "[subject]" in block.text else read_marker_set(path)
    assert len(known) == 3


@pytest.mark.parametrize("page", reference.PAGES, ids=lambda page: page.stem)
def test_generated_parts_are_up_to_date(page):
    text = page.read_text(encoding="utf-8")
    assert "<!-- generated: " in text
    assert reference.filled(text) == text, "run: python docs/tools/reference.py"


def test_pages_about_findings_are_up_to_date():
    pages = findings.pages()
    for page, text in pages.items():
        assert page.read_text(encoding="utf-8") == text, f"{page.name}: run python docs/tools/findings.py"
    assert set((ROOT / "docs" / "findings").iterdir()) == set(pages) - {ROOT / "docs" / "findings.md"}


def _command_lines(text):
    """What stands as a command line of Kinertia in code marks or code blocks."""
    spans = re.findall(r"(?<!`)`(kinertia [^`\n]+)`(?!`)", text)
    lines = re.findall(
        r"^(?:    |\$ )?(kinertia (?:[^\n]*\\\n)*[^\n]*)$", re.sub(r"^[^`\n]*[.;:]$", "", text), re.MULTILINE
    )
    return [line.replace("\\\n", " ") for line in (*spans, *lines)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_commands_and_options_named_exist(page):
    commands = dict(reference.commands())
    general = {name for param in typer.main.get_command(application()).params for name in param.opts} | {"--help"}
    for line in _command_lines(page.read_text(encoding="utf-8")):
        words = shlex.split(line, comments=True)
        name = max((name for name in commands if words[: name.count(" ") + 1] == name.split()), key=len, default=None)
        assert name or words[1].startswith("-"), f"no such command: {line}"
        known = {option for param in commands[name].params for option in param.opts} | {"--help"} if name else general
        assert {word for word in words if word.startswith("-")} <= known, line


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_and_files_named_exist(page):
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\((?!https?:|#)([^)#\s]+)", text):
        assert (page.parent / target).exists(), target
    for path in re.findall(r"`((?:src|docs|tests|examples|validation)/[\w./-]+)`", text):
        assert (ROOT / path).exists(), path


def _column(page, heading, column=1):
    """Words in code marks in a column of the table that follows a text of the page."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    table = re.search(r"(?:^\|.*\n)+", text[text.index(heading) :], re.MULTILINE)
    return [name for row in table[0].splitlines()[2:] for name in re.findall(r"`([^`]+)`", row.split("|")[column])]


def test_results_page_names_every_file_and_column(fit_of):
    fitted = fit_of("synthetic")
    written = {path.name for path in fitted.folder.glob("[!.]*")}
    assert set(_column("results.md", "<!-- files of kinertia fit -->")) == written
    assert _column("results.md", "## bsp.csv") == list(pd.read_csv(fitted.folder / "bsp.csv", nrows=1).columns)
    assert set(_column("results.md", "<!-- keys of fit.json -->")) == set(fitted.summary)
    assert set(_column("results.md", "<!-- keys of a trial -->")) == set(fitted.trial)
    assert _column("results.md", "<!-- columns of calibration -->") == list(fitted.summary["calibration"][0])


@pytest.mark.parametrize("joint", signs.JOINTS)
def test_the_pictures_of_signs_are_drawn_with_the_words_of_reports(joint):
    assert signs.picture(joint).read_text(encoding="utf-8") == signs.drawn(joint)
    assert f"figures/{signs.picture(joint).name}" in (ROOT / "docs" / "report.md").read_text(encoding="utf-8")
    for view in signs.JOINTS[joint]:
        for named in signs.directions(view).values():
            assert view.movement in named.values(), "the arrow is with the movement in one of the conventions"


def test_the_house_is_drawn_from_the_contract():
    assert house.PICTURE.read_text(encoding="utf-8") == house.drawn()
    assert house.PAGE.read_text(encoding="utf-8") == house.filled(house.PAGE.read_text(encoding="utf-8"))


def test_modules_named_on_the_page_about_architecture_exist():
    package = ROOT / "src" / "kinertia"
    rooms = "|".join(room for floor in house.layers() for room in floor)
    for name in re.findall(rf"`((?:{rooms})/[\w/]+)`", house.PAGE.read_text(encoding="utf-8")):
        assert (package / name).is_dir() or (package / f"{name}.py").is_file(), name


def test_the_page_about_architecture_names_every_hook_of_a_cost_term():
    """Those of `LoadTerm`, too, and none that is not there."""
    hooks = {name for kind in (CostTerm, LoadTerm) for name in vars(kind) if not name.startswith("_")} - {"unknowns"}
    where = {"LoadTerm", "calibration", "SimultaneousResult"}
    assert set(_column(house.PAGE.name, "| a term that ... |", column=2)) == hooks | where


def test_the_readme_counts_the_faults_of_their_page():
    page = (ROOT / "docs" / "validation" / "faults.md").read_text(encoding="utf-8")
    known = int(re.search(r"Each of (\d+) known ones was", page)[1])
    rows = re.search(r"(?:^\|.*\n)+", page[page.index("| fault |") :], re.MULTILINE)[0].splitlines()[3:-1]
    assert len(rows) == known
    assert f"[{known} faults, one at a time](docs/validation/faults.md)" in (ROOT / "README.md").read_text(
        encoding="utf-8"
    )
