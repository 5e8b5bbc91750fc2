"""The library: names, what survives the end of the process, copies and deletions."""

import json

import pytest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")
pytest.importorskip("uvicorn", reason="needs the extra app (pip install -e '.[test]')")

from hypothesis import given, settings
from hypothesis import strategies as st

from app_server import running
from kinertia.cli.web.jobs import Jobs
from kinertia.cli.web.library import Library, started
from kinertia.cli.web.person_page import standing
from kinertia.errors import FileError
from kinertia.findings.overview import Overview
from kinertia.io.file_names import fits_everywhere
from kinertia.io.subject.provenance import sha256
from kinertia.report.pages.finding_view import digest


@pytest.fixture
def library(tmp_path):
    return Library(tmp_path / "library")


@pytest.mark.parametrize(
    ("wanted", "name"),
    [
        ("Anna Maria", "Anna Maria"),
        ("Änne-2 (spring)", "Änne-2 (spring)"),
        ("../../etc", "etc"),
        ("C:\\lab\\Anna", "C lab Anna"),
        ("<b>Anna</b>", "b Anna b"),
        ("nul", "Person"),
        ("", "Person"),
        ("...", "Person"),
        ("x" * 300, "x" * 80),
    ],
)
def test_names_are_made_those_of_folders(library, wanted, name):
    person = library.add(wanted)
    assert person.name == name
    assert person.folder.parent == library.folder


@pytest.mark.slow
@settings(max_examples=30)
@given(st.text(max_size=100))
def test_any_name_makes_a_folder_in_the_library(tmp_path_factory, wanted):
    library = Library(tmp_path_factory.mktemp("any"))
    name = library.add(wanted).name
    assert fits_everywhere(name)
    assert [path.name for path in library.folder.iterdir()] == [name]


def test_nobody_is_overwritten(library):
    names = [library.add(name).name for name in ("Anna", "anna", "Anna")]
    assert names == ["Anna", "anna 2", "Anna 3"]


def test_a_renamed_person_keeps_everything(library):
    person, ben = library.add("Person"), library.add("Ben")
    (person.folder / "walk.c3d").write_bytes(b"content")
    person.note(saved=True)
    renamed = library.rename(person, "Anna Maria")
    assert (renamed.name, renamed.notes()) == ("Anna Maria", {"saved": True})
    assert (renamed.folder / "walk.c3d").read_bytes() == b"content"
    assert set(library.people()) == {renamed, ben}


@pytest.mark.parametrize(("wanted", "name"), [("../../etc", "etc"), ("ben", "ben 2"), ("PERSON", "PERSON")])
def test_a_new_name_is_made_one_of_a_folder_and_nobody_elses(library, wanted, name):
    person, ben = library.add("Person"), library.add("Ben")
    renamed = library.rename(person, wanted)
    assert renamed.name == name
    assert renamed.folder.parent == library.folder
    assert set(library.people()) == {renamed, ben}


@pytest.mark.parametrize("wanted", ["Person", " Person ", "", "...", "nul"])
def test_who_is_given_no_other_name_keeps_the_old_one(library, wanted):
    person = library.add("Person")
    assert library.rename(person, wanted) == person
    assert library.people() == [person]


def test_a_person_whose_file_is_open_elsewhere_keeps_the_name(library, monkeypatch):
    def refused(*_):
        raise OSError(13, "Permission denied")

    person = library.add("Person")
    monkeypatch.setattr("os.rename", refused)
    with pytest.raises(FileError, match="cannot be renamed"):
        library.rename(person, "Anna")
    assert library.people() == [person]


def test_folders_of_others_are_not_people(library):
    (library.folder / "Photos").mkdir()
    library.add("Anna")
    assert [person.name for person in library.people()] == ["Anna"]
    assert library.person("Photos") is None
    assert library.person("../library/Anna") is None


def test_what_was_not_finished_is_said_to_be_interrupted_and_what_was_stays(library):
    anna, ben = library.add("Anna"), library.add("Ben")
    anna.note(fit=started())
    ben.results.mkdir()
    (ben.results / "fit.json").write_text("{}")
    outcome = {
        "summary": sha256(ben.results / "fit.json"),
        **digest(Overview((), 61, 1)),
        "ended": 1.7e9,
    }
    (ben.results / "outcome.json").write_text(json.dumps(outcome))
    with library.opened():
        told = {person.name: standing(person, Jobs()) for person in library.people()}
    assert "Interrupted" in told["Anna"].sentence
    assert told["Ben"].sentence == "Use. No problems were found; the trial was used."
    assert told["Ben"].fitted
    assert told["Ben"].look == "info"
    (ben.results / "fit.json").write_text('{"kinertia": "of the command line"}')
    assert standing(ben, Jobs()).look == "", "what is told of other results is not told of these"


def test_a_record_that_is_broken_is_none(library):
    person = library.add("Anna")
    (person.folder / ".kinertia-person.json").write_text("{broken")
    assert library.people() == [person]
    assert person.notes() == {}


def test_deleting_takes_the_person_and_nobody_else(library):
    anna, ben = library.add("Anna"), library.add("Ben")
    library.delete(anna)
    assert library.people() == [ben]
    assert not list(library.folder.glob(".deleted*"))


def test_a_library_needs_a_folder(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match="is a file"):
        Library(tmp_path / "file")


def test_results_go_to_a_folder_of_the_users_and_among_no_others_files(tmp_path):
    with running(tmp_path / "library") as app:
        person = app.library.add("Anna")
        person.results.mkdir()
        for name in ("fit.npz", "fit.json", "report.html", ".kinertia.json"):
            (person.results / name).write_text('{"kinertia": "x"}')
        answer = app.post("/people/Anna/copy", f"folder={tmp_path / 'mine'}")
        assert answer.status == 200, answer.text
        assert (tmp_path / "mine" / "report.html").is_file()
        assert app.post("/people/Anna/copy", f"folder={tmp_path / 'mine'}").status == 200, "ours are replaced"
        (tmp_path / "others").mkdir()
        (tmp_path / "others" / "thesis.doc").touch()
        refused = app.post("/people/Anna/copy", f"folder={tmp_path / 'others'}")
        assert refused.status == 422
        assert "holds files that are not results of Kinertia (thesis.doc)" in refused.text
        assert "--overwrite" not in refused.text
        assert [path.name for path in (tmp_path / "others").iterdir()] == ["thesis.doc"]
        assert "give the full path" in app.post("/people/Anna/copy", "folder=mine").text
