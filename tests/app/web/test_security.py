"""Who may ask the web application: the token, other hosts, bodies that never end."""

from __future__ import annotations

import asyncio
from typing import Any

import httpx
import pytest

from spinscope.app.web import security
from spinscope.app.web.security import Message, Receive, Scope, SecurityMiddleware, Send

TOKEN = "a-token-of-this-start"
OWN = "http://127.0.0.1:8377"


async def answering(scope: Scope, receive: Receive, send: Send) -> None:
    """An application that answers everything with its own name."""
    await send({"type": "http.response.start", "status": 200, "headers": [(b"content-type", b"text/plain")]})
    await send({"type": "http.response.body", "body": b"answered"})


def asked(*requests: dict[str, Any], hosts: tuple[str, ...] = ()) -> list[httpx.Response]:
    """Answers to requests of one client, which keeps its cookies."""

    async def ask() -> list[httpx.Response]:
        app: Any = SecurityMiddleware(answering, TOKEN, hosts)
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app=app), base_url=OWN) as client:
            return [await client.request(**{"method": "GET", "url": "/", **request}) for request in requests]

    return asyncio.run(ask())


def test_nothing_is_answered_without_the_token() -> None:
    for request in (
        {},
        {"url": "/static/main.js"},
        {"url": "/?token="},
        {"url": "/?token=another"},
        {"url": f"/?token={TOKEN}x"},
        {"method": "POST", "url": "/api/sessions", "json": {}},
        {"headers": {"authorization": "token another"}},
        {"headers": {"authorization": TOKEN}},
        {"headers": {"cookie": f"spinscope={TOKEN}; other=\x01"}},
    ):
        (answer,) = asked(request)
        assert answer.status_code == 401 and TOKEN not in answer.text and "set-cookie" not in answer.headers, request
        assert "open the whole address" in answer.json()["error"]


def test_the_address_with_the_token_is_enough_for_all_that_follows() -> None:
    first, script, post = asked(
        {"url": f"/?tools=off&token={TOKEN}"},
        {"url": "/static/main.js"},
        {"method": "POST", "url": "/api/sessions", "json": {}},
    )
    assert [answer.status_code for answer in (first, script, post)] == [200] * 3
    assert "HttpOnly" in first.headers["set-cookie"] and "SameSite=Strict" in first.headers["set-cookie"]
    assert "set-cookie" not in script.headers


def test_a_program_gives_the_token_as_a_credential() -> None:
    (answer,) = asked({"headers": {"authorization": f"token {TOKEN}"}})
    assert answer.status_code == 200


def test_an_outdated_address_does_no_harm_where_the_cookie_is_right() -> None:
    _, outdated = asked({"url": f"/?token={TOKEN}"}, {"url": "/?token=of-yesterday"})
    assert outdated.status_code == 200 and "set-cookie" not in outdated.headers


def test_another_host_is_answered_only_where_it_is_allowed() -> None:
    request = {"url": f"/?token={TOKEN}", "headers": {"host": "lab.example:8443", "origin": "https://lab.example:8443"}}
    (refused,) = asked(request)
    assert refused.status_code == 421 and "--allow-host" in refused.json()["error"]
    (answer,) = asked(request, hosts=("LAB.example",))
    assert answer.status_code == 200
    for host in ("lab.example.evil.example", "xlab.example", "lab.example:port"):
        (other,) = asked({**request, "headers": {"host": host}}, hosts=("lab.example",))
        assert other.status_code == 421, host
    (elsewhere,) = asked({**request, "headers": {"origin": "https://lab.example"}}, hosts=("lab.example",))
    assert elsewhere.status_code == 403


def test_a_body_that_never_ends_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(security, "BODY_S", 0.05)
    sent: list[Message] = []

    async def trickle() -> Message:
        await asyncio.sleep(0.01)
        return {"type": "http.request", "body": b"x", "more_body": True}

    async def send(message: Message) -> None:
        sent.append(message)

    headers = [
        (b"host", b"localhost"),
        (b"content-type", b"application/json"),
        (b"authorization", b"token " + TOKEN.encode()),
    ]
    scope = {"type": "http", "method": "POST", "path": "/api/sessions", "query_string": b"", "headers": headers}
    asyncio.run(SecurityMiddleware(answering, TOKEN)(scope, trickle, send))
    assert sent[0]["status"] == 408
