"""Objects that move and carry snow, over REST and the stream, against a real server."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from firn import Client, ProblemError, Session
from firn.types import Collider, ColliderSpec

SKI: ColliderSpec = {
    "id": "ski",
    "mass": 60,
    "shape": {"type": "box", "width": 0.2, "depth": 0.2},
    "position": {"x": 0.55, "z": 1},
}


def soft(client: Client) -> Session:
    """6 m × 2 m of snow that gives way at once, at 20 ticks a second."""
    return client.create_session(
        grid={"width": 60, "depth": 20, "height": 20, "cell_size": 0.1},
        preset="game",
        pressing=0,
        paused=True,
        tick_rate=20,
        initial_snow=[{"depth": 1}],
    )


def place(collider: Collider) -> Any:
    return pytest.approx((collider["position"]["x"], collider["position"]["z"]), abs=1e-6)


def test_an_object_moves_with_its_velocity_and_turns(client: Client) -> None:
    session = soft(client)
    put = session.put_collider({**SKI, "velocity": {"x": 2, "z": 0}, "turn_rate": 90})
    assert place(put) == (0.55, 1) and put["velocity"] == {"x": 2, "z": 0} and put["turn_rate"] == 90
    session.step(ticks=20)
    moved = session.collider("ski")
    assert place(moved) == (2.55, 1) and moved["heading"] == pytest.approx(90) and not moved["resting"]
    assert not session.get()["settled"]
    stopped = session.patch_collider("ski", velocity={"x": 0, "z": 0}, turn_rate=0)
    assert "velocity" not in stopped and "turn_rate" not in stopped
    with pytest.raises(ProblemError) as refused:
        session.patch_collider("ski", velocity={"x": 80, "z": 80}, turn_rate=721)
    assert {error.pointer for error in refused.value.errors} == {"/velocity", "/turn_rate"}


def test_an_object_follows_a_path(client: Client) -> None:
    session = soft(client)
    put = session.put_collider({**SKI, "path": [[1.55, 1], [1.55, 1.5]], "over": 1.5})
    assert put["speed"] == pytest.approx(1) and put["path"] == [[1.55, 1], [1.55, 1.5]]
    session.step(ticks=25)
    underway = session.collider("ski")
    assert place(underway) == (1.55, 1.25) and underway["path"] == [[1.55, 1.5]]
    session.patch_collider("ski", path=[[1.55, 0.25]], over=1, velocity={"x": 1, "z": 0})
    session.step(ticks=30)
    after = session.collider("ski")
    assert place(after) == (2.05, 0.25) and "path" not in after and "speed" not in after
    with pytest.raises(ProblemError, match="/over"):
        session.patch_collider("ski", path=[[1, 1]])


def test_a_sweep_leaves_a_track_and_a_lift_leaves_none(client: Client) -> None:
    session = soft(client)
    untouched = float(session.heights().heights[0, 0])
    session.put_collider(SKI)
    swept = session.patch_collider("ski", position={"x": 2.55, "z": 1}, heading=90, sweep=True)
    assert place(swept) == (0.55, 1) and swept["path"] == [[2.55, 1]] and swept["turn_to"] == 90
    session.step(ticks=1)
    there = session.collider("ski")
    assert place(there) == (2.55, 1) and there["heading"] == 90 and "turn_to" not in there
    session.patch_collider("ski", position={"x": 4.55, "z": 1})
    session.step(ticks=1)
    dents = untouched - session.heights().heights[10]
    assert (dents[6:26] > 0.05).all() and (dents[28:43] < 0.01).all()
    with pytest.raises(ProblemError, match="/sweep"):
        session.patch_collider("ski", sweep=True)


def test_snow_lies_on_objects(client: Client) -> None:
    session = soft(client)
    shape = {"type": "box", "width": 1, "depth": 1}
    session.put_collider({"id": "roof", "mass": 50, "shape": shape, "position": {"x": 1, "z": 1}})
    session.put_collider({"id": "fence", "mass": 50, "shape": shape, "position": {"x": 4, "z": 1}, "shelters": False})
    session.snowfall(0.3, density=60)
    roof, fence = session.collider("roof"), session.collider("fence")
    assert roof["burden"] == pytest.approx(18, rel=1e-3) and (fence["shelters"], fence["burden"]) == (False, 0)
    assert roof["pressure"] * roof["contact_area"] == pytest.approx(9.81 * (50 + roof["burden"]))
    mass = session.mass()
    assert mass["carried"] == roof["burden"] and mass["imbalance_quanta"] == 0
    assert mass["fallen"] == pytest.approx(mass["present"] + mass["carried"] + mass["refused"])

    session.clear(0)
    heights = session.heights().heights
    assert heights[10, 10] > 0.1 and heights[10, 40] > 0.1 and heights[10, 25] == 0
    session.patch_collider("roof", position={"x": 2.5, "z": 1})
    assert session.collider("roof")["burden"] < 0.01
    assert session.heights().heights[10, 10] == pytest.approx(heights[10, 10] + 0.3, rel=1e-3)
    assert session.mass()["imbalance_quanta"] == 0


async def test_an_object_is_patched_over_the_stream(client: Client) -> None:
    session = soft(client)
    session.put_collider(SKI)
    async with session.stream() as stream:
        snow = await stream.subscribe(colliders=True, max_rate=60)
        patch = {"velocity": {"x": 1, "z": 0}, "path": [[1.05, 1]], "over": 0.5}
        ack = await stream.command("collider.patch", collider="ski", patch=patch)
        assert ack["collider"]["path"] == [[1.05, 1]] and ack["collider"]["speed"] == pytest.approx(1)
        session.step(ticks=20)
        async with asyncio.timeout(30):
            while not snow.colliders or place(snow.colliders[0]) != (1.55, 1):
                await anext(snow)
        sweep = {"position": {"x": 3.05, "z": 1}, "sweep": True}
        ack = await stream.command("collider.patch", collider="ski", patch=sweep)
        session.step(ticks=1)
        async with asyncio.timeout(30):
            while place(snow.colliders[0]) != (3.05, 1):
                await anext(snow)
        assert (snow.heights[10, 7:30] < snow.heights[0, 0] - 0.05).all()
        with pytest.raises(ProblemError) as refused:
            await stream.command("collider.patch", collider="ski", patch={"sweep": True})
        assert [error.pointer for error in refused.value.errors] == ["/patch/sweep"]
        with pytest.raises(ProblemError) as unknown:
            await stream.command("collider.patch", collider="nobody", patch={"mass": 1})
        assert unknown.value.status == 404
