"""What the server is sent and what it answers, as on the wire. SI units and °C."""

from __future__ import annotations

from typing import Any, Literal, NotRequired, TypedDict


class Stamp(TypedDict):
    """When something holds."""

    tick: int
    """Ticks since the session was created or reset."""
    seq: int
    """Number of the newest published change."""


class Grid(TypedDict):
    """Size of a session's grid."""

    width: int
    """Columns along x."""
    depth: int
    """Columns along z."""
    height: int
    """Slots for material cells in each column."""
    cell_size: float
    """Side of a fresh cell, and of a column [m]."""


class GridSpec(TypedDict, total=False):
    """A grid that is to be created; what is left out is 50, and 0.2 m."""

    width: int
    depth: int
    height: int
    cell_size: float


class MaterialSpec(TypedDict, total=False):
    """Material constants."""

    fresh_density: float
    """Density of fresh snow [kg/m³]."""
    max_density: float
    """Density at which snow compacts no further [kg/m³]."""
    stiffness_exponent: float
    hardness_law: Literal["calibrated", "regression", "gold"]
    grain_size_mm: float
    """Grain size [mm], read by the law `gold` only."""
    load_distribution: Literal["two_to_one", "uniform", "surface"]


class Settings(TypedDict):
    """What can be changed about a session at any time."""

    air_temperature: float
    """[°C], −40 to 0."""
    time_scale: float
    """Simulated seconds per second, 0 to 1000."""
    tick_rate: float
    """Ticks per second [Hz], 1 to 240."""
    paused: bool
    snowfall_rate: float
    """Continuous snowfall [m/h]."""
    idle_timeout_s: float | None
    """Idle time until it hibernates [s]."""
    delete_after_s: float | None
    """Idle time until it is deleted [s]."""


class SettingsPatch(TypedDict, total=False):
    """Other settings; those left out stay."""

    air_temperature: float
    time_scale: float
    tick_rate: float
    paused: bool
    snowfall_rate: float
    stiffness_exponent: float
    idle_timeout_s: float
    delete_after_s: float


class SnowLayer(TypedDict):
    """A layer of the snow that a session begins with."""

    depth: float
    """[m]."""
    temperature: NotRequired[float]
    """[°C]; the air's where there is none."""
    density: NotRequired[float]
    """[kg/m³]; that of fresh snow where there is none."""


class Terrain(TypedDict):
    """The ground: elevations [m], row by row, index = z · width + x."""

    heights: list[float]


class SessionSpec(TypedDict, total=False):
    """A session that is to be created."""

    id: str
    """Its name, `[A-Za-z0-9_-]{1,64}`; the server makes one where there is none."""
    grid: GridSpec
    material: MaterialSpec
    air_temperature: float
    time_scale: float
    tick_rate: float
    paused: bool
    snowfall_rate: float
    idle_timeout_s: float | None
    delete_after_s: float | None
    initial_snow: list[SnowLayer]
    """From the ground up."""
    terrain: Terrain | None


class Summary(TypedDict):
    """Totals of a session."""

    mean_height: float
    min_height: float
    max_height: float
    total_mass: float
    mean_density: float
    active_tiles: int
    tiles: int
    colliders: int


class SessionView(Settings, Stamp):
    """A session."""

    id: str
    grid: Grid
    material: dict[str, Any]
    terrain: Terrain | None
    state: Literal["running", "paused", "hibernating"]
    epoch: str
    """Opaque; (epoch, seq) names one state."""
    sim_time: float
    """Simulated time [s]."""
    settled: bool
    """Whether nothing moves."""
    summary: Summary
    device_memory_bytes: int
    """Device memory that its cells take [bytes]."""
    created_at: str
    stream_url: str


class Step(TypedDict, total=False):
    """How far to step: `ticks`, or `seconds`, or `until_settled` with `max_seconds`."""

    ticks: int
    seconds: float
    until_settled: Literal[True]
    max_seconds: float


class Region(TypedDict):
    """A rectangle in metres: the columns whose centres lie in it."""

    x: float
    z: float
    width: float
    depth: float


class ColumnRegion(TypedDict):
    """A rectangle of columns."""

    column_x: int
    column_z: int
    width: int
    depth: int


class SnowfallReply(Stamp):
    fallen_mass: float
    """Mass that fell, the refused part included [kg]."""
    refused_mass: float
    """Mass that found no room [kg]."""


class ClearingReply(Stamp):
    cleared_mass: float
    """Mass that was removed [kg]."""


class Box(TypedDict):
    type: Literal["box"]
    width: float
    depth: float


class Disk(TypedDict):
    type: Literal["disk"]
    radius: float


class Position(TypedDict):
    """Centre of an object [m]."""

    x: float
    z: float


class ColliderSpec(TypedDict):
    """An object that is to be put on the snow."""

    id: NotRequired[str]
    mass: float
    """[kg]."""
    shape: Box | Disk
    position: Position


class Collider(TypedDict):
    """An object on the snow, and how it stands there."""

    id: str
    mass: float
    shape: Box | Disk
    position: Position
    bottom: float
    """Elevation of its bottom [m]."""
    sink_depth: float
    """How far it has sunk where it stands [m]."""
    contact_area: float
    """[m²]."""
    pressure: float
    """On the area in contact [Pa]."""
    resting: bool
    """Whether it stayed as it was over the last cycle."""


class StampedCollider(Collider, Stamp):
    """A collider, and when it stood so."""


class ProbeSpec(TypedDict):
    """A load that might be put somewhere."""

    x: float
    z: float
    mass: float
    """[kg]."""
    area: float
    """Area it stands on [m²]."""


class Probe(TypedDict):
    """What becomes of a load."""

    sink_depth: float
    """How deep it sinks until the snow carries it [m]."""
    surface_hardness: float
    """[Pa]; 0 where there is no snow."""
    pressure: float
    """[Pa]."""
    carries: bool
    """Whether the surface carries it as it is."""


class Event(Stamp):
    """Something that happened in a session; the fields depend on `event`."""

    event: Literal["snowfall", "clearing", "settings", "settled", "reset"]
    fallen_mass: NotRequired[float]
    refused_mass: NotRequired[float]
    cleared_mass: NotRequired[float]
    settings: NotRequired[Settings]


class Welcome(Stamp):
    """The first message of a stream."""

    session: str
    epoch: str
    tile_size: int
    grid: Grid
    settings: Settings
