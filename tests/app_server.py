"""A server of `kinertia app` on a library in a folder, and requests to it as no browser would send them."""

import http.client
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from urllib.parse import urlsplit

from kinertia.cli.web.library import Library
from kinertia.cli.web.routes import Example
from kinertia.cli.web.server import Server


@dataclass(frozen=True)
class Answer:
    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def text(self) -> str:
        return self.body.decode("utf-8")


@dataclass(frozen=True)
class Running:
    """A running server; `root` is the path with the token, without a slash at the end."""

    address: str
    library: Library
    server: Server

    @property
    def root(self) -> str:
        return urlsplit(self.address).path.rstrip("/")

    def ask(self, path: str, method: str = "GET", body: object = None, host: str = "", **headers: str) -> Answer:
        """The answer to a request; `path` counts from the token unless it begins with two slashes."""
        place = urlsplit(self.address)
        connection = http.client.HTTPConnection(place.hostname, place.port, timeout=20)
        given = {name.replace("_", "-"): value for name, value in headers.items()}
        try:
            connection.putrequest(
                method,
                path[1:] if path.startswith("//") else self.root + path,
                skip_host=True,
                skip_accept_encoding=True,
            )
            connection.putheader("Host", host or place.netloc)
            content = body.encode() if isinstance(body, str) else body
            if content is not None:
                connection.putheader("Content-Length", str(len(content)))
            for name, value in given.items():
                connection.putheader(name, value)
            connection.endheaders(content)
            answer = connection.getresponse()
            return Answer(answer.status, {k.lower(): v for k, v in answer.getheaders()}, answer.read())
        finally:
            connection.close()

    def post(self, path: str, body: object = "", **headers: str) -> Answer:
        return self.ask(path, "POST", body, **headers)


@contextmanager
def running(folder: Path, examples: Mapping[str, Example] = MappingProxyType({})) -> Iterator[Running]:
    library = Library(folder)
    with library.opened():
        server = Server(library, examples=examples)
        with server.in_background() as address:
            yield Running(address, library, server)
