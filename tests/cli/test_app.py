"""`kinertia app`: opens the browser or not, ends in order, and says what it lacks."""

import os
import re
import signal
import subprocess
import sys
import urllib.error
import urllib.request

import pytest

import kinertia.cli.web
from command_line import PROGRAM, run


@pytest.mark.parametrize("package", ["starlette", "uvicorn"])
def test_without_the_extra_it_says_how_to_install_it(without, monkeypatch, tmp_path, package):
    monkeypatch.setattr(kinertia.cli, "web", kinertia.cli.web)  # undone as well: the import below replaces it
    for name in [name for name in sys.modules if name.startswith(("kinertia.cli.web", package))]:
        monkeypatch.delitem(sys.modules, name)
    without(package)
    outcome = run("app", "--folder", tmp_path / "library", "--no-browser")
    assert outcome.status == 2
    assert 'pip install ".[app]"' in outcome.err
    assert not (tmp_path / "library").exists()


def test_a_port_of_another_program_is_an_error(tmp_path):
    pytest.importorskip("uvicorn")
    import socket

    with socket.create_server(("127.0.0.1", 0)) as other:
        outcome = run("app", "--folder", tmp_path, "--no-browser", "--port", other.getsockname()[1])
    assert outcome.status == 2
    assert "--port" in outcome.err


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows sends no signals to one process")
def test_it_shows_its_address_and_ends_in_order(tmp_path):
    pytest.importorskip("uvicorn")
    command = [*PROGRAM, "app", "--folder", str(tmp_path / "library"), "--no-browser"]
    unbuffered = {**os.environ, "PYTHONUNBUFFERED": "1"}
    app = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=unbuffered)
    ask = urllib.request.build_opener(urllib.request.ProxyHandler({})).open
    try:
        address = re.search(r"http://127\.0\.0\.1:\d+/\S+/", app.stdout.readline())[0]
        assert ask(address, timeout=30).status == 200
        with pytest.raises(urllib.error.HTTPError, match="403"):
            ask(address.rsplit("/", 2)[0] + "/", timeout=30)
        app.send_signal(signal.SIGINT)
        rest, _ = app.communicate(timeout=30)
    finally:
        app.kill()
        app.wait()
    assert app.returncode == 0
    assert "stopped" in rest
    assert (tmp_path / "library").is_dir()


def test_the_browser_is_opened_at_the_address(monkeypatch, tmp_path):
    pytest.importorskip("uvicorn")
    from kinertia.cli.web.server import Server

    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setattr(Server, "run", lambda self: self._socket.close())
    outcome = run("app", "--folder", tmp_path)
    assert outcome.status == 0
    assert len(opened) == 1
    assert opened[0] in outcome.out
