"""Dropped files: names made harmless, limits kept, archives and other kinds refused."""

import asyncio
import http.client
import io
import json
import zipfile
from concurrent.futures import ThreadPoolExecutor
from urllib.parse import quote, urlsplit

import pytest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")
pytest.importorskip("uvicorn", reason="needs the extra app (pip install -e '.[test]')")

from hypothesis import given, settings
from hypothesis import strategies as st

from app_server import running
from kinertia.cli.web import uploads
from kinertia.cli.web.library import Library
from kinertia.cli.web.uploads import harmless_name, receive
from kinertia.errors import FileError
from kinertia.io.file_names import fits_everywhere


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
    assert all(ending in told["problem"] for ending in uploads.ENDINGS)


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
    monkeypatch.setattr(uploads, limit, 1)
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
    monkeypatch.setattr(uploads, "MOST_FILES", 2)
    person = Library(tmp_path).add("Anna")
    for name in ("a.trc", "b.trc", "a.trc"):
        received(person, name, 100_000)
    with pytest.raises(FileError, match="the most of one person"):
        received(person, "c.trc", 100_000)


def test_limits_are_said_on_the_page(served):
    page = " ".join(served.ask("/").text.split())
    assert f"Up to {uploads.LARGEST_FILE_MB} MB a file, {uploads.LARGEST_PERSON_MB} MB and {uploads.MOST_FILES}" in page
