"""The C# files, compiled as plain .NET, against the test vectors and a real server: run by scripts/test-unity."""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import numpy as np
import pytest

from firn import Client, Session
from line import Line
from server import ROOT, Server

PROGRAM = ["mono", os.environ["FIRN_UNITY_TEST"]]
VECTORS = json.loads((ROOT / "api/height-stream-vectors.json").read_text())


@pytest.mark.parametrize("vector", VECTORS["messages"], ids=lambda vector: vector["name"])
def test_a_message_says_what_it_should(vector: dict[str, Any]) -> None:
    wanted = vector["message"]
    recovered = "-" if wanted["recovered"] is None else wanted["recovered"]
    head = [wanted[name] for name in ("op", "id", "seq", "tick")] + [recovered]
    head += [wanted[name] for name in ("more", "level", "stride")]
    tiles = [
        [tile[n] for n in ("column_x", "column_z", "width", "depth")] + tile["heights"]
        for tile in wanted["tiles"] + wanted["terrain"]
    ]
    said = subprocess.run([*PROGRAM, "decode", vector["hex"]], capture_output=True, text=True, check=True).stdout
    assert said.splitlines() == [" ".join(map(str, line)) for line in [head, *tiles]]


@pytest.mark.parametrize("vector", VECTORS["wrong"], ids=lambda vector: vector["name"])
def test_anything_else_is_refused(vector: dict[str, Any]) -> None:
    done = subprocess.run([*PROGRAM, "decode", vector["hex"]], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.splitlines()[-1][:5]) == (1, "byte ")


class Follower:
    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self.process = process

    async def line(self) -> list[str]:
        assert self.process.stdout is not None
        return (await asyncio.wait_for(self.process.stdout.readline(), 30)).decode().split()

    async def change(self, line: str) -> list[str]:
        """Has an object changed, and returns what is said of it: its fields, or why not."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"{line}\n".encode())
        while (said := await self.line())[0] == "told":
            pass
        return said

    async def told(self, *wanted: str) -> list[str]:
        """The first state of an object that begins so."""
        while (said := await self.line())[: len(wanted) + 1] != ["told", *wanted]:
            pass
        return said

    async def until(self, seq: int) -> tuple[str, np.ndarray]:
        """Recovered or not, and the heights [mm], once they are of a seq or later."""
        while True:
            told, recovered, width, _, *heights = await self.line()
            if int(told) >= seq:
                # With the ground, that lies below.
                return recovered, np.array(heights, int).reshape(-1, int(width))


@asynccontextmanager
async def follow(url: str, session: str, command: str = "follow") -> AsyncIterator[Follower]:
    process = await asyncio.create_subprocess_exec(
        *PROGRAM,
        command,
        url,
        session,
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        limit=1 << 20,
    )
    try:
        yield Follower(process)
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()


def millimetres(session: Session) -> np.ndarray:
    return np.floor(session.heights().heights.astype(float) / 0.001 + 0.5)


async def test_it_holds_what_rest_tells_also_after_a_lost_connection(client: Client, server: Server) -> None:
    grid = {"width": 50, "depth": 20, "height": 30, "cell_size": 0.2}
    session = client.create_session(id="unity", grid=grid, paused=True, initial_snow=[{"depth": 2}])
    async with Line(server.port) as line, follow(line.url, "unity") as follower:
        recovered, heights = await follower.until(0)
        assert recovered == "-" and heights.shape == (20, 50) and (heights == 2000).all()
        fall = session.snowfall(0.3, region={"x": 1, "z": 1, "width": 3, "depth": 1})
        _, heights = await follower.until(fall["seq"])
        np.testing.assert_array_equal(heights, millimetres(session))

        line.cut()
        fall = session.snowfall(0.5, region={"x": 0, "z": 0, "width": 2, "depth": 3})
        session.step(ticks=30)
        line.mend()
        recovered, heights = await follower.until(fall["seq"])
        assert recovered == "True"
        np.testing.assert_array_equal(heights, millimetres(session))

        session.delete()
        while (said := await follower.line())[0] != "ended":
            pass
        assert said[-1] == "(3502)"


async def test_it_holds_the_ground_where_that_is_wanted(client: Client, server: Server) -> None:
    grid = {"width": 20, "depth": 12, "height": 10, "cell_size": 0.5}
    slope = np.add.outer(-np.arange(12.0), np.arange(20) / 4)
    session = client.create_session(id="slope", grid=grid, paused=True, terrain={"heights": slope.ravel().tolist()})
    async with (
        Line(server.port) as line,
        follow(line.url, "slope", "ground") as follower,
    ):
        _, told = await follower.until(0)
        np.testing.assert_array_equal(told, np.concatenate([np.zeros((12, 20)), slope * 10000]))
        fall = session.snowfall(1)
        _, told = await follower.until(fall["seq"])
        np.testing.assert_array_equal(told, np.concatenate([np.full((12, 20), 1000), slope * 10000]))
        line.cut()
        laid = session.put_terrain(slope * 2)
        line.mend()
        recovered, told = await follower.until(laid["seq"])
        assert recovered == "True"
        np.testing.assert_array_equal(told[12:], slope * 20000)


async def test_a_watch_is_told_at_once_and_whenever_it_is_crossed(client: Client, server: Server) -> None:
    grid = {"width": 16, "depth": 8, "height": 30, "cell_size": 0.2}
    session = client.create_session(id="crossed", grid=grid, paused=True, initial_snow=[{"depth": 1}])
    async with (
        Line(server.port) as line,
        follow(line.url, "crossed", "watch") as follower,
    ):
        assert (await follower.line())[1:] == ["deep", "False", "1000"]
        fall = session.snowfall(1, region={"x": 0, "z": 0, "width": 1.6, "depth": 1.6})
        assert await follower.line() == [str(fall["seq"]), "deep", "True", "2000"]
        line.cut()
        session.clear(0.5)
        line.mend()
        assert (await follower.line())[1:] == ["deep", "False", "500"]


async def test_objects_move_are_swept_and_carry_snow(client: Client, server: Server) -> None:
    session = client.create_session(
        id="objects",
        grid={"width": 60, "depth": 20, "height": 20, "cell_size": 0.1},
        preset="game",
        pressing=0,
        paused=True,
        tick_rate=20,
        initial_snow=[{"depth": 1}],
    )
    untouched = float(session.heights().heights[0, 0])
    async with follow(server.url, "objects", "objects") as follower:
        # Place, heading, velocity, turn rate, points ahead, speed, heading to turn to, shelters, burden.
        put = await follower.change("put ski 60 0.2 0.55 1 1")
        assert " ".join(put) == "done ski 0.55 1 0 0 0 0 0 -1 -1 True 0"
        moving = await follower.change("velocity ski 1 0 360")
        assert " ".join(moving) == "done ski 0.55 1 0 1 0 360 0 -1 -1 True 0"
        session.step(ticks=10)
        await follower.told("ski", "1.05", "1", "180")
        assert (await follower.change("velocity ski 0 0 0"))[5:8] == ["0", "0", "0"]
        on_a_path = await follower.change("path ski 1.55 1 0.5")
        assert on_a_path[8:10] == ["1", "1"]
        session.step(ticks=10)
        assert (await follower.told("ski", "1.55", "1"))[8:10] == ["0", "-1"]
        swept = await follower.change("sweep ski 2.55 1 90")
        assert swept[2:4] == ["1.55", "1"] and swept[8:11] == ["1", "-1", "90"]
        session.step(ticks=1)
        assert (await follower.told("ski", "2.55", "1", "90"))[8:11] == ["0", "-1", "-1"]
        dents = untouched - session.heights().heights[10]
        assert (dents[6:26] > 0.05).all() and (dents[28:] < 0.01).all()
        assert (await follower.change("sweep nobody 1 1 0"))[0] == "CommandRefusedException"
        assert (await follower.change("velocity ski 80 80 0"))[0] == "CommandRefusedException"

        assert (await follower.change("put roof 50 1 4 1 1"))[11] == "True"
        assert (await follower.change("put fence 50 1 5.5 1 0"))[11] == "False"
        session.snowfall(0.3, density=60)
        while (burden := (await follower.told("roof", "4", "1"))[12]) == "0":
            pass
        assert float(burden) == pytest.approx(18, rel=1e-3)
        assert session.collider("fence")["burden"] == 0
        assert await follower.change("delete roof") == ["gone"]
        assert [collider["id"] for collider in session.colliders()] == ["fence", "ski"]
