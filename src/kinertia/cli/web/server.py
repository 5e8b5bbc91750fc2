"""Runs the server behind `kinertia app`: on 127.0.0.1, for one browser, with a token in its address."""

import secrets
import socket
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType

import uvicorn

from kinertia.cli.web.jobs import Jobs
from kinertia.cli.web.library import Library
from kinertia.cli.web.responses import Guard
from kinertia.cli.web.routes import Example, application
from kinertia.errors import SettingsError

_PATIENCE_S = 3
"""Time limit (s) for requests to end when the server stops."""


class Server:
    """Server of a library of people and their results, until `stop`.

    Attributes:
        address: address to open in the browser; nothing answers without its token.
    """

    def __init__(
        self,
        library: Library,
        port: int = 0,
        examples: Mapping[str, Example] = MappingProxyType({}),
        prepare: bool = False,
    ) -> None:
        """Reserve the port, but answer nothing yet.

        Args:
            library: people and their results.
            port: port of 127.0.0.1; 0 takes a free one.
            examples: people to try it with: functions that write their files into a folder, by kind.
            prepare: whether to compile beforehand what the first fit would compile.

        Raises:
            SettingsError: another program uses the port.
        """
        self._socket = _listening(port)
        port = self._socket.getsockname()[1]
        token = secrets.token_urlsafe(24)
        self.address = f"http://127.0.0.1:{port}/{token}/"
        self._jobs = Jobs(prepare)
        app = application(library, self._jobs, self.stop, examples)
        config = uvicorn.Config(
            Guard(app, token, port),
            ws="none",
            http="h11",
            loop="asyncio",
            log_config=None,
            access_log=False,
            server_header=False,
            proxy_headers=False,
            timeout_graceful_shutdown=_PATIENCE_S,
        )
        self._server = uvicorn.Server(config)

    def run(self) -> None:
        """Serve until `stop` or Ctrl-C; running fits are then cancelled."""
        with self._jobs.at_work():
            self._server.run(sockets=[self._socket])

    def stop(self) -> None:
        """Stop the server soon; may be called from any thread."""
        self._server.should_exit = True

    @contextmanager
    def in_background(self) -> Iterator[str]:
        """Serve during the block; yields the address."""
        thread = threading.Thread(target=self.run, daemon=True)
        thread.start()
        while not self._server.started and thread.is_alive():
            time.sleep(0.01)
        try:
            yield self.address
        finally:
            self.stop()
            thread.join()


def _listening(port: int) -> socket.socket:
    taken = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    if sys.platform == "win32":  # where SO_REUSEADDR lets another program listen, too
        taken.setsockopt(socket.SOL_SOCKET, socket.SO_EXCLUSIVEADDRUSE, 1)
    else:
        taken.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        taken.bind(("127.0.0.1", port))
        taken.listen()  # a browser that is opened before `run` waits
    except (OSError, OverflowError) as error:
        taken.close()
        problem = f"--port {port}: is not available ({error}); give another, or leave it out to use a free one"
        raise SettingsError(problem) from error
    return taken
