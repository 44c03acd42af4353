"""A session over REST."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self, Unpack, cast
from urllib.parse import quote

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .stream import Stream
from .types import (
    BatchReply,
    Checkpoint,
    ClearingReply,
    Collider,
    ColliderPatch,
    ColliderSpec,
    Column,
    Event,
    HeightsQuery,
    Load,
    MassLedger,
    OnError,
    Print,
    Probe,
    ProbeSpec,
    Region,
    RenderQuery,
    SampleField,
    SessionView,
    SettingsPatch,
    SnowfallReply,
    Stamp,
    StampedCollider,
    StampSpec,
    Step,
    TerrainQuery,
    Usage,
    Weather,
    WeatherSeries,
    WeatherView,
)

if TYPE_CHECKING:
    from .client import Client


@dataclass(frozen=True)
class Heights:
    """Heights, or another quantity of the columns, and when they hold."""

    heights: NDArray[np.float32]
    """[m], or in the unit of the quantity; shape (depth, width): `heights[z, x]`."""
    tick: int
    seq: int
    """Number of the state. It only grows, and may exceed 32 bits."""


@dataclass(frozen=True)
class Samples:
    """The snow at points, and when it is so."""

    fields: dict[SampleField, NDArray[np.float32]]
    """Of shape (points,), `normal` of shape (points, 3); NaN where there is no snow."""
    tick: int
    seq: int


class Session:
    """One session of a server. A change is answered once it is applied and visible to the next read."""

    def __init__(self, client: Client, id: str) -> None:
        self.client = client
        self.id = id
        self.path = f"/v1/sessions/{quote(id, safe='')}"
        self.token: str | None = None
        """Allows everything about this session; only its creator knows it."""
        self.viewer_token: str | None = None
        """Allows its reads and streams."""

    @classmethod
    def created(cls, client: Client, view: dict[str, Any]) -> Self:
        """A session from the answer to its creation."""
        session = cls(client, view["id"])
        session.token, session.viewer_token = view["token"], view["viewer_token"]
        return session

    def _call(self, method: str, path: str = "", **options: Any) -> Any:
        response = self.client.request(method, self.path + path, **options)
        return response.json() if response.content else None

    def _post(self, path: str, body: dict[str, Any], idempotency_key: str | None) -> Any:
        given = {name: value for name, value in body.items() if value is not None}
        return self._call("POST", path, json=given, idempotency_key=idempotency_key)

    def get(self) -> SessionView:
        """Its configuration, clock and summary."""
        return cast(SessionView, self._call("GET"))

    def set(self, **settings: Unpack[SettingsPatch]) -> SessionView:
        """Changes settings; those left out stay."""
        return cast(SessionView, self._call("PATCH", json=settings))

    def delete(self) -> None:
        """Deletes it."""
        self._call("DELETE")

    def step(self, **step: Unpack[Step]) -> SessionView:
        """Steps it while it is paused, as fast as the server can."""
        return cast(SessionView, self._call("POST", "/step", json=step, timeout=None))

    def end_step(self) -> None:
        """Ends the step under way at the tick it has reached; 409 where there is none."""
        self._call("DELETE", "/step")

    def reset(self, *, checkpoint: str | None = None, snapshot: bytes | None = None) -> SessionView:
        """Back to the state it was created in, to a restore point, or to what a snapshot of the same grid holds."""
        if snapshot is not None:
            headers = {"content-type": "application/vnd.firn.snapshot"}
            return cast(SessionView, self._call("POST", "/reset", content=snapshot, headers=headers))
        return cast(SessionView, self._call("POST", "/reset", json={"checkpoint": checkpoint}))

    def checkpoints(self) -> list[Checkpoint]:
        """Its restore points, in ascending order of their names."""
        return list(self._call("GET", "/checkpoints")["items"])

    def put_checkpoint(self, name: str) -> Checkpoint:
        """Keeps its present state under a name; a restore point of that name is replaced."""
        return cast(Checkpoint, self._call("PUT", f"/checkpoints/{quote(name, safe='')}"))

    def delete_checkpoint(self, name: str) -> None:
        """Deletes a restore point."""
        self._call("DELETE", f"/checkpoints/{quote(name, safe='')}")

    def snapshot(self) -> bytes:
        """All of it in one piece, for `Client.restore_session`."""
        headers = {"accept": "application/vnd.firn.snapshot"}
        return self.client.request("GET", f"{self.path}/snapshot", headers=headers).content

    def digest(self) -> str:
        """A hash of what a snapshot holds: equal ones, equal snowpacks."""
        return str(self._call("GET", "/digest")["digest"])

    def snowfall(
        self,
        depth: float,
        *,
        density: float | None = None,
        temperature: float | None = None,
        region: Region | None = None,
        idempotency_key: str | None = None,
    ) -> SnowfallReply:
        """Lets snow fall at once [m, kg/m³, °C]. Above objects it lies on them, unless their `shelters` is false."""
        body = {"depth": depth, "density": density, "temperature": temperature, "region": region}
        return cast(SnowfallReply, self._post("/snowfalls", body, idempotency_key))

    def clear(
        self,
        depth: float,
        *,
        region: Region | None = None,
        path: Sequence[Sequence[float]] | None = None,
        width: float | None = None,
        idempotency_key: str | None = None,
    ) -> ClearingReply:
        """Leaves at most a depth [m] standing, as a plough does: everywhere, in a region, or along a path [m].

        The snow under objects stays, unless they are airborne.
        """
        body = {"depth": depth, "region": region, "path": path, "width": width}
        return cast(ClearingReply, self._post("/clearings", body, idempotency_key))

    def set_air_temperature(self, celsius: float) -> Stamp:
        """Sets the air temperature [°C]."""
        return cast(Stamp, self._call("PUT", "/air-temperature", json={"celsius": celsius}))

    def weather(self) -> WeatherView:
        """The weather of alpine snow: what was told, what holds now, and what of that was worked out."""
        return cast(WeatherView, self._call("GET", "/weather"))

    def put_weather(self, weather: Weather | WeatherSeries) -> Stamp:
        """Gives alpine snow another weather: values that hold until they are replaced, or a series."""
        return cast(Stamp, self._call("PUT", "/weather", json=weather))

    def colliders(self) -> Iterator[Collider]:
        """The objects on the snow, page by page."""
        yield from self.client._pages(f"{self.path}/colliders")

    def collider(self, id: str) -> StampedCollider:
        """An object on the snow: where it stands, how it moves, and its `burden`, the snow that lies on it [kg]."""
        return cast(StampedCollider, self._call("GET", f"/colliders/{quote(id, safe='')}"))

    def put_collider(self, collider: ColliderSpec) -> StampedCollider:
        """Puts an object on the snow; replaces the one of the same id.

        It moves by itself with a `velocity` [m/s], a `turn_rate` [°/s], or a `path` [m] and the time `over` it [s].
        """
        body = {name: value for name, value in collider.items() if name != "id"}
        id = collider.get("id")
        if id is not None:
            return cast(StampedCollider, self._call("PUT", f"/colliders/{quote(id, safe='')}", json=body))
        return cast(StampedCollider, self._call("POST", "/colliders", json=body))

    def patch_collider(self, id: str, **patch: Unpack[ColliderPatch]) -> StampedCollider:
        """Changes parts of an object; those left out stay.

        `position` and `heading` lift it to another place; with `sweep=True` they push it there in the next cycle, and
        it leaves a track. `velocity` and `position` end a path.
        """
        return cast(StampedCollider, self._call("PATCH", f"/colliders/{quote(id, safe='')}", json=patch))

    def delete_collider(self, id: str) -> None:
        """Removes an object."""
        self._call("DELETE", f"/colliders/{quote(id, safe='')}")

    def batch_colliders(
        self, put: Iterable[ColliderSpec] = (), delete: Iterable[str] = (), *, on_error: OnError = "refuse"
    ) -> BatchReply:
        """Puts and removes up to 4096 objects in one frame: all or none, or with `on_error="skip"` those without error.

        It then has `results`, one for each.
        """
        body = {"put": list(put), "delete": list(delete), "on_error": on_error}
        return cast(BatchReply, self._call("POST", "/colliders:batch", json=body))

    def stamp(self, stamps: Iterable[StampSpec], *, idempotency_key: str | None = None) -> list[Print]:
        """Presses the prints of up to 4096 loads into the snow in one frame, all or none."""
        return list(self._post("/stamps", {"stamps": list(stamps)}, idempotency_key)["stamps"])

    def heights(self, **query: Unpack[HeightsQuery]) -> Heights:
        """Snow depths; of a part by `column_x`, `column_z`, `width`, `depth`, `stride`; `surface` adds the ground.

        Of alpine snow also another `quantity`: `"snow_water_equivalent"`, `"liquid_water"` [kg/m²] or
        `"skin_temperature"` [°C].
        """
        params = {name: str(value).lower() for name, value in query.items()}
        return self._array("/heights", params)

    def terrain(self, **query: Unpack[TerrainQuery]) -> Heights:
        """Elevations of the ground [m]; of a part by `column_x`, `column_z`, `width`, `depth`, `stride`."""
        return self._array("/terrain", {name: str(value) for name, value in query.items()})

    def put_terrain(self, elevations: ArrayLike) -> Stamp:
        """Lays other ground under the snow: elevations [m] of shape (depth, width)."""
        file = io.BytesIO()
        np.save(file, np.ascontiguousarray(elevations, dtype="<f8"), allow_pickle=False)
        headers = {"content-type": "application/x-npy"}
        response = self.client.request("PUT", f"{self.path}/terrain", content=file.getvalue(), headers=headers)
        return cast(Stamp, response.json())

    def _array(self, below: str, params: dict[str, str]) -> Heights:
        headers = {"accept": "application/x-npy"}
        response = self.client.request("GET", f"{self.path}{below}", params=params, headers=headers)
        heights = np.load(io.BytesIO(response.content), allow_pickle=False)
        return Heights(heights, int(response.headers["firn-tick"]), int(response.headers["firn-seq"]))

    def height(self, x: float, z: float) -> float:
        """The snow depth at a point [m]."""
        return float(self._call("GET", "/height", params={"x": x, "z": z})["height"])

    def column(self, column_x: int, column_z: int) -> Column:
        """A column, layer by layer from the ground up, with its weak layers."""
        return cast(Column, self._call("GET", f"/columns/{column_x}/{column_z}"))

    def snow_profile(self, column_x: int, column_z: int) -> str:
        """A column of alpine snow as a snow profile after CAAML 6.0.3, as XML."""
        path = f"{self.path}/columns/{column_x}/{column_z}"
        return self.client.request("GET", path, params={"format": "caaml"}).text

    def cells(self, fields: Iterable[str], **box: int | str) -> dict[str, NDArray[np.float64]]:
        """Fields of the fixed grid, each of shape (z, y, x), NaN outside the snow.

        A part of it by `column_x`, `column_z`, `cell_y`, `width`, `depth`, `height`. Layers are counted from the
        lowest ground, or with `reference="ground"` from each column's own.
        """
        reply = self._call("GET", "/cells", params={**box, "fields": ",".join(fields)})
        shape = (reply["depth"], reply["height"], reply["width"])
        return {name: np.array(values, np.float64).reshape(shape) for name, values in reply["fields"].items()}

    def mass(self) -> MassLedger:
        """The mass balance [kg]; `carried` lies on objects."""
        return cast(MassLedger, self._call("GET", "/mass"))

    def usage(self) -> Usage:
        """What it takes of the server: device time and memory."""
        return cast(Usage, self._call("GET", "/usage"))

    def probe(self, probes: Iterable[ProbeSpec]) -> list[Probe]:
        """How deep loads would sink, without putting them there."""
        return list(self._call("POST", "/probes", json={"probes": list(probes)})["probes"])

    def sample(
        self,
        points: ArrayLike,
        fields: Iterable[SampleField] = ("depth", "ground", "elevation", "normal"),
        load: Load | None = None,
    ) -> Samples:
        """The snow at up to 65536 points [m], shape (points, 2): x and z. `sink` is how deep the `load` would sink."""
        wanted = list(fields)
        body = {"points": np.asarray(points, np.float64).tolist(), "fields": wanted, "load": load}
        headers = {"accept": "application/x-npy"}
        response = self.client.request("POST", f"{self.path}/samples", json=body, headers=headers)
        table = np.load(io.BytesIO(response.content), allow_pickle=False)
        found: dict[SampleField, NDArray[np.float32]] = {}
        column = 0
        for field in wanted:
            width = 3 if field == "normal" else 1
            found[field] = table[:, column] if width == 1 else table[:, column : column + width]
            column += width
        return Samples(found, int(response.headers["firn-tick"]), int(response.headers["firn-seq"]))

    def render(self, **query: Unpack[RenderQuery]) -> bytes:
        """A picture as PNG; `GET …/render.png` has the options, such as `view="surface"`, `field="density"`."""
        return self.client.request("GET", f"{self.path}/render.png", params=dict(query)).content

    def profile(self, column_x: int, column_z: int) -> str:
        """Density and hardness of a column over its depth, drawn as SVG."""
        params = {"column_x": column_x, "column_z": column_z}
        return self.client.request("GET", f"{self.path}/profile.svg", params=params).text

    def stream(self, on_event: Callable[[Event], None] | None = None) -> Stream:
        """The height stream: `async with session.stream() as stream`."""
        url = f"ws{self.client.url.removeprefix('http')}{self.path}/stream"
        return Stream(url, token=self.client.token, on_event=on_event)
