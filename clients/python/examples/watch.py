"""Lets snow fall on a new session and watches it settle: python examples/watch.py [URL]"""

import asyncio
import sys

from firn import Client


async def main(url: str = "http://127.0.0.1:8080") -> None:
    with Client(url) as firn:
        session = firn.create_session(initial_snow=[{"depth": 2}], time_scale=60)
        async with session.stream() as stream:
            snow = await stream.subscribe(max_rate=2)
            await stream.command("snowfall", depth=1, region={"x": 0, "z": 0, "width": 5, "depth": 10})
            async for change in snow:
                lowest, highest = snow.heights.min(), snow.heights.max()
                print(f"tick {change.tick}: {len(change.parts)} tiles changed, {lowest:.3f} to {highest:.3f} m")
                if session.get()["settled"]:
                    break
        session.delete()


asyncio.run(main(*sys.argv[1:]))
