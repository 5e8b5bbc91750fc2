"""Who is refused: no token, another host, another site, a websocket; and that nothing is served but the library."""

import socket
from urllib.parse import urlsplit

import pytest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")
pytest.importorskip("uvicorn", reason="needs the extra app (pip install -e '.[test]')")

from app_server import running
from kinertia.cli.web.library import Library
from kinertia.cli.web.responses import RESULT_POLICY
from kinertia.cli.web.server import Server
from kinertia.errors import FileError, SettingsError


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    folder = tmp_path_factory.mktemp("app")
    (folder / "secret.txt").write_text("secret")
    with running(folder / "library") as app:
        person = app.library.add("Anna")
        (person.folder / "subject.toml").write_text("[subject]\n")
        person.results.mkdir()
        (person.results / "fit.json").write_text("{}")
        (person.results / "report.html").write_text("<h1>report</h1>")
        (person.results / ".hidden.html").write_text("secret")
        (folder / "library" / "not a person").mkdir()
        (folder / "library" / "not a person" / "subject.toml").write_text("secret")
        yield app


def test_the_address_that_is_shown_is_answered(served):
    answer = served.ask("/")
    assert answer.status == 200
    assert "Anna" in answer.text


@pytest.mark.parametrize("path", ["/", "/people/Anna", "/static/app.js", "/wrong-token/", "/wrong-token/people/Anna"])
def test_without_the_token_nothing_is_told(served, path):
    answer = served.ask("/" + path)
    assert answer.status == 403
    assert "Anna" not in answer.text


def test_the_token_is_long_random_and_of_this_run(tmp_path):
    tokens = []
    for _ in range(2):
        server = Server(Library(tmp_path))
        tokens.append(urlsplit(server.address).path.strip("/"))
        server._socket.close()
    assert min(map(len, tokens)) >= 32
    assert tokens[0] != tokens[1]


@pytest.mark.parametrize(
    "host",
    ["evil.example", "evil.example:{port}", "127.0.0.1", "127.0.0.1:1", "127.0.0.1.evil.example:{port}", "[::1]"],
)
def test_a_name_that_leads_here_is_refused(served, host):
    """DNS rebinding: a page of evil.example, whose name now means 127.0.0.1, has the right port and even the token."""
    port = urlsplit(served.address).port
    assert served.ask("/", host=host.format(port=port)).status == 403


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:1"},
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "same-site"},
    ],
)
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_other_sites_are_refused_even_with_the_token(served, method, headers):
    before = len(served.library.people())
    assert served.ask("/people" if method == "POST" else "/", method, "name=Eve", **headers).status == 403
    assert len(served.library.people()) == before


def test_the_pages_own_forms_are_taken(served):
    origin = "{0.scheme}://{0.netloc}".format(urlsplit(served.address))
    answer = served.post("/people", "name=Berta", Origin=origin, Sec_Fetch_Site="same-origin")
    assert answer.status == 303
    assert served.library.person("Berta") is not None


@pytest.mark.parametrize("with_token", [True, False])
def test_websockets_are_refused(served, with_token):
    place = urlsplit(served.address)
    path = served.root + "/" if with_token else "/"
    with socket.create_connection((place.hostname, place.port), timeout=20) as stream:
        stream.sendall(
            f"GET {path} HTTP/1.1\r\nHost: {place.netloc}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        assert b" 101 " not in stream.recv(200)


def test_it_listens_on_this_computer_only(served):
    assert served.server._socket.getsockname()[0] == "127.0.0.1"


@pytest.mark.parametrize(
    "path",
    [
        "/people/Anna/results/../subject.toml",
        "/people/Anna/results/%2e%2e/subject.toml",
        "/people/Anna/results/..%2f..%2f..%2fsecret.txt",
        "/people/Anna/results/%2Fetc%2Fpasswd",
        "/people/Anna/results//etc/passwd",
        "/people/Anna/results/C:%5CWindows%5Cwin.ini",
        "/people/Anna/results/.hidden.html",
        "/people/Anna/check/../results/report.html",
        "/people/..%2fAnna/results/report.html",
        "/people/%2e%2e/subject.toml",
        "/people/not a person/subject.toml".replace(" ", "%20"),
        "/static/../library.py",
        "/static/%2e%2e/library.py",
    ],
)
def test_nothing_is_served_outside_the_results(served, path):
    answer = served.ask(path)
    assert answer.status == 404
    assert "secret" not in answer.text
    assert "import" not in answer.text


def test_links_that_lead_out_of_the_results_are_not_followed(served):
    link = served.library.person("Anna").results / "link.html"
    try:
        link.symlink_to(served.library.folder.parent / "secret.txt")
    except OSError:
        pytest.skip("this system lets nobody make links")
    assert served.ask("/people/Anna/results/link.html").status == 404


def test_pages_load_nothing_from_elsewhere_and_reports_reach_nothing(served):
    policy = served.ask("/").headers["content-security-policy"]
    assert policy.startswith("default-src 'none'")
    assert "http" not in policy
    assert "unsafe" not in policy
    assert "frame-ancestors 'none'" in policy
    report = served.ask("/people/Anna/results/report.html")
    assert report.status == 200
    assert report.headers["content-security-policy"] == RESULT_POLICY
    assert "sandbox" in RESULT_POLICY
    assert "allow-same-origin" not in RESULT_POLICY
    assert "connect-src" not in RESULT_POLICY, "default-src 'none' forbids all requests"


def test_a_form_without_end_is_refused(served):
    assert served.post("/people", "name=" + "a" * 2_000_000).status == 413


def test_markup_in_names_is_text(served):
    served.post("/people", "name=%3Cscript%3Ealert(1)%3C%2Fscript%3E%22%27")
    page = served.ask("/").text
    assert "<script>alert" not in page
    assert "script alert(1)" in page


def test_a_library_is_open_once(served):
    with pytest.raises(FileError, match="in use by process"), Library(served.library.folder).opened():
        pass


def test_a_port_that_is_taken_is_said(served, tmp_path):
    with pytest.raises(SettingsError, match="--port"):
        Server(Library(tmp_path), urlsplit(served.address).port)
