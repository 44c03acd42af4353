"""The stream against a real server: what a subscription holds is what REST tells."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from firn import Change, Client, Disconnected, ProblemError, Session, StreamClosed, Subscription, decode
from firn.types import ColumnRegion, DepthWatch, Event
from line import Line
from server import Server

GRID = {"width": 50, "depth": 20, "height": 30, "cell_size": 0.2}


def assert_same(snow: Subscription, session: Session, **part: int) -> None:
    """Heights are REST's, rounded half-up to a millimetre."""
    depths = session.heights(**part).heights.astype(np.float64)
    np.testing.assert_array_equal(np.round(snow.heights * 1000), np.floor(depths / 0.001 + 0.5))


async def until(snow: Subscription, wanted: Callable[[Change], bool]) -> Change:
    async with asyncio.timeout(30):
        async for change in snow:
            if wanted(change):
                return change
    raise AssertionError("the subscription has ended")


async def test_a_subscription_holds_what_rest_tells(client: Client) -> None:
    session = client.create_session(id="watched", grid=GRID, paused=True, initial_snow=[{"depth": 3}])
    async with session.stream() as stream:
        assert stream.welcome["grid"] == GRID
        whole = await stream.subscribe(colliders=True, max_rate=60)
        coarse = await stream.subscribe(stride=4, max_rate=60)
        assert whole.heights.shape == (20, 50) and (whole.heights == 3).all()
        assert await anext(whole)

        fall = await stream.command("snowfall", depth=0.5, region={"x": 1, "z": 1, "width": 3, "depth": 1})
        sledge = {"id": "sledge", "mass": 50, "shape": {"type": "disk", "radius": 0.4}, "position": {"x": 5, "z": 2}}
        put = await stream.command("collider.put", collider=sledge)
        change = await until(whole, lambda change: change.seq >= put["seq"])
        assert [collider["id"] for collider in whole.colliders] == ["sledge"] and change.colliders
        assert_same(whole, session)
        await until(coarse, lambda change: change.seq >= fall["seq"])
        assert_same(coarse, session, stride=4)


async def test_a_state_is_resumed_by_the_epoch_that_it_was_told_under() -> None:
    sent: list[dict[str, Any]] = []
    wish = {"region": None, "stride": 1, "max_rate": 20, "quantum": 0.001, "colliders": False}
    snow = Subscription(1, wish, sent.append)
    grid = {"width": 8, "depth": 8, "height": 1, "cell_size": 1.0}

    def begin(epoch: str) -> Any:
        welcome: Any = {"epoch": epoch, "grid": grid}
        return snow._begin(welcome)["resume"]

    assert begin("one") is None
    snow._take(decode(bytes.fromhex("01 00 02 05 00 01 01 00 02 00 07")))
    assert (snow.seq, snow.heights[0, 0]) == (5, 0.007)
    # The connections to the second server end before its snapshot is there.
    assert begin("two") == {"epoch": "one", "seq": 5}
    assert begin("two") == {"epoch": "one", "seq": 5}


async def test_only_tiles_that_changed_are_told(client: Client) -> None:
    session = client.create_session(grid=GRID, paused=True, initial_snow=[{"depth": 1}])
    async with session.stream() as stream:
        snow = await stream.subscribe(max_rate=60)
        assert len((await anext(snow)).parts) == 7 * 3
        session.snowfall(1, region={"x": 1.6, "z": 0, "width": 0.2, "depth": 0.2})
        change = await anext(snow)
        assert change.parts == [(slice(0, 8), slice(8, 16))]
        assert np.argwhere(snow.heights > 1.5).tolist() == [[0, 8]]


async def test_a_subscription_moves(client: Client) -> None:
    session = client.create_session(grid=GRID, paused=True, initial_snow=[{"depth": 1}])
    session.snowfall(0.5, region={"x": 1, "z": 1, "width": 3, "depth": 1})
    async with session.stream() as stream:
        snow = await stream.subscribe(region={"column_x": 3, "column_z": 3, "width": 4, "depth": 6}, max_rate=60)
        assert (snow.column_x, snow.column_z, snow.heights.shape) == (0, 0, (16, 8))
        await snow.move({"column_x": 0, "column_z": 8, "width": 16, "depth": 8})
        assert not np.isnan(snow.heights[:, :8]).any() and np.isnan(snow.heights[:, 8:]).all()
        await until(snow, lambda _: not np.isnan(snow.heights).any())
        assert_same(snow, session, column_x=0, column_z=8, width=16, depth=8)
        with pytest.raises(ValueError, match="50 × 20"):
            await snow.move({"column_x": 50, "column_z": 0, "width": 8, "depth": 8})
        await stream.unsubscribe(snow)
        assert len([change async for change in snow]) <= 1


async def test_the_ground_is_held_where_it_is_wanted(client: Client, server: Server) -> None:
    slope = np.add.outer(-np.arange(20.0), np.arange(50) / 4)
    session = client.create_session(id="slope", grid=GRID, paused=True, terrain={"heights": slope.ravel().tolist()})
    async with Line(server.port) as line:
        with Client(line.url) as far:
            stream = far.session("slope").stream()
        async with stream:
            assert (await stream.subscribe()).ground is None
            snow = await stream.subscribe(terrain=True, max_rate=60)
            coarse = await stream.subscribe(terrain=True, stride=8, max_rate=60)
            assert (await anext(snow)).ground and (await anext(coarse)).ground
            assert snow.ground is not None and coarse.ground is not None
            np.testing.assert_array_equal(snow.ground, slope)
            np.testing.assert_array_equal(coarse.ground, slope[::8, ::8])
            session.snowfall(1)
            assert not (await anext(snow)).ground

            region: ColumnRegion = {"column_x": 16, "column_z": 8, "width": 8, "depth": 8}
            part = await stream.subscribe(terrain=True, region=region, max_rate=60)
            await part.move({**region, "width": 16})
            await until(part, lambda _: not np.isnan(part.heights).any())
            np.testing.assert_array_equal(part.ground, slope[8:16, 16:32])

            line.cut()
            session.put_terrain(slope * 2)
            line.mend()
            change = await until(snow, lambda change: change.recovered is not None)
            assert change.recovered and change.ground and change.parts == []
            np.testing.assert_array_equal(snow.ground, slope * 2)
            session.put_terrain(slope * 0)
            await until(snow, lambda change: change.ground)
            assert (snow.ground == 0).all()


async def test_events_and_watches_are_told(client: Client) -> None:
    session = client.create_session(grid=GRID, paused=True, initial_snow=[{"depth": 1}])
    events: asyncio.Queue[Event] = asyncio.Queue()
    tile: ColumnRegion = {"column_x": 8, "column_z": 8, "width": 8, "depth": 8}

    async def told() -> tuple[Any, ...]:
        event = await asyncio.wait_for(events.get(), 30)
        return (event["event"], event["id"], event["holds"]) if event["event"] == "watch" else (event["event"],)

    async with session.stream(on_event=events.put_nowait) as stream:
        watch: DepthWatch = {"id": "deep", "region": tile, "above": 1.5}
        snow = await stream.subscribe(region=tile, max_rate=60, events=["settings"], watch=[watch])
        assert await told() == ("watch", "deep", False)
        session.snowfall(1)
        assert await told() == ("watch", "deep", True)
        await stream.command("air_temperature", celsius=-7)
        assert await told() == ("settings",)
        await snow.want(events=True, watch=[{"id": "bare", "below": 0.1}])
        assert await told() == ("watch", "bare", False)
        session.clear(0)
        assert {await told(), await told()} == {("clearing",), ("watch", "bare", True)}


async def test_refusals_and_endings(client: Client) -> None:
    session = client.create_session(id="short", grid=GRID)
    events: list[str] = []
    async with session.stream(on_event=lambda event: events.append(event["event"])) as stream:
        with pytest.raises(ProblemError) as refused:
            await stream.command("snowfall", depth=-1)
        assert [error.pointer for error in refused.value.errors] == ["/depth"]
        with pytest.raises(ProblemError, match="max_rate"):
            await stream.subscribe(max_rate=1000)
        await stream.command("set", paused=True)
        snow = await stream.subscribe()
        await until(snow, lambda _: True)
        session.delete()
        with pytest.raises(StreamClosed) as ended:
            await until(snow, lambda _: False)
        assert ended.value.code == 3502
        with pytest.raises(StreamClosed):
            await stream.command("ping")
    assert "settings" in events
    with pytest.raises(ProblemError) as unknown:
        await session.stream().__aenter__()
    assert unknown.value.status == 404


async def test_a_closed_stream_ends_its_iterations(client: Client) -> None:
    session = client.create_session(grid=GRID, paused=True)
    async with session.stream() as stream:
        snow = await stream.subscribe()
        await anext(snow)
        waiting = asyncio.create_task(anext(snow, None))
        await asyncio.sleep(0)  # it begins to wait
    assert await waiting is None
    with pytest.raises(Disconnected):
        await stream.command("snowfall", depth=1)


async def test_a_stream_that_was_cut_gets_exactly_what_it_missed(client: Client, server: Server) -> None:
    session = client.create_session(id="cut", grid=GRID, paused=True, initial_snow=[{"depth": 2}])
    async with Line(server.port) as line:
        with Client(line.url) as far:
            stream = far.session("cut").stream()
        async with stream:
            snow = await stream.subscribe(max_rate=60)
            await anext(snow)
            line.cut()
            fall = session.snowfall(0.3, region={"x": 0, "z": 0, "width": 1, "depth": 1})
            line.mend()
            change = await until(snow, lambda change: change.recovered is not None)
            assert change.recovered is True and change.seq >= fall["seq"]
            assert change.parts == [(slice(0, 8), slice(0, 8))]
            assert_same(snow, session)


async def test_a_stream_outlives_its_server() -> None:
    grid = {**GRID, "width": 24}
    first = Server()
    with Client(first.url) as client:
        session = client.create_session(id="phoenix", grid=GRID, paused=True, initial_snow=[{"depth": 2}])
        async with session.stream() as stream:
            snow = await stream.subscribe()
            await anext(snow)
            first.kill()
            second = Server(first.port)
            # Another session of the same name: its state is another, and so is its grid.
            client.create_session(id="phoenix", grid=grid, paused=True, initial_snow=[{"depth": 1}])
            await until(snow, lambda change: change.seq > 0 and snow.heights.shape == (20, 24))
            assert (snow.heights == 1).all()
        second.stop()
