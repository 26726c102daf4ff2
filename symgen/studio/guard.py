"""Admit only requests from the server's own pages to the studio (an ASGI layer).

Host          127.0.0.1, localhost or [::1] with the port of the server; other names are refused
              (DNS rebinding)
/TOKEN/...    128 random bits at the start of every path; without them, the answer is "not found"
Origin        if it is given, and for every change: it must be the server's own (CSRF)
size          of the body of a request: at most the limit for its kind, counted as it arrives
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, MutableMapping
from hmac import compare_digest
from typing import Any

Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Message, Receive, Send], Awaitable[None]]

UPLOAD_PATH = "/do/upload"
LARGEST_UPLOAD = 64 * 2**20  # bytes of a file; the command line takes larger ones
LARGEST_FORM = 2**20  # bytes of what is no upload
SECURITY_HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src "
    "'self'; connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
}


class Guard:
    """An ASGI layer that refuses (status 4xx) every request that is not from a page of this server.

    Refused requests do not reach the application.

    Parameters
    ----------
    app : ASGI application
    token : str
    hosts : set of str
        The values of `Host` that belong to the server.
    """

    def __init__(self, app: App, token: str, hosts: set[str]) -> None:
        self.app, self.token, self.hosts = app, token, hosts

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        limit = LARGEST_UPLOAD if scope["path"].endswith(UPLOAD_PATH) else LARGEST_FORM
        left = limit

        async def counted() -> Message:
            nonlocal left
            message = await receive()
            left -= len(message.get("body", b""))
            if left < 0:
                raise ValueError(f"the data sent are larger than {limit // 2**20} MB, the limit")
            return message

        async def sent(message: Message) -> None:
            if message["type"] == "http.response.start":
                own = {name.encode(): value.encode() for name, value in SECURITY_HEADERS.items()}
                message = {**message, "headers": [*(own | dict(message["headers"])).items()]}
            await send(message)

        if (reason := self.refusal(scope, limit)) is None:
            await self.app(scope, counted, sent)
            return
        kind = [(b"content-type", b"text/plain; charset=utf-8"), (b"connection", b"close")]
        await sent({"type": "http.response.start", "status": reason[0], "headers": kind})
        await sent({"type": "http.response.body", "body": reason[1].encode()})

    def refusal(self, scope: Message, limit: int) -> tuple[int, str] | None:
        """Return the HTTP status and the message that refuse a request; None if it is allowed."""
        headers: dict[str, list[str]] = {}
        for name, value in scope["headers"]:
            headers.setdefault(name.decode("latin-1").lower(), []).append(value.decode("latin-1"))
        host, origin = (headers.get(name, []) for name in ("host", "origin"))
        changes = scope["method"] == "POST"
        own = origin == [f"http://{name}" for name in host]
        length = headers.get("content-length", ["0"])[0]
        token = f"{scope['path']}/".split("/")[1]
        refused = {
            (421, "this address is not the server's"): len(host) != 1 or host[0] not in self.hosts,
            (404, "nothing here; open the address that the terminal shows"): not compare_digest(
                token.encode(), self.token.encode()
            ),
            (405, "expected GET or POST"): scope["method"] not in ("GET", "HEAD", "POST"),
            (403, "the request comes from another site"): ((origin or changes) and not own)
            or (changes and headers.get("sec-fetch-site", ["same-origin"]) != ["same-origin"]),
            (
                413,
                f"more than {limit // 2**20} MB; name a larger record on the command line: symgen "
                "studio ROBOT RECORD",
            ): not length.isdigit() or int(length) > limit,
        }
        return next((reason for reason, holds in refused.items() if holds), None)
