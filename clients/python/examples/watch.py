"""Lets snow fall on a new session and watches it settle: python examples/watch.py [URL]"""

import asyncio
import sys

from firn import Client


async def main(url: str = "http://127.0.0.1:8080") -> None:
    with Client(url) as firn:
        session = firn.create_session(initial_snow=[{"depth": 2}], time_scale=30)
        async with session.stream() as stream:
            snow = await stream.subscribe(max_rate=1)
            await stream.command("snowfall", depth=1, region={"x": 0, "z": 0, "width": 5, "depth": 10})
            for _ in range(5):
                change = await anext(snow)
                low, high = snow.heights.min(), snow.heights.max()
                print(f"tick {change.tick}: {len(change.parts)} tiles changed, {low:.3f} to {high:.3f} m")
        session.delete()


asyncio.run(main(*sys.argv[1:]))
