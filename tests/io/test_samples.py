"""The sample walk is downloaded from a server on this machine, or is there already, or an error says what to do."""

import hashlib
import socket
import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import MappingProxyType
from urllib.parse import urlsplit

import pytest

from kinertia.errors import KinertiaError
from kinertia.io import samples

FILES = {name: f"bytes of {name}\n".encode() * 1000 for name in samples.SHA256}
FIRST, *_, LAST = FILES
SHA256 = MappingProxyType({name: hashlib.sha256(content).hexdigest() for name, content in FILES.items()})
LOGIN = b"<!doctype html><title>Welcome to the airport</title><form>Accept and connect</form>"
PROXIES = ("HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY", "NO_PROXY")
BRIEF_S = 0.2
BY_HAND = r"or download {names} from {url} yourself and put them into {folder}"


@dataclass
class Site:
    """A server: what it sends by a file's name, and what it was asked for."""

    address: str
    sends: dict[str, object] = field(default_factory=lambda: dict(FILES))
    asked: list[str] = field(default_factory=list)
    over: threading.Event = field(default_factory=threading.Event)

    @property
    def host(self) -> str:
        return urlsplit(self.address).netloc


@contextmanager
def serving():
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            site.asked.append(self.path)
            what = site.sends.get(self.path.rsplit("/", 1)[-1], 404)
            if callable(what):
                what(self, site)
            elif isinstance(what, int):
                self.send_error(what)
            else:
                sent(self, what, len(what))

        def log_message(self, *_):
            """Be quiet."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    site = Site(f"http://127.0.0.1:{server.server_port}/walks/")
    threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()
    try:
        yield site
    finally:
        site.over.set()
        server.shutdown()
        server.server_close()


def sent(handler, content, length):
    handler.send_response(200)
    if length is not None:
        handler.send_header("Content-Length", str(length))
    handler.end_headers()
    handler.wfile.write(content)


@pytest.fixture
def site(monkeypatch):
    with serving() as site:
        monkeypatch.setattr(samples, "URL", site.address)
        yield site


@pytest.fixture(autouse=True)
def cache(monkeypatch, tmp_path):
    """The folder that the four files go to; it does not exist. Nobody's proxies are asked."""
    for name in PROXIES:
        monkeypatch.delenv(name, raising=False)
        monkeypatch.delenv(name.lower(), raising=False)
    monkeypatch.setattr(samples, "SHA256", SHA256)
    monkeypatch.setenv(samples.VARIABLE, str(tmp_path / "samples"))
    return tmp_path / "samples" / samples.NAME


def refusal():
    """The message of an error, after what all of them begin with."""
    with pytest.raises(KinertiaError) as caught:
        samples.sample_walk()
    start, message = str(caught.value).split(": ", 1)
    assert start == "the sample walk is not available"
    return message


def by_hand(folder, names=tuple(FILES)):
    return BY_HAND.format(names=", ".join(names), url=samples.URL, folder=folder)


def put(folder, names=tuple(FILES)):
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).write_bytes(FILES[name])


def kept(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def without_pooch(monkeypatch):
    monkeypatch.setattr(samples, "find_spec", lambda name: None)


def test_all_four_files_come_once(site, cache):
    told = []
    assert samples.sample_walk(lambda *progress: told.append(progress)) == cache
    assert kept(cache) == FILES
    assert site.asked == [f"/walks/{name}" for name in FILES]
    stages, shares = zip(*told, strict=True)
    assert set(stages) == {"downloading"}
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    assert list(shares) == sorted(shares)
    assert len(set(shares)) > 4 * len(FILES), "as bytes come, not file by file"

    told.clear()
    assert samples.sample_walk(lambda *progress: told.append(progress)) == cache
    assert (len(site.asked), told) == (len(FILES), [])


def test_no_request_where_all_files_are_there(site, cache):
    put(cache)
    assert samples.sample_walk() == cache
    assert site.asked == []


def test_only_what_is_missing_is_asked_for(site, cache):
    put(cache, [FIRST, LAST])
    (cache / FIRST).write_bytes(b"half of it")
    (cache / "notes.txt").write_text("mine", encoding="utf-8")
    samples.sample_walk()
    assert site.asked == [f"/walks/{name}" for name in FILES if name != LAST]
    assert kept(cache) == {**FILES, "notes.txt": b"mine"}


def test_progress_ends_where_the_server_does_not_say_how_large_files_are(site, cache):
    site.sends |= {name: lambda handler, site, name=name: sent(handler, FILES[name], None) for name in FILES}
    shares = []
    samples.sample_walk(lambda stage, share: shares.append(share))
    assert kept(cache) == FILES
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def redirected(handler, site):
    handler.send_response(302)
    handler.send_header("Location", "/login.html")
    handler.end_headers()


@pytest.mark.parametrize("answer", [LOGIN, b"", redirected, FILES[LAST]], ids=["page", "nothing", "redirect", "other"])
def test_other_bytes_are_refused_and_not_kept(site, cache, answer):
    """As in a hotel, whose network answers everything with its own page until somebody logs in."""
    site.sends |= {FIRST: answer, "login.html": LOGIN}
    message = refusal()
    assert message.startswith(f"what {site.host} sent as {FIRST} is not the expected file (by its SHA-256); log in to")
    assert message.endswith(by_hand(cache))
    assert kept(cache) == {}
    del site.sends[FIRST]
    site.sends[FIRST] = FILES[FIRST]
    assert kept(samples.sample_walk()) == FILES


def test_what_has_come_before_stays_and_is_not_asked_for_by_hand(site, cache):
    site.sends[LAST] = LOGIN
    assert refusal().endswith(by_hand(cache, [LAST]))
    assert kept(cache) == {name: content for name, content in FILES.items() if name != LAST}


@pytest.mark.parametrize("status", [404, 403, 503])
def test_a_server_without_the_file(site, cache, status):
    site.sends[FIRST] = status
    assert refusal() == f"{site.host} answered {status} for {FIRST}; try again later, {by_hand(cache)}"
    assert kept(cache) == {}


def test_no_server(cache, monkeypatch):
    with socket.socket() as taken:  # bound, but nobody listens
        taken.bind(("127.0.0.1", 0))
        host = f"127.0.0.1:{taken.getsockname()[1]}"
        monkeypatch.setattr(samples, "URL", f"http://{host}/")
        message = refusal()
    advice = "if your network has a proxy, name it in HTTPS_PROXY"
    assert message == f"there is no connection to {host}; {advice}, {by_hand(cache)}"


def silent(handler, site):
    site.over.wait(10.0)


def stuck(handler, site):
    sent(handler, FILES[FIRST][:5000], len(FILES[FIRST]))
    handler.wfile.flush()
    silent(handler, site)


@pytest.mark.parametrize("answer", [silent, stuck])
def test_a_server_that_hangs(site, cache, monkeypatch, answer):
    """Before it answers, or in the middle of a file."""
    monkeypatch.setattr(samples, "_TIMEOUT_S", BRIEF_S)
    site.sends[FIRST] = answer
    began = time.monotonic()
    assert refusal().startswith(f"{site.host} did not answer within {BRIEF_S} s; if your network has a proxy")
    assert time.monotonic() - began < 8.0
    assert kept(cache) == {}


def test_a_connection_that_breaks_off(site, cache):
    site.sends[FIRST] = lambda handler, site: sent(handler, FILES[FIRST][:5000], len(FILES[FIRST]))
    assert refusal() == f"the connection to {site.host} broke off; try again, {by_hand(cache)}"
    assert kept(cache) == {}


def test_a_server_without_encryption(site, cache, monkeypatch):
    """Nor is one possible where a network opens what is encrypted, with a certificate that nobody trusts."""
    monkeypatch.setattr(samples, "URL", site.address.replace("http:", "https:"))
    site.sends.clear()
    message = refusal()
    assert message.startswith(f"no encrypted connection to {site.host} is possible (")
    assert "SSL" in message
    assert message.endswith(f"; name the file of your network's certificates in REQUESTS_CA_BUNDLE, {by_hand(cache)}")


def test_without_pooch_the_files_may_be_there(site, cache, monkeypatch):
    without_pooch(monkeypatch)
    put(cache)
    assert samples.sample_walk() == cache
    assert site.asked == []


def test_without_pooch_it_says_how_to_install_it_and_which_files_to_put_where(site, cache, monkeypatch):
    without_pooch(monkeypatch)
    installing = 'pooch, which downloads it, is not installed; pip install ".[samples]" in the folder of Kinertia, '
    assert refusal() == installing + by_hand(cache)
    put(cache, [FIRST, LAST])
    (cache / LAST).write_bytes(b"saved with other line ends")
    absent = [name for name in FILES if name not in (FIRST, LAST)]
    assert refusal() == installing + by_hand(cache, [*absent, f"{LAST} (the one that is there is another)"])
    assert site.asked == []


def test_a_folder_that_cannot_be_made(site, cache):
    cache.parent.write_text("a file", encoding="utf-8")
    message = refusal()
    assert f"{cache} cannot be written: Not a directory; " in message
    assert f"; name another folder in the environment variable {samples.VARIABLE}, {by_hand(cache)}" in message
    assert site.asked == []


@pytest.mark.parametrize("exists", [False, True])
def test_a_folder_that_may_not_be_written_to(site, cache, monkeypatch, exists):
    def forbidden(*_, **options):
        raise PermissionError(13, "Permission denied", str(options.get("dir", cache)))

    if exists:
        put(cache, [FIRST])
    monkeypatch.setattr("pooch.utils.os.makedirs", forbidden)
    monkeypatch.setattr("pooch.utils.tempfile.NamedTemporaryFile", forbidden)
    message = refusal()
    assert message.startswith(f"{cache} cannot be written: Permission denied; name another folder in the environment")
    assert "pooch" not in message.lower()
    assert message.endswith(by_hand(cache, list(FILES)[exists:]))


def test_a_folder_of_a_files_name(site, cache):
    (cache / FIRST).mkdir(parents=True)
    assert refusal().startswith(f"{cache / FIRST} cannot be written: ")


@pytest.mark.parametrize("stated", ["", None])
def test_without_the_variable_the_users_cache_is_the_place(site, monkeypatch, tmp_path, stated):
    monkeypatch.setattr(samples.platformdirs, "user_cache_path", lambda name, **_: tmp_path / "cache" / name)
    if stated is None:
        monkeypatch.delenv(samples.VARIABLE)
    else:
        monkeypatch.setenv(samples.VARIABLE, stated)
    assert samples.samples_folder() == tmp_path / "cache" / "kinertia"
    assert samples.sample_walk() == tmp_path / "cache" / "kinertia" / samples.NAME
    assert kept(tmp_path / "cache" / "kinertia" / samples.NAME) == FILES


@pytest.mark.parametrize("variable", ["HTTP_PROXY", "http_proxy", "ALL_PROXY"])
def test_a_proxy_of_the_environment_is_used(site, cache, monkeypatch, variable):
    monkeypatch.setattr(samples, "URL", "http://nowhere.invalid/walks/")
    monkeypatch.setenv(variable, f"http://{site.host}")
    samples.sample_walk()
    assert site.asked == [f"http://nowhere.invalid/walks/{name}" for name in FILES]
    assert kept(cache) == FILES


def test_a_proxy_that_is_not_there(cache, monkeypatch):
    monkeypatch.setattr(samples, "URL", "http://nowhere.invalid/walks/")
    monkeypatch.setenv("HTTP_PROXY", "http://127.0.0.1:9")
    problem = "there is no connection to nowhere.invalid through the proxy that the environment names"
    assert refusal() == f"{problem}; correct HTTPS_PROXY, {by_hand(cache)}"


@pytest.mark.measured
def test_the_files_are_those_of_the_address(monkeypatch, file_of):
    """The example that tests were written with has the bytes that are asked for."""
    monkeypatch.undo()
    place = file_of(f"{samples.NAME}/{LAST}").parent
    for name, expected in samples.SHA256.items():
        assert hashlib.sha256((place / name).read_bytes()).hexdigest() == expected
    assert sum((place / name).stat().st_size for name in FILES) / 1e6 == pytest.approx(samples.SIZE_MB, abs=0.05)
