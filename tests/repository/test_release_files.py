"""What a public repository has besides its code, as far as it can be seen without the public host."""

import re
import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest

import metadata

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
CHECKED = "3.11", "3.12", "3.13", "3.14"


def parts(text):
    return tuple(map(int, re.match(r"\d+(?:\.\d+)*", text).group().split(".")))


def test_files_for_archives_and_conda_are_those_that_the_citation_gives():
    """If not: `python release/metadata.py`."""
    for name, text in metadata.written().items():
        assert (ROOT / name).read_text(encoding="utf-8") == text, name


def test_citation_names_the_version_that_is_in_the_making_or_the_last():
    cited = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE).group(1)
    assert PROJECT["tool"]["hatch"]["version"]["fallback-version"] == f"{cited}.dev0"
    assert parts(version("kinertia")) >= parts(cited)


def test_the_address_stands_in_one_place():
    address = PROJECT["project"]["urls"]["Homepage"]
    written = {ROOT / name for name in metadata.written()}
    texts = [*ROOT.glob("*.*"), *(ROOT / ".github").rglob("*.*"), *(ROOT / "docs").glob("*.md")]
    assert all(url.startswith(address) for url in PROJECT["project"]["urls"].values())
    files = [path for path in texts if path.is_file() and path.name != "pyproject.toml" and path not in written]
    assert [path.name for path in files if address.encode() in path.read_bytes()] == []


def test_every_supported_python_is_a_classifier_and_tested():
    classifiers = [
        classifier.split(" :: ")[-1] for classifier in PROJECT["project"]["classifiers"] if "Python :: 3." in classifier
    ]
    assert tuple(classifiers) == CHECKED
    quick = (ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8")
    assert "python: [" + ", ".join(f'"{python}"' for python in CHECKED) + "]" in quick


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_actions_are_pinned_by_hash_and_the_same_everywhere(path):
    used = re.findall(r"uses: (\S+)@(\S+)(?: # (v[\d.]+))?", path.read_text(encoding="utf-8"))
    assert used
    for action, at, named in used:
        assert re.fullmatch("[0-9a-f]{40}", at), action
        assert named, action
    everywhere = {
        (action, at) for other in WORKFLOWS for action, at in re.findall(r"uses: (\S+)@(\S+)", other.read_text())
    }
    assert len({action for action, _ in everywhere}) == len(everywhere)


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_no_job_has_more_rights_or_time_than_it_needs(path):
    text = path.read_text(encoding="utf-8")
    assert "\npermissions: {}\n" in text
    jobs = re.split(r"^  (?=[a-z]+:$)", text.partition("\njobs:\n")[2], flags=re.MULTILINE)[1:]
    assert jobs
    assert all("timeout-minutes:" in job and "permissions:" in job for job in jobs)
    if path.name != "docs.yml":
        assert text.count("actions/checkout@") == text.count("persist-credentials: false")


def test_who_reads_the_licence_finds_the_same_one():
    assert PROJECT["project"]["license"] == "BSD-3-Clause"
    assert "license: BSD-3-Clause\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
