"""Security of the web application: requests with its token, of its own pages only, of limited size; headers."""

from __future__ import annotations

import asyncio
import hashlib
import json
import re
import secrets
from collections.abc import Awaitable, Callable, Collection, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

DROP_PATH = "/api/drop"  # files dropped onto the page
VIDEO_PATH = "/api/video"  # pictures of a video
STREAMED = (DROP_PATH, VIDEO_PATH)  # bounded by who keeps them
BODY_BYTES = 256 * 1024  # a preset of every parameter is 4 kB
BODY_S = 10.0  # for the whole body: a client that trickles it holds no connection for ever
OWN_HOSTS = ("127.0.0.1", "localhost")
HEADERS = (
    # Nothing is fetched from elsewhere: the browser itself holds the page to it.
    (
        b"content-security-policy",
        b"default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; "
        b"img-src 'self' data: blob:; connect-src 'self' data: blob:; worker-src 'self' blob:; "
        b"frame-ancestors 'none'; base-uri 'none'; form-action 'self'",
    ),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-resource-policy", b"same-origin"),
)


class SecurityMiddleware:
    """Refuse requests without the token, for another host (DNS rebinding), from another origin, not JSON, or too long.

    Every user of a machine can connect to a port of it; who knows the token is the one who started the server.

    Parameters
    ----------
    app : callable
        The ASGI application behind it.
    token : str, optional
        Asked of every request: in the page's address (`?token=`), which sets a cookie for all that follows, or as
        `Authorization: token ...`. Without one nothing is asked.
    hosts : collection of str
        Names besides 127.0.0.1 and localhost by which the page may be reached, as behind a proxy.
    """

    def __init__(self, app: App, token: str | None = None, hosts: Collection[str] = ()) -> None:
        self._app = app
        self._token = token
        self._hosts = tuple(host.lower() for host in hosts)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        given = _token_in_address(scope)
        refusal = self._stranger(headers, given) or _refusal(scope, headers)
        if refusal is not None:
            await _answer(send, *refusal)
            return
        if scope["path"] in STREAMED:
            await self._app(scope, _in_time(receive), _with_headers(send, None))
            return
        try:
            async with asyncio.timeout(BODY_S):
                body = await _body(receive)
        except TimeoutError:
            await _answer(send, 408, f"the request took longer than {BODY_S:.0f} s")
            return
        if body is None:
            await _answer(send, 413, f"the request is longer than {BODY_BYTES // 1024} kB")
            return
        cookie = self._cookie if given is not None and self._is_token(given) else None
        await self._app(scope, _replay(body, receive), _with_headers(send, cookie))

    def _stranger(self, headers: dict[str, str], given: str | None) -> tuple[int, str] | None:
        """Refusal of a request for another host, from another origin or without the token."""
        host = headers.get("host", "").lower()
        # By name alone: through an SSH tunnel the page is reached at another port than the server's own.
        name = re.sub(r":\d{1,5}$", "", host)
        if name not in (*OWN_HOSTS, *self._hosts):
            return 421, (
                f"this server answers to {', '.join((*OWN_HOSTS, *self._hosts))} and not to {name[:80] or 'no host'}: "
                "start it with --allow-host NAME if it is behind a proxy of that name"
            )
        # A proxy may speak HTTPS to the browser.
        schemes = ("http",) if name in OWN_HOSTS else ("http", "https")
        origin = headers.get("origin")
        if origin is not None and origin not in [f"{scheme}://{host}" for scheme in schemes]:
            return 403, "requests from other origins are refused"
        if self._token is None or any(self._is_token(text) for text in (given, *self._tokens_in(headers)) if text):
            return None
        return 401, "the token is missing or of an earlier start: open the whole address that the program printed"

    def _tokens_in(self, headers: dict[str, str]) -> tuple[str, ...]:
        """The tokens in the headers: as a credential, and in the page's cookie."""
        scheme, _, credential = headers.get("authorization", "").partition(" ")
        try:
            cookie = SimpleCookie(headers.get("cookie", "")).get(self._cookie_name)
        except CookieError:
            cookie = None
        return (credential.strip() if scheme.lower() == "token" else "", cookie.value if cookie else "")

    def _is_token(self, text: str) -> bool:
        return self._token is not None and secrets.compare_digest(text.encode(), self._token.encode())

    @property
    def _cookie_name(self) -> str:
        """Name of the cookie: cookies know no ports, and several servers may run on one machine."""
        return f"spinscope-{hashlib.sha256((self._token or '').encode()).hexdigest()[:8]}"

    @property
    def _cookie(self) -> bytes:
        return f"{self._cookie_name}={self._token}; HttpOnly; SameSite=Strict; Path=/".encode()


def _token_in_address(scope: Scope) -> str | None:
    """The token in the query of the address; None without one."""
    given: list[str] = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
    return given[0] if given else None


def _refusal(scope: Scope, headers: dict[str, str]) -> tuple[int, str] | None:
    site = headers.get("sec-fetch-site", "none")
    is_visit = scope["method"] == "GET" and scope["path"] == "/" and headers.get("sec-fetch-mode") == "navigate"
    if site not in ("same-origin", "none") and not is_visit:
        return 403, "requests from other origins are refused"
    if scope["method"] == "POST":
        # Both are kinds that a form of another page cannot send.
        kind = "application/octet-stream" if scope["path"] in STREAMED else "application/json"
        if headers.get("content-type", "").partition(";")[0].strip() != kind:
            return 415, f"the request is not {kind}"
        if scope["path"] in STREAMED:
            return None
        length = headers.get("content-length", "0")
        if not length.isdecimal() or int(length) > BODY_BYTES:
            return 413, f"the request is longer than {BODY_BYTES // 1024} kB"
    return None


async def _body(receive: Receive) -> bytes | None:
    """Read the whole request body; None when it is too long."""
    parts: list[bytes] = []
    length = 0
    while True:
        message = await receive()
        if message["type"] != "http.request":
            return b"".join(parts)
        parts.append(message.get("body", b""))
        length += len(parts[-1])
        if length > BODY_BYTES:
            return None
        if not message.get("more_body", False):
            return b"".join(parts)


def _in_time(receive: Receive) -> Receive:
    """Return a receiver that takes a client for gone which sends nothing for long."""

    async def received() -> Message:
        try:
            async with asyncio.timeout(BODY_S):
                return await receive()
        except TimeoutError:
            return {"type": "http.disconnect"}

    return received


def _replay(body: bytes, receive: Receive) -> Receive:
    """Return a receiver that gives the body, and then what comes next, which is the end of the connection."""
    handed = False

    async def replayed() -> Message:
        nonlocal handed
        if handed:
            return await receive()
        handed = True
        return {"type": "http.request", "body": body, "more_body": False}

    return replayed


def _with_headers(send: Send, cookie: bytes | None) -> Send:
    cookies = [] if cookie is None else [(b"set-cookie", cookie)]

    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            message["headers"] = [*message.get("headers", []), *HEADERS, *cookies]
        await send(message)

    return sent


async def _answer(send: Send, status: int, text: str) -> None:
    body = json.dumps({"error": text}).encode()
    headers = [(b"content-type", b"application/json"), (b"content-length", str(len(body)).encode()), *HEADERS]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": body})
