"""A server and its sessions."""

from __future__ import annotations

from collections.abc import Iterator
from types import TracebackType
from typing import Any, Self, Unpack, cast

import httpx

from .problem import ProblemError
from .session import Session
from .types import Readiness, SessionSpec, SessionView

PATIENCE = httpx.Timeout(60, connect=5)
"""Longer than a server takes for a request: its `--request-timeout` is 30 s where nothing else is said."""


class Client:
    """A Firn server over REST. Its calls raise `ProblemError` where the server refuses them.

    `url` as in `http://127.0.0.1:8080`. `token`: an API key, or a session's token, where the server asks for one.
    `options` go to `httpx.Client`, as `verify` or `timeout` do; without the latter a call waits for 60 s.
    """

    def __init__(self, url: str, *, token: str | None = None, **options: Any) -> None:
        self.url = url.rstrip("/")
        self.token = token
        headers = {"authorization": f"Bearer {token}"} if token else {}
        self._http = httpx.Client(base_url=self.url, headers=headers, **{"timeout": PATIENCE, **options})

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Closes its connections."""
        self._http.close()

    def request(self, method: str, path: str, *, idempotency_key: str | None = None, **options: Any) -> httpx.Response:
        """Any call, as `httpx.Client.request` takes it. With an idempotency key, a repeat of a POST adds nothing."""
        if idempotency_key is not None:
            options["headers"] = {**options.get("headers", {}), "idempotency-key": idempotency_key}
        response = self._http.request(method, path, **options)
        if response.is_error:
            raise ProblemError.from_response(response.status_code, response.content, response.headers)
        return response

    def session(self, id: str) -> Session:
        """A session by its name; asks the server nothing."""
        return Session(self, id)

    def create_session(self, *, idempotency_key: str | None = None, **spec: Unpack[SessionSpec]) -> Session:
        """Creates a session. It holds the tokens, which the server tells once."""
        response = self.request("POST", "/v1/sessions", json=spec, idempotency_key=idempotency_key)
        return Session.created(self, response.json())

    def restore_session(self, snapshot: bytes, id: str | None = None) -> Session:
        """A new session from a snapshot, bit for bit."""
        headers = {"content-type": "application/vnd.firn.snapshot"}
        params = {} if id is None else {"id": id}
        response = self.request("POST", "/v1/sessions", content=snapshot, headers=headers, params=params)
        return Session.created(self, response.json())

    def sessions(self) -> Iterator[SessionView]:
        """Every session, page by page."""
        yield from self._pages("/v1/sessions")

    def readiness(self) -> Readiness:
        """What the server runs on, and how much it holds."""
        return cast(Readiness, self.request("GET", "/readyz").json())

    def _pages(self, path: str) -> Iterator[Any]:
        params: dict[str, str] = {}
        while True:
            page = self.request("GET", path, params=params).json()
            yield from page["items"]
            if page["next_cursor"] is None:
                return
            params = {"cursor": page["next_cursor"]}
