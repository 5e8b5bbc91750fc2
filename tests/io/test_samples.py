"""The sample walk is downloaded once, checked, and asked for by hand where that is not possible."""

import hashlib
import http.server
import threading
import time
from contextlib import contextmanager

import pytest

from kinertia.errors import KinertiaError
from kinertia.io import samples

CONTENT = {name: f"content of {name}\n".encode() * 500 for name in samples.SHA256}


class Server(http.server.ThreadingHTTPServer):
    """Serves `files` by name, and notes what it was asked for."""

    daemon_threads = True

    def __init__(self, files):
        super().__init__(("127.0.0.1", 0), Handler)
        self.files, self.asked, self.wait_s = files, [], 0.0

    @property
    def address(self):
        return f"http://127.0.0.1:{self.server_port}/"


class Handler(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        self.server.asked.append(self.path)
        time.sleep(self.server.wait_s)
        content = self.server.files.get(self.path.rpartition("/")[2])
        self.send_response(404 if content is None else 200)
        self.send_header("Content-Length", str(len(content or b"")))
        self.end_headers()
        self.wfile.write(content or b"")

    def log_message(self, *arguments):
        pass


@contextmanager
def served(files):
    server = Server(files)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        server.server_close()


@pytest.fixture
def folder(monkeypatch, tmp_path):
    """Where samples are kept; files are those of CONTENT, and no proxy stands between."""
    monkeypatch.setenv(samples.VARIABLE, str(tmp_path))
    digests = {name: hashlib.sha256(content).hexdigest() for name, content in CONTENT.items()}
    monkeypatch.setattr(samples, "SHA256", digests)
    for name in ("HTTP_PROXY", "http_proxy", "HTTPS_PROXY", "https_proxy", "ALL_PROXY", "all_proxy"):
        monkeypatch.delenv(name, raising=False)
    return tmp_path / samples.NAME


@pytest.fixture
def server(monkeypatch, folder):
    with served(dict(CONTENT)) as running:
        monkeypatch.setattr(samples, "URL", running.address)
        yield running


def unavailable():
    with pytest.raises(KinertiaError) as caught:
        samples.sample_walk()
    return str(caught.value)


def test_it_is_downloaded_once(server, folder):
    told = []
    assert samples.sample_walk(lambda stage, share: told.append((stage, share))) == folder
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == CONTENT
    assert sorted(server.asked) == sorted(f"/{name}" for name in CONTENT)
    assert {stage for stage, _ in told} == {"downloading"}
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)
    assert samples.sample_walk() == folder
    assert len(server.asked) == len(CONTENT)


def test_a_file_that_is_there_is_not_asked_for(server, folder):
    folder.mkdir()
    first, *others = CONTENT
    (folder / first).write_bytes(CONTENT[first])
    samples.sample_walk()
    assert sorted(server.asked) == sorted(f"/{name}" for name in others)


def test_a_damaged_file_is_downloaded_again(server, folder):
    samples.sample_walk()
    (folder / "subject01_walk1.trc").write_bytes(b"cut")
    samples.sample_walk()
    assert server.asked[-1] == "/subject01_walk1.trc"
    assert (folder / "subject01_walk1.trc").read_bytes() == CONTENT["subject01_walk1.trc"]


def test_what_another_page_sends_is_not_kept(server, folder):
    """As that of a hotel's network, which asks for a room number."""
    server.files["subject01_walk1.trc"] = b"<html>Welcome!</html>"
    message = unavailable()
    assert "subject01_walk1.trc is not the expected file" in message
    assert not (folder / "subject01_walk1.trc").exists()


def test_a_file_that_the_server_lacks(server, folder):
    del server.files["subject01_walk1_grf.mot"]
    message = unavailable()
    assert "answered 404 for subject01_walk1_grf.mot" in message
    assert "download subject01_walk1_grf.mot, subject01_walk1_grf.xml from" in message
    assert samples.URL in message
    assert str(folder) in message


def test_without_a_network(monkeypatch, folder):
    with served({}) as gone:
        address = gone.address
    monkeypatch.setattr(samples, "URL", address)
    message = unavailable()
    assert "there is no connection to 127.0.0.1" in message
    assert "HTTPS_PROXY" in message
    for name in CONTENT:
        assert name in message


def test_a_server_that_does_not_answer(server, monkeypatch):
    monkeypatch.setattr(samples, "_TIMEOUT_S", 0.2)
    server.wait_s = 1.0
    assert "did not answer within 0.2 s" in unavailable()


def test_by_the_proxy_that_the_environment_names(server, monkeypatch, folder):
    monkeypatch.setattr(samples, "URL", "http://nowhere.invalid/")
    monkeypatch.setenv("HTTP_PROXY", server.address)
    samples.sample_walk()
    assert {path.name for path in folder.iterdir()} == set(CONTENT)
    assert all(asked.startswith("http://nowhere.invalid/") for asked in server.asked)


def test_without_pooch(server, monkeypatch, folder):
    """Files that were put there by hand are taken all the same."""
    monkeypatch.setattr(samples, "find_spec", lambda name: None)
    message = unavailable()
    assert 'pip install "kinertia[samples]"' in message
    assert all(name in message for name in CONTENT)
    folder.mkdir()
    for name, content in CONTENT.items():
        (folder / name).write_bytes(content)
    assert samples.sample_walk() == folder
    assert server.asked == []


def test_a_folder_that_cannot_be_made(server, monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(samples.VARIABLE, str(tmp_path / "file"))
    assert "cannot be written" in unavailable()


def test_without_the_variable_it_is_the_users_cache(monkeypatch):
    monkeypatch.delenv(samples.VARIABLE, raising=False)
    assert "kinertia" in samples.samples_folder().parts
