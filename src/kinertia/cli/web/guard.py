"""Admits requests only from this browser, by the token in the address, and from pages of this server.

Any web page may send requests to 127.0.0.1, and a name that leads there makes it read the answers too (DNS rebinding).
So every request needs the token and the server's own name in `Host`, and must not come from another site.
"""

import secrets

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

HEADERS = {
    "content-security-policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
        "frame-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
    ),
    "x-content-type-options": "nosniff",
    "referrer-policy": "same-origin",  # with no-referrer forms have no `Origin` that could be looked at
    "cache-control": "no-store",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
}
"""Headers of every answer without its own: pages load nothing from elsewhere, and no other page may embed them."""
RESULT_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; font-src data:; "
    "form-action 'none'; base-uri 'none'; frame-ancestors 'self'; sandbox allow-scripts allow-downloads allow-modals"
)
"""Content-Security-Policy of reports, which carry their own scripts: an origin of their own, which reaches nothing."""


class Guard:
    """Filter that passes requests to the application only if they have the token and come from no other site.

    The token is the first part of the path; the application sees it as its root.
    """

    def __init__(self, app: ASGIApp, token: str, port: int) -> None:
        self._app = app
        self._token = token
        self._hosts = (f"127.0.0.1:{port}", f"localhost:{port}")

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":  # websockets are not used
            await send({"type": "websocket.close", "code": 1008})
            return
        refused = self._refusal(scope)

        async def sent(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        if refused:
            await PlainTextResponse(f"{refused}\n", 403)(scope, receive, sent)
            return
        await self._app({**scope, "root_path": f"/{self._token}"}, receive, sent)

    def _refusal(self, scope: Scope) -> str:
        """Return why a request is refused; empty if it is not."""
        headers = Headers(scope=scope)
        if headers.getlist("host") not in [[host] for host in self._hosts]:
            return "Kinertia answers on 127.0.0.1 only."
        given = scope["path"].split("/", 2)[1]
        if not secrets.compare_digest(given.encode(), self._token.encode()):
            return "This is not the address that kinertia app printed: open that one."
        origins: list[list[str]] = [[]] + [[f"http://{host}"] for host in self._hosts]
        site = headers.get("sec-fetch-site", "none")
        if headers.getlist("origin") not in origins or site not in ("none", "same-origin"):
            return "Kinertia does not answer requests from other sites."
        return ""
