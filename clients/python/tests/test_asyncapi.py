"""api/asyncapi.yaml against a real server: what its examples send is answered as its examples say, in both
sub-protocols, and whatever a server sends is described."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator, Sequence
from typing import Any

import pytest
import yaml
from jsonschema import Draft202012Validator
from referencing import Registry
from referencing.jsonschema import DRAFT202012
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Subprotocol

from firn import GROUND_STEPS_PER_METRE, Client, GroundTile, HeightMessage, Tile, decode
from server import ROOT

DOCUMENT = yaml.safe_load((ROOT / "api/asyncapi.yaml").read_text())
MESSAGES = DOCUMENT["components"]["messages"]
REST = json.loads((ROOT / "api/openapi.json").read_text())
DOCUMENTS = Registry().with_resources(
    [("asyncapi.yaml", DRAFT202012.create_resource(DOCUMENT)), ("openapi.json", DRAFT202012.create_resource(REST))]
)
SENT = [
    reference["$ref"].rsplit("/", 1)[1]
    for operation in DOCUMENT["operations"].values()
    if operation["action"] == "receive"
    for reference in operation["messages"]
]
TOLD = [name for name in MESSAGES if name not in SENT]
# Commands that change heights or objects.
CHANGES = ("snowfall", "clearing", "collider.put", "collider.patch", "collider.delete", "colliders.batch", "stamps")
# Commands that change settings.
SETTINGS = ("air_temperature", "set")
# The session that the examples are about, but for those of the weather, which only alpine snow feels.
SESSION = {"id": "alp", "paused": True, "grid": {"width": 4, "depth": 3, "height": 10, "cell_size": 0.5}}
THESIS = [name for name in SENT if name != "weather"]


def examples(names: list[str]) -> list[dict[str, Any]]:
    return [example["payload"] for name in names for example in MESSAGES[name].get("examples", [])]


def validate(name: str, message: Any) -> None:
    schema = {"$ref": f"asyncapi.yaml#/components/messages/{name}/payload"}
    Draft202012Validator(schema, registry=DOCUMENTS).validate(message)


def as_json(message: HeightMessage) -> dict[str, Any]:
    """What `firn.v1.json` says for a binary message of quantum 1 mm."""
    tiles = tiles_as_json(message.tiles, 1000)
    said = {"op": message.op, "id": message.id, "seq": message.seq, "tick": message.tick, "tiles": tiles}
    told = {
        "recovered": message.recovered,
        "level": message.level or None,
        "terrain": tiles_as_json(message.terrain, GROUND_STEPS_PER_METRE) or None,
        "colliders": message.colliders,
        "more": message.more or None,
    }
    return said | {name: value for name, value in told.items() if value is not None}


def tiles_as_json(tiles: Sequence[Tile | GroundTile], steps_per_metre: int) -> list[dict[str, Any]]:
    return [
        {
            "column_x": tile.column_x,
            "column_z": tile.column_z,
            "width": tile.heights.shape[1],
            "depth": tile.heights.shape[0],
            "heights": (tile.heights.ravel() / steps_per_metre).tolist(),
        }
        for tile in tiles
    ]


class Conversation:
    """A socket that holds every message from the server against the document."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.heard: list[dict[str, Any]] = []
        self.binary: set[str] = set()

    async def hear(self) -> dict[str, Any]:
        data = await self.socket.recv()
        if isinstance(data, bytes):
            self.binary.add(data.hex(" "))
            message = as_json(decode(data))
        else:
            message = json.loads(data)
        assert message["op"] in TOLD
        validate(message["op"], message)
        self.heard.append(message)
        return message

    async def until(self, **wanted: Any) -> dict[str, Any]:
        """Listens until a message says what is wanted."""
        while True:
            message = await self.hear()
            if wanted.items() <= message.items():
                return message

    async def say(self, message: dict[str, Any]) -> None:
        """Sends a message; listens until it is answered, and the first subscription told what it has changed: of
        events that wait together the newest stands for all."""
        await self.socket.send(json.dumps(message))
        answer = await self.until(id=message["id"])
        if answer["op"] == "ack" and message["op"] in CHANGES:
            while not any(self._told(answer["seq"])):
                await self.hear()
        if answer["op"] == "ack" and message["op"] in SETTINGS:
            told = {"event": "settings", "seq": answer["seq"]}
            while not any(told.items() <= heard.items() for heard in self.heard):
                await self.hear()

    def _told(self, seq: int) -> Iterator[bool]:
        return (heard["op"] == "delta" and (heard["id"], heard["seq"]) == (1, seq) for heard in self.heard)


def with_epoch(message: dict[str, Any], epoch: str) -> dict[str, Any]:
    """An example as this server's session has it: epochs differ."""
    if message["op"] == "welcome":
        return message | {"epoch": epoch}
    if resume := message.get("resume"):
        return message | {"resume": resume | {"epoch": epoch}}
    return message


@pytest.mark.parametrize("name", [name for name in MESSAGES if name != "heights"])
def test_examples_keep_to_their_schemas(name: str) -> None:
    assert MESSAGES[name]["examples"], f"{name} has no example"
    for example in examples([name]):
        validate(name, example)


@pytest.mark.parametrize("protocol", ["firn.v1.json", "firn.v1.bin"])
async def test_examples_are_what_a_server_says(client: Client, protocol: str) -> None:
    session = client.create_session(**SESSION)
    async with (
        asyncio.timeout(60),
        connect(session.stream().url, subprotocols=[Subprotocol(protocol)]) as socket,
    ):
        story = Conversation(socket)
        epoch = (await story.until(op="welcome"))["epoch"]
        # In the order of their ids; what is about the subscription itself comes last.
        order = [message["id"] + 100 * (message["op"] in ("update", "unsubscribe")) for message in examples(THESIS)]
        for _, message in sorted(zip(order, examples(THESIS), strict=True), key=lambda item: item[0]):
            await story.say(with_epoch(message, epoch))
        await story.say({"op": "snowfall", "id": 11, "depth": -1})
        await story.say({"op": "collider.delete", "id": 12, "collider": "fox"})
        await socket.send('{"op"')
        await story.until(op="error", id=None)
        session.reset()
        await story.until(event="reset")
        laid = session.put_terrain([[-1.5, -1, -0.5, 0], [-1.25, -0.75, -0.25, 0.25], [-1, -0.5, 0, 0.5]])
        await story.until(event="terrain", seq=laid["seq"])
        session.snowfall(0.5)
        session.set(paused=False)
        settled = await story.until(event="settled")
        session.delete()
        with pytest.raises(ConnectionClosed):
            while True:
                await story.hear()
        assert f"| {socket.close_code} |" in DOCUMENT["info"]["description"]

    for example in examples(TOLD):
        if example.get("event") in ("step_progress", "weather"):  # no part of this conversation
            continue
        if example.get("event") == "settled":  # when that is, is the clock's business
            example = example | {"tick": settled["tick"], "seq": settled["seq"]}
        assert with_epoch(example, epoch) in story.heard
    if protocol == "firn.v1.bin":
        assert any(f"`{message}`" in MESSAGES["heights"]["description"] for message in story.binary)


@pytest.mark.parametrize("protocol", ["firn.v1.json", "firn.v1.bin"])
async def test_examples_of_the_weather_are_what_a_server_says(client: Client, protocol: str) -> None:
    session = client.create_session(**SESSION, physics="alpine")
    async with (
        asyncio.timeout(60),
        connect(session.stream().url, subprotocols=[Subprotocol(protocol)]) as socket,
    ):
        story = Conversation(socket)
        await story.say({"op": "subscribe", "id": 21, "events": ["weather"], "max_rate": 60})
        for message in examples(["weather"]):
            await story.say(message)
            told = {"event": "weather", "seq": story.heard[-1]["seq"]}
            while not any(told.items() <= heard.items() for heard in story.heard):
                await story.hear()
    (example,) = (example for example in examples(["event"]) if example["event"] == "weather")
    assert example in story.heard
