"""The library: names, what survives the end of the process, copies and deletions."""

import asyncio
import http.client
import io
import json
import zipfile
from concurrent.futures import ThreadPoolExecutor
from urllib.parse import quote, urlsplit

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app_server import running
from kinertia.cli.web.jobs import Jobs
from kinertia.cli.web.library import (
    ENDINGS,
    LARGEST_FILE_MB,
    LARGEST_PERSON_MB,
    MOST_FILES,
    Library,
    harmless_name,
    receive,
    started,
)
from kinertia.cli.web.person_page import standing
from kinertia.errors import FileError
from kinertia.findings.overview import Overview
from kinertia.io.file_names import fits_everywhere
from kinertia.io.subject.provenance import sha256
from kinertia.report.pages.finding_view import digest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")


pytest.importorskip("uvicorn", reason="needs the extra app (pip install -e '.[test]')")


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
        **digest(Overview((), 61, 1), {}),
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


pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")


pytest.importorskip("uvicorn", reason="needs the extra app (pip install -e '.[test]')")


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    with running(tmp_path_factory.mktemp("app") / "library") as app:
        yield app


@pytest.fixture
def person(served):
    person = served.library.add("Anna")
    yield person
    served.library.delete(person)


def drop(served, person, name, content=b"content"):
    answer = served.post(f"/people/{quote(person.name)}/files?name={quote(name, safe='')}", content)
    return answer.status, json.loads(answer.text)


@pytest.mark.parametrize(
    "name",
    [
        "walk.trc",
        "lab/day 1/walk.trc",
        "../../walk.trc",
        "/etc/walk.trc",
        "C:\\Users\\x\\walk.trc",
        "C:walk.trc",
        "\\\\server\\share\\walk.trc",
        "..\\..\\walk.trc",
    ],
)
def test_folders_before_a_name_lead_nowhere(served, person, name):
    before = sorted(served.library.folder.parent.rglob("*"))
    assert drop(served, person, name) == (200, {"name": "walk.trc"})
    assert set(served.library.folder.parent.rglob("*")) - set(before) == {person.folder / "walk.trc"}
    assert (person.folder / "walk.trc").read_bytes() == b"content"


@pytest.mark.parametrize(
    "name",
    [
        "..",
        "",
        ".trc",
        "<img src=x onerror=alert(1)>.trc",
        'walk".trc',
        "nul.trc",
        "COM1.c3d",
        "walk.trc.",
        "walk.trc ",
        "walk\n.trc",
        "walk\u202ecrt.trc",
        "a" * 300 + ".trc",
        ".kinertia-person.json",
        "subject.toml\0.trc",
    ],
)
def test_names_that_no_file_may_have_are_refused(served, person, name):
    before = sorted(person.folder.iterdir())
    status, told = drop(served, person, name)
    assert status == 422
    assert "not accepted" in told["problem"]
    assert sorted(person.folder.iterdir()) == before


@settings(max_examples=50)
@given(st.text(max_size=60), st.sampled_from([".trc", ".c3d", ".osim", ""]))
def test_a_name_is_harmless_or_refused(text, ending):
    try:
        name = harmless_name(text + ending)
    except FileError:
        return
    assert fits_everywhere(name)
    assert not set(name) & set('/\\<>:"|?*')
    assert not name.startswith(".")


def test_streams_of_windows_are_no_files(served, person):
    before = sorted(person.folder.iterdir())
    assert drop(served, person, "walk.trc:stream")[0] == 422
    assert sorted(person.folder.iterdir()) == before


def test_markup_that_a_name_may_have_is_text_on_the_page(served, person):
    drop(served, person, "a&amp;'b.trc")
    page = served.ask(f"/people/{quote(person.name)}").text
    assert "a&amp;amp;&#39;b.trc" in page


@pytest.mark.parametrize("size", [10, 3_000_000])
def test_who_sends_a_refused_file_is_heard_out(served, person, size):
    """A browser that still sends takes a connection that is closed for a failure, and never sees the answer."""
    connection = http.client.HTTPConnection(urlsplit(served.address).netloc, timeout=20)
    connection.putrequest("POST", f"{served.root}/people/{quote(person.name)}/files?name=letter.pdf")
    connection.putheader("Content-Length", str(size))
    connection.endheaders()
    answer = http.client.HTTPResponse(connection.sock, method="POST")
    answer.begin()
    assert answer.status == 422
    assert "a '.pdf' file is none that Kinertia reads" in json.loads(answer.read())["problem"]
    connection.sock.sendall(bytes(size))
    connection.sock.sendall(
        f"GET {served.root}/ HTTP/1.1\r\nHost: {connection.host}:{connection.port}\r\n\r\n".encode()
    )
    again = http.client.HTTPResponse(connection.sock)
    again.begin()
    assert again.status == 200
    connection.close()


@pytest.mark.parametrize(("name", "what"), [("letter.pdf", "a '.pdf' file"), ("letter", "a file without an ending")])
def test_other_kinds_are_refused_with_all_that_are_taken(served, person, name, what):
    status, told = drop(served, person, name)
    assert status == 422
    assert told["problem"].startswith(f"{name}: not accepted: {what} is none that Kinertia reads; those are ")
    assert all(ending in told["problem"] for ending in ENDINGS)


def test_a_zip_bomb_is_refused_unread(served, person):
    bomb = io.BytesIO()
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr("walk.trc", bytes(20_000_000))
    before = sorted(person.folder.iterdir())
    status, told = drop(served, person, "lab.zip", bomb.getvalue())
    assert status == 422
    assert "archives are not unpacked here; unpack it" in told["problem"]
    assert sorted(person.folder.iterdir()) == before


def received(person, name, size):
    async def chunks():
        for _ in range(size // 100_000):
            yield bytes(100_000)

    # in a thread of its own: tests in a browser leave an event loop running in this one
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(asyncio.run, receive(person, name, chunks())).result()


@pytest.mark.parametrize(
    ("limit", "sentence"), [("LARGEST_FILE_MB", "larger than 1 MB"), ("LARGEST_PERSON_MB", "have 1 MB at most")]
)
def test_limits_of_size_are_kept_and_leave_nothing(tmp_path, monkeypatch, limit, sentence):
    monkeypatch.setattr(f"kinertia.cli.web.library.{limit}", 1)
    person = Library(tmp_path).add("Anna")
    received(person, "walk1.trc", 900_000)
    with pytest.raises(FileError, match=sentence):
        received(person, "walk2.trc", 1_100_000)
    assert [path.name for path in person.files()] == ["walk1.trc"]
    assert not list(person.folder.glob(".upload*"))
    received(person, "walk1.trc", 1_000_000)
    assert (person.folder / "walk1.trc").stat().st_size == 1_000_000


def test_a_subject_file_is_small(tmp_path):
    with pytest.raises(FileError, match="larger than 1 MB, the most of a TOML file"):
        received(Library(tmp_path).add("Anna"), "subject.toml", 1_100_000)


def test_the_number_of_files_is_limited(tmp_path, monkeypatch):
    monkeypatch.setattr("kinertia.cli.web.library.MOST_FILES", 2)
    person = Library(tmp_path).add("Anna")
    for name in ("a.trc", "b.trc", "a.trc"):
        received(person, name, 100_000)
    with pytest.raises(FileError, match="the most of one person"):
        received(person, "c.trc", 100_000)


def test_limits_are_said_on_the_page(served):
    page = " ".join(served.ask("/").text.split())
    assert f"Up to {LARGEST_FILE_MB} MB a file, {LARGEST_PERSON_MB} MB and {MOST_FILES}" in page
