"""The stream of a session: a WebSocket that connects again by itself and resumes."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import random
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Any, Literal, Self

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidStatus
from websockets.typing import Subprotocol

from .codec import DecodeError, decode
from .problem import ProblemError
from .subscription import Subscription, as_json
from .types import Ack, ColumnRegion, DepthWatch, Event, EventKind, Welcome

# Waiting time before a connection is tried again [s]: doubles from the first to the last.
FIRST_WAIT, LONGEST_WAIT = 0.25, 5.0
# A connection on which no ping is answered for so long [s] counts as lost.
SILENCE = 10.0
# Close codes from here on mean that connecting again won't help; so do these answers to an upgrade.
FOR_GOOD = 3500
REFUSALS = (400, 401, 403, 404, 421)


class Disconnected(ConnectionError):
    """The connection was lost before an answer came: what was asked for may have happened or not."""


class StreamClosed(ConnectionError):
    """The stream has ended for good."""

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(f"{reason or 'closed by the server'} ({code})")
        self.code = code
        """The WebSocket's close code, as in api/asyncapi.yaml."""


class Stream:
    """A stream, made by `Session.stream`: `async with session.stream() as stream`.

    It connects when it is entered, and again whenever the connection is lost; subscriptions then get what they missed.
    """

    def __init__(self, url: str, *, token: str | None = None, on_event: Callable[[Event], None] | None = None) -> None:
        self.url = url
        self.welcome: Welcome
        """The greeting of the present connection: epoch, grid, settings."""
        self._headers = {"authorization": f"Bearer {token}"} if token else {}
        self._on_event = on_event
        self._ids = itertools.count(1)
        self._subscriptions: dict[int, Subscription] = {}
        self._pending: dict[int, asyncio.Future[Ack]] = {}
        self._socket: ClientConnection | None = None
        self._task: asyncio.Task[None] | None = None
        self._ended: Exception | None = None

    async def __aenter__(self) -> Self:
        socket = await self._connect()
        self._task = asyncio.create_task(self._run(socket))
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Ends it; iterations over its subscriptions stop."""
        socket = self._socket
        if self._task is not None:
            self._task.cancel()
            await asyncio.wait([self._task])
        self._end(Disconnected("the stream was closed"), StopAsyncIteration())
        if socket is not None:
            await socket.close()

    async def subscribe(
        self,
        *,
        region: ColumnRegion | None = None,
        stride: Literal[1, 2, 4, 8] = 1,
        max_rate: float = 20,
        quantum: float = 0.001,
        colliders: bool = False,
        terrain: bool = False,
        events: bool | Sequence[EventKind] | None = None,
        watch: Sequence[DepthWatch] = (),
    ) -> Subscription:
        """Watches a region, all columns where there is none. Returns once its heights are known.

        `max_rate`: most messages per second [Hz]; `quantum`: step that heights are rounded to [m]. `colliders`,
        `terrain`: whether the objects and the ground of the region are wanted too. `events`: which the
        stream's `on_event` is called with, all of the region by default; `watch`: mean depths whose crossing it is
        called with, at most 16.
        """
        if events is None:
            events = self._on_event is not None
        wish: dict[str, Any] = {"region": region, "stride": stride, "max_rate": max_rate, "quantum": quantum}
        wish |= {"colliders": colliders, "terrain": terrain, "events": as_json(events), "watch": list(watch)}
        subscription = Subscription(next(self._ids), wish, self._tell)
        if self._ended is not None:
            raise self._ended
        self._subscriptions[subscription.id] = subscription
        await self._tell(subscription._begin(self.welcome))
        await subscription._first()
        return subscription

    async def unsubscribe(self, subscription: Subscription) -> None:
        """Ends a subscription."""
        del self._subscriptions[subscription.id]
        subscription._end(StopAsyncIteration())
        await self._tell({"op": "unsubscribe", "id": subscription.id})

    async def command(self, op: str, **fields: Any) -> Ack:
        """Sends a change as api/asyncapi.yaml names it: `await stream.command("snowfall", depth=0.2)`.

        An object is changed by `await stream.command("collider.patch", collider="sledge", patch={"mass": 80})`.
        Returns its `ack`. Raises `ProblemError` where it is refused, `Disconnected` where no answer came.
        """
        if self._socket is None:
            raise self._ended or Disconnected("the stream is not connected")
        id = next(self._ids)
        answer: asyncio.Future[Ack] = asyncio.get_running_loop().create_future()
        self._pending[id] = answer
        await self._tell({"op": op, "id": id, **fields})
        return await answer

    async def _connect(self) -> ClientConnection:
        """Connects and begins all subscriptions. Raises `ProblemError` where the server refuses."""
        try:
            socket = await connect(
                self.url,
                subprotocols=[Subprotocol("firn.v1.bin")],
                additional_headers=self._headers,
                compression=None,
                max_size=2 << 20,
                ping_interval=SILENCE / 2,
                ping_timeout=SILENCE / 2,
            )
        except InvalidStatus as error:
            response = error.response
            headers = {name.lower(): value for name, value in response.headers.raw_items()}
            raise ProblemError.from_response(response.status_code, bytes(response.body or b""), headers) from None
        self.welcome = json.loads(await socket.recv())
        self._socket = socket
        for subscription in list(self._subscriptions.values()):
            await self._tell(subscription._begin(self.welcome))
        return socket

    async def _run(self, socket: ClientConnection) -> None:
        try:
            while True:
                code, reason = await self._receive(socket)
                if code == 1000 or code >= FOR_GOOD:
                    raise StreamClosed(code, reason)
                self._drop(Disconnected(reason or "the connection was lost"))
                socket = await self._reconnect()
        except Exception as error:
            # Also what a caller's `on_event` raises: it comes out where subscriptions and commands are awaited.
            self._end(error, error)

    async def _receive(self, socket: ClientConnection) -> tuple[int, str]:
        """Takes messages in until the connection ends; close code and reason."""
        try:
            while True:
                self._take(await socket.recv())
        except ConnectionClosed:
            return socket.close_code or 1006, socket.close_reason or ""
        except (DecodeError, json.JSONDecodeError) as error:
            # What the message should have changed is asked for again.
            await socket.close(1002)
            return 1002, str(error)

    async def _reconnect(self) -> ClientConnection:
        for attempt in itertools.count():
            # Not all clients of a server that was restarted come back at the same moment.
            await asyncio.sleep(min(LONGEST_WAIT, FIRST_WAIT * 2**attempt) * random.uniform(0.5, 1))
            try:
                return await self._connect()
            except ProblemError as error:
                if error.status in REFUSALS:
                    raise
            except (OSError, TimeoutError, InvalidHandshake, ConnectionClosed):
                pass
        raise AssertionError("counting does not end")

    def _take(self, data: str | bytes) -> None:
        if isinstance(data, bytes):
            heights = decode(data)
            if heights.id in self._subscriptions:
                self._subscriptions[heights.id]._take(heights)
            return
        message = json.loads(data)
        match message["op"]:
            case "ack" if message["id"] in self._pending:
                _settle(self._pending.pop(message["id"]), message)
            case "error":
                self._refused(message["id"], ProblemError(message["problem"]))
            case "event" if self._on_event is not None:
                self._on_event(message)

    def _refused(self, id: int, problem: ProblemError) -> None:
        if id in self._pending:
            _settle(self._pending.pop(id), problem)
        elif id in self._subscriptions:
            self._subscriptions.pop(id)._end(problem)

    async def _tell(self, message: dict[str, Any]) -> None:
        """Sends a message, where the stream is connected; `_run` finds out where it no longer is."""
        if self._socket is not None:
            with contextlib.suppress(ConnectionClosed):
                await self._socket.send(json.dumps(message))

    def _drop(self, why: Exception) -> None:
        """Lets go of the socket; who waits for an answer is told."""
        self._socket = None
        for answer in self._pending.values():
            _settle(answer, why)
        self._pending.clear()

    def _end(self, why: Exception, iterations: Exception) -> None:
        self._ended = self._ended or why
        self._drop(why)
        for subscription in self._subscriptions.values():
            subscription._end(iterations)


def _settle(answer: asyncio.Future[Ack], outcome: Ack | Exception) -> None:
    if answer.done():
        return  # the caller has gone
    if isinstance(outcome, Exception):
        answer.set_exception(outcome)
    else:
        answer.set_result(outcome)
