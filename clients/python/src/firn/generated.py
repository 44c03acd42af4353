# Made by `make client-types` from api/openapi.json and api/asyncapi.yaml: change those instead.

from __future__ import annotations

from typing import Literal, NotRequired, TypeAlias, TypedDict


class AckMessage(TypedDict):
    """A request was carried out. A change is then visible to every read."""

    op: Literal["ack"]
    id: Id
    tick: Tick
    seq: Seq
    fallen_mass: NotRequired[float]
    refused_mass: NotRequired[float]
    cleared_mass: NotRequired[float]
    celsius: NotRequired[float]
    collider: NotRequired[ColliderView]
    results: NotRequired[BatchResults]
    stamps: NotRequired[list[PrintView]]
    probes: NotRequired[list[ProbeView]]
    fields: NotRequired[SampleFields]


class AirTemperature(TypedDict):
    """Another air temperature."""

    celsius: float
    """Temperature [°C], from −40 to 0; in alpine snow from −60 to 50."""


class AirTemperatureMessage(TypedDict):
    """Another air temperature, as PUT …/air-temperature."""

    op: Literal["air_temperature"]
    id: Id
    celsius: float
    """Temperature [°C], from −40 to 0; in alpine snow from −60 to 50, and the weather becomes steady with it."""


class Alive(TypedDict):
    """Answer to `GET /livez`."""

    status: str
    """Always `alive`."""


class AlpineColumn(TypedDict):
    """What a column of alpine snow has beside its layers; other snow has none of it."""

    snow_water_equivalent: NotRequired[float]
    """Mass of ice and water on a square metre [kg/m²]."""

    liquid_water: NotRequired[float]
    """Mass of liquid water on it [kg/m²]."""

    skin_temperature: NotRequired[float]
    """Temperature of the surface of snow or ground [°C]."""

    albedo: NotRequired[float]
    """Part of the short wave that is sent back, as it is seen."""

    runoff: NotRequired[float]
    """Water that has run off since the session began [kg/m²]."""


Auth: TypeAlias = Literal["open", "required"]


BatchOutcome: TypeAlias = Literal["created", "replaced", "removed", "absent", "skipped"]


class BatchResult(TypedDict):
    """Result of one entry of a batch."""

    id: str | None
    """Name of the collider, if the entry has one."""

    result: BatchOutcome
    """What happened to it."""

    errors: NotRequired[list[FieldError]]
    """Why it was skipped: what is wrong, and where in the batch."""


class BatchResults(TypedDict):
    """Results of a batch, entry by entry."""

    put: list[BatchResult]
    """One for each entry of `put`, in their order."""

    delete: list[BatchResult]
    """One for each entry of `delete`, in their order."""


class CellOrigin(TypedDict):
    """A cell of the fixed grid."""

    column_x: int
    """Along x."""

    column_z: int
    """Along z."""

    cell_y: int
    """Along y, from what `reference` says up."""


class ChangingWeather(TypedDict):
    """Weather that changes with simulated time. Before its first row and after its last these hold."""

    op: Literal["weather"]
    id: Id
    series: list[WeatherRow]
    """The rows, in ascending order of their times."""

    interpolate: NotRequired[bool]
    """Whether the weather changes evenly from row to row; else a row holds until the next."""


class CheckpointList(TypedDict):
    """The restore points of a session."""

    items: list[CheckpointView]
    """All of them, in ascending order of their names."""


class CheckpointView(TypedDict):
    """A restore point: a state of a session that is kept under a name."""

    name: str
    """Its name."""

    tick: int
    """Tick of the state."""

    sim_time: float
    """Simulated time of the state [s]."""

    created_at: str
    """When it was kept, RFC 3339."""

    bytes: int
    """Length of its snapshot [bytes]."""


class Clearing(TypedDict):
    """
    A plough: leaves at most a depth of snow standing.

    It clears either a `region`, or a `path` of a `width`, or everything.
    """

    depth: float
    """Depth left standing [m]."""

    region: NotRequired[Region | None]
    path: NotRequired[list[list[float]] | None]
    """
    The way of a plough: points [x, z] [m]. The columns whose centres lie within half the width of it are
    cleared.
    """

    width: NotRequired[float | None]
    """Width of the path [m]."""


class ClearingEvent(TypedDict):
    op: Literal["event"]
    event: Literal["clearing"]
    tick: Tick
    seq: Seq
    cleared_mass: float
    """Mass that was removed [kg]."""


class ClearingMessage(TypedDict):
    """Leaves at most a depth of snow standing, as POST …/clearings."""

    op: Literal["clearing"]
    id: Id
    depth: float
    """Depth left standing [m]."""

    region: NotRequired[Region | None]
    """A rectangle that is cleared. Without a region and a path the whole grid is."""

    path: NotRequired[list[PathItem] | None]
    """The way of a plough, as points [x, z] [m], instead of a region."""

    width: NotRequired[float | None]
    """Width of the path [m]."""


class ColliderBatch(TypedDict):
    """Colliders put and removed in one frame."""

    put: NotRequired[list[ColliderSpec]]
    """Colliders to create or replace; each needs an `id`."""

    delete: NotRequired[list[str]]
    """Ids of colliders to remove. One that is not there is no error."""

    on_error: NotRequired[OnError]
    """What happens if one of them is invalid."""


class ColliderDeleteMessage(TypedDict):
    """Removes a collider, as DELETE …/colliders/{cid}."""

    op: Literal["collider.delete"]
    id: Id
    collider: str
    """The collider's id."""


class ColliderPatch(TypedDict):
    """Body of `PATCH …/colliders/{cid}`: the parts that change; others stay."""

    mass: NotRequired[float | None]
    """Mass [kg]."""

    shape: NotRequired[Shape | None]
    footprints: NotRequired[list[PartSpec] | None]
    """New outlines; they replace a single shape too."""

    position: NotRequired[Position | None]
    heading: NotRequired[float | None]
    """Compass bearing of its front [°]."""

    airborne: NotRequired[bool | None]
    """Whether it is held up."""

    shelters: NotRequired[bool | None]
    """Whether snow that falls on its columns lies on it."""

    velocity: NotRequired[Position | None]
    turn_rate: NotRequired[float | None]
    """How fast it turns [°/s], clockwise from above."""

    path: NotRequired[list[list[float]] | None]
    """
    Points [x, z] [m] that it passes, in order, from where it is; then it stops, or goes on with the velocity in
    the same patch. It comes with `over`.
    """

    over: NotRequired[float | None]
    """Simulated time that it takes for the path [s], at 100 m/s at the most."""

    sweep: NotRequired[bool]
    """
    Whether it is swept to the new position, and turned to the new heading, in the next cycle, rather than lifted
    there: it leaves a track without gaps. A way of more than 32 columns takes several cycles.
    """


class ColliderPatchMessage(TypedDict):
    """Changes parts of a collider, or sweeps it to another place, as PATCH …/colliders/{cid}; what is left out stays."""

    op: Literal["collider.patch"]
    id: Id
    collider: str
    """The collider's id."""

    patch: ColliderPatch


class ColliderPutMessage(TypedDict):
    """Creates, replaces or moves a collider, as PUT …/colliders/{cid}."""

    op: Literal["collider.put"]
    id: Id
    collider: ColliderSpec


class ColliderSpec(TypedDict):
    """
    An object that stands on the snow.

    It has either a `shape` or `footprints`. One of its columns must be in the grid; the part beyond the edge is
    fully supported.
    """

    id: NotRequired[str | None]
    """Name, `[A-Za-z0-9_-]{1,64}`; the server makes a ULID where there is none."""

    mass: float
    """Mass [kg]."""

    shape: NotRequired[Shape | None]
    footprints: NotRequired[list[PartSpec] | None]
    """
    Its outlines, if it has several: the feet of a walker, the wheels of a car. It is one rigid body, and each
    outline carries a part of its weight according to its contact.
    """

    position: Position
    """Where its centre is [m]."""

    heading: NotRequired[float]
    """Compass bearing of its front [°]: 0 along +z (north), 90 along +x (east)."""

    airborne: NotRequired[bool]
    """Whether it is held up and does not press the snow."""

    shelters: NotRequired[bool]
    """Whether snow that falls on its columns lies on it, as its burden, rather than falls through it."""

    velocity: NotRequired[Position]
    """
    Velocity along x and z [m/s], 100 m/s at the most. The object moves until another velocity is set or it
    reaches the edge of the grid.
    """

    turn_rate: NotRequired[float]
    """How fast it turns [°/s], clockwise from above."""

    path: NotRequired[list[list[float]] | None]
    """
    Points [x, z] [m] that it passes, in order, from its position on; then it goes on with its velocity. It comes
    with `over`.
    """

    over: NotRequired[float | None]
    """Simulated time that it takes for the path [s], at 100 m/s at the most."""


class CollidersBatchMessage(TypedDict):
    """Puts and removes up to 4096 colliders in one frame, as POST …/colliders:batch."""

    op: Literal["colliders.batch"]
    id: Id
    put: NotRequired[list[ColliderSpec]]
    """Colliders to create or replace; each needs an id."""

    delete: NotRequired[list[str]]
    """Ids of colliders to remove. One that is not there is no error."""

    on_error: NotRequired[OnError]


class ColumnRegion(TypedDict):
    """
    A rectangle of columns. Widened to whole tiles and clipped to the grid, which it has to
    meet.
    """

    column_x: int
    column_z: int
    width: int
    depth: int


class CompactReply(TypedDict):
    """What giving back unused pages has done."""

    bytes_before: int
    """Length of the file before [bytes]."""

    bytes_after: int
    """Length of the file after [bytes]."""


ContentName: TypeAlias = Literal["air", "snow", "ground"]


class CreateSessionQuery(TypedDict):
    """Create a session"""

    id: NotRequired[str]
    """Name of a session that is restored from a snapshot."""


class DepthWatch(TypedDict):
    """
    A mean snow depth whose crossing is told by a `watch` event. It holds while the mean depth of the
    region's columns is above `above`, or below `below`; one of the two is given. At the depth itself
    it does not hold.
    """

    id: str
    """Its name. No other watch of the subscription has it."""

    region: NotRequired[ColumnRegion | None]
    """Columns, not widened to tiles; the whole grid where there is none."""

    above: NotRequired[float | None]
    """Depth [m], at most the height of the grid."""

    below: NotRequired[float | None]
    """Depth [m], at most the height of the grid."""


DepthWatches: TypeAlias = list[DepthWatch]
"""Depths whose crossing is told."""


class ErrorMessage(TypedDict):
    """A request was refused; nothing has changed."""

    op: Literal["error"]
    id: int | None
    """The request's id; null where it could not be read."""

    problem: Problem


EventKind: TypeAlias = Literal["snowfall", "clearing", "settings", "weather", "terrain", "settled", "step_progress", "reset"]


EventsWanted: TypeAlias = bool | list[EventKind]
"""
Which events are wanted: all, none, or some kinds. Where it is not said: all under
`firn.v1.json`, none under `firn.v1.bin`.
"""


class FieldError(TypedDict):
    """A part of a request that can't be accepted."""

    pointer: str
    """JSON pointer to the field in the body, or the name of a path or query parameter."""

    detail: str
    """What was expected and what was found."""


class GetCellsQuery(TypedDict):
    """Read the fixed grid"""

    column_x: NotRequired[int]
    """First column along x."""

    column_z: NotRequired[int]
    """First column along z."""

    reference: NotRequired[Literal["lowest", "ground"]]
    """What cells along y are counted from: the lowest ground of the session, or the ground of each column."""

    cell_y: NotRequired[int]
    """First cell along y; 0 stands on what is counted from."""

    width: NotRequired[int]
    """Cells along x; up to the grid's edge where there is none."""

    depth: NotRequired[int]
    """Cells along z; up to the grid's edge where there is none."""

    height: NotRequired[int]
    """Cells along y; up to the grid's height, on the highest ground, where there is none."""

    fields: NotRequired[str]
    """Names of fields, separated by commas."""


class GetColumnQuery(TypedDict):
    """Read a column"""

    format: NotRequired[Literal["json", "caaml"]]
    """As what it is told: JSON, or a snow profile after CAAML 6.0.3, which alpine snow only has."""


class GetHeightQuery(TypedDict):
    """Read the snow depth at a point"""

    x: float
    """Along x [m], from 0 to the grid's edge."""

    z: float
    """Along z [m], from 0 to the grid's edge."""


class GetHeightsQuery(TypedDict):
    """Read snow depths"""

    column_x: NotRequired[int]
    """First column along x."""

    column_z: NotRequired[int]
    """First column along z."""

    width: NotRequired[int]
    """Samples along x; up to the grid's edge where there is none."""

    depth: NotRequired[int]
    """Samples along z; up to the grid's edge where there is none."""

    stride: NotRequired[int]
    """Columns from one sample to the next: 1, 2, 4 or 8."""

    surface: NotRequired[bool]
    """Adds the elevation of the ground; of depths only."""

    quantity: NotRequired[Literal["depth", "snow_water_equivalent", "liquid_water", "skin_temperature"]]
    """What of the columns is told; what is not a depth, of alpine snow only."""


class GetProfileQuery(TypedDict):
    """Draw a column"""

    column_x: int
    """Column along x, from 0."""

    column_z: int
    """Column along z, from 0."""


class GetRenderQuery(TypedDict):
    """Draw the snow"""

    view: NotRequired[Literal["grid", "surface", "section"]]
    """What is shown: the fixed grid as boxes, the surface of the snow, or a vertical cut."""

    field: NotRequired[Literal["density", "temperature", "overpressure", "hardness", "position"]]
    """What the colours show."""

    width: NotRequired[int]
    """Pixels across; 2²³ pixels in all."""

    height: NotRequired[int]
    """Pixels down."""

    yaw: NotRequired[float]
    """
    Degrees around the vertical from which grid and surface are seen: 0 looks along −z with x to
    the right, 90 along −x.
    """

    pitch: NotRequired[float]
    """Degrees from above: 0 looks level, 90 straight down."""

    zoom: NotRequired[float]
    """How much larger than fitted into the picture; not for sections."""

    projection: NotRequired[Literal["perspective", "parallel"]]
    """`parallel` shows what is far away as large as what is near; sections always do."""

    along: NotRequired[Literal["x", "z"]]
    """The axis that a section runs along."""

    at: NotRequired[int]
    """The column across `along` that a section shows; the middle one where there is none."""

    column_x: NotRequired[int]
    """First column along x that is shown."""

    column_z: NotRequired[int]
    """First column along z that is shown."""

    columns_x: NotRequired[int]
    """Columns along x; up to the grid's edge where there is none."""

    columns_z: NotRequired[int]
    """Columns along z; up to the grid's edge where there is none."""

    min: NotRequired[float]
    """
    Value of the first colour; the least value shown where there is none. Overpressure is
    symmetric around 0 unless both are given.
    """

    max: NotRequired[float]
    """Value of the last colour; the greatest value shown where there is none."""

    shading: NotRequired[bool]
    """Whether sides are shaded and boxes have outlines."""

    legend: NotRequired[bool]
    """Whether a legend stands beside it; there is none in pictures below 160 × 120."""

    colliders: NotRequired[bool]
    """Whether objects are shown."""

    background: NotRequired[Literal["light", "dark", "transparent"]]
    """What is around the snow."""


class GetTerrainQuery(TypedDict):
    """Read the ground"""

    column_x: NotRequired[int]
    """First column along x."""

    column_z: NotRequired[int]
    """First column along z."""

    width: NotRequired[int]
    """Samples along x; up to the grid's edge where there is none."""

    depth: NotRequired[int]
    """Samples along z; up to the grid's edge where there is none."""

    stride: NotRequired[int]
    """Columns from one sample to the next: 1, 2, 4 or 8."""


class Grid(TypedDict):
    """Size of a snowpack: columns along x and z, slots along y."""

    width: int
    """Columns along x."""

    depth: int
    """Columns along z."""

    height: int
    """Slots for material cells in each column."""

    cell_size: float
    """Side h of a fresh cell [m]."""


class GridSpec(TypedDict):
    """Size of a snowpack: columns along x and z, slots along y."""

    width: NotRequired[int]
    """Columns along x."""

    depth: NotRequired[int]
    """Columns along z."""

    height: NotRequired[int]
    """Slots for material cells in each column."""

    cell_size: NotRequired[float]
    """Side h of a fresh cell [m]."""


class GroundTile(TypedDict):
    """The ground of a tile."""

    column_x: int
    """First column along x."""

    column_z: int
    """First column along z."""

    width: int
    """Samples along x."""

    depth: int
    """Samples along z."""

    heights: list[float]
    """Elevations [m], of the same columns as the heights of a tile of snow."""


HandHardness: TypeAlias = Literal["F", "4F", "1F", "P", "K", "I"]


HardnessLaw: TypeAlias = Literal["calibrated", "regression", "gold", "alpine"]


class Heights(TypedDict):
    op: Literal["snapshot", "delta"]
    id: Id
    seq: Seq
    tick: Tick
    recovered: NotRequired[bool]
    """
    Whether the client was given exactly what it had missed; in the first answer to a
    subscribe that asked to resume.
    """

    tiles: list[Tile]
    level: NotRequired[Literal[True]]
    """
    All ground is level at 0, but what the message tells under `terrain`. Only where the
    subscription wants the ground.
    """

    terrain: NotRequired[list[GroundTile]]
    """
    The ground where the client has not been told it, or was told another. Only where the
    subscription wants it.
    """

    colliders: NotRequired[list[ColliderView]]
    """
    Every collider whose bounding box meets the region, in ascending order of ids; it
    replaces what the client was told before. Only where the subscription wants colliders,
    at its begin, at each update, and when any of them has changed.
    """

    more: NotRequired[Literal[True]]
    """Further parts of this message follow."""


HeightsAbove: TypeAlias = Literal["snow", "ground"]


Id: TypeAlias = int


class LayerView(TypedDict):
    """One material cell."""

    bottom: float
    """Height of its lower face above the ground [m]."""

    thickness: float
    """Thickness [m]."""

    density: float
    """Density [kg/m³]."""

    temperature: float
    """Temperature [°C]."""

    hardness: float
    """Hardness [Pa]."""

    stress: float
    """Vertical stress on it, its own weight included [Pa]."""

    mass: float
    """Mass [kg]."""

    liquid_water: NotRequired[float]
    """Liquid water in it [kg/m²], where the snow is alpine."""

    hand_hardness: NotRequired[HandHardness]
    """Hardness by hand, where the snow is alpine."""


class ListCollidersQuery(TypedDict):
    """List colliders"""

    limit: NotRequired[int]
    """Most items to return."""

    cursor: NotRequired[str]
    """`next_cursor` of the page before; the first page where there is none."""


class ListSessionsQuery(TypedDict):
    """List sessions"""

    limit: NotRequired[int]
    """Most items to return."""

    cursor: NotRequired[str]
    """`next_cursor` of the page before; the first page where there is none."""


class Load(TypedDict):
    """A load that is tried somewhere."""

    mass: float
    """Mass [kg]."""

    area: float
    """Area it stands on [m²]."""

    duration: NotRequired[float | None]
    """Simulated time that it stands there [s]; until the snow has come to rest where there is none."""


LoadDistribution: TypeAlias = Literal["two_to_one", "uniform", "surface"]


class Material(TypedDict):
    """Material constants of one snowpack."""

    fresh_density: float
    """Density of fresh snow [kg/m³], up to `max_density`."""

    max_density: float
    """Density at which snow compacts no further [kg/m³]."""

    stiffness_exponent: float
    """Exponent n of the stiffness law k = ρⁿ."""

    hardness_law: HardnessLaw
    """The hardness law."""

    grain_size_mm: float
    """Grain size δ [mm], read by the law `gold` only."""

    load_distribution: LoadDistribution
    """How loads spread with depth."""


class MaterialSpec(TypedDict):
    """Material constants of a snowpack to be made; those of its preset where there are none."""

    fresh_density: NotRequired[float]
    """Density of fresh snow [kg/m³], up to `max_density`."""

    max_density: NotRequired[float]
    """Density at which snow compacts no further [kg/m³]."""

    stiffness_exponent: NotRequired[float]
    """Exponent n of the stiffness law k = ρⁿ."""

    hardness_law: NotRequired[HardnessLaw]
    """The hardness law."""

    grain_size_mm: NotRequired[float]
    """Grain size δ [mm], read by the law `gold` only."""

    load_distribution: NotRequired[LoadDistribution]
    """How loads spread with depth."""


class MemoryBytes(TypedDict):
    """Memory that a session takes [bytes]."""

    device: int
    """On the device: its cells. None while it hibernates."""

    host: int
    """
    What reads are served from, and what the engine knows of it beside its cells: heights, ground
    and objects.
    """

    journal: int
    """
    What brings it back: its newest checkpoint and the changes since, the snapshot that it was made
    from, and the answers to requests with an `Idempotency-Key`.
    """

    streams: int
    """Tiles encoded for its streams, and the buffers of those that are open."""


class Motion(TypedDict):
    """How an object moves: along its path while it has one, then with its velocity."""

    velocity: Position
    """Velocity along x and z [m/s]; absent where it is 0."""

    turn_rate: float
    """How fast it turns [°/s], clockwise from above; absent where it is 0."""

    path: list[list[float]]
    """Points [x, z] [m] that it still has to pass, in order, the next 16 at the most; absent where there are none."""

    speed: float
    """Its speed along the path [m/s]; absent where it is swept to the end in the next cycle."""

    turn_to: float
    """Heading that it has at the end of the path [°], where it is swept to another."""


class Body(Motion):
    """A rigid, level object that stands on the snow."""

    mass: float
    """Mass [kg]."""

    shape: NotRequired[Shape | None]
    footprints: NotRequired[list[Part]]
    """The outlines on which it stands, where it is not one `shape`."""

    position: Position
    """Where its centre is [m]."""

    heading: float
    """Compass bearing of its front [°]: 0 along +z (north), 90 along +x (east)."""

    airborne: bool
    """Whether it is held up and does not press the snow."""

    shelters: bool
    """
    Whether snow that falls on its columns lies on it, not under it.

    Objects that were stored before there was a choice let it fall through.
    """


class ColliderView(Body):
    """An object on the snow and how it stands there."""

    id: str
    """Its name."""

    bottom: float
    """Elevation of its bottom [m]."""

    sink_depth: float
    """
    How far its bottom is below the highest of its columns at the time it was placed or last
    moved [m].
    """

    contact_area: float
    """Area in contact [m²]; 0 while it is held up, as is its pressure."""

    pressure: float
    """Pressure on the area in contact [Pa]."""

    burden: float
    """Mass of the snow that lies on it [kg]. It adds to its weight."""

    resting: bool
    """Whether its bottom and contact stayed as they were over the last cycle."""


OnError: TypeAlias = Literal["refuse", "skip"]


class Origin(TypedDict):
    """A column."""

    column_x: int
    """Along x."""

    column_z: int
    """Along z."""


class PageColliderView(TypedDict):
    """A page of a list."""

    items: list[ColliderView]
    """The items, in ascending order of their ids."""

    next_cursor: str | None
    """Cursor of the next page; `null` after the last."""


class PageSessionView(TypedDict):
    """A page of a list."""

    items: list[SessionView]
    """The items, in ascending order of their ids."""

    next_cursor: str | None
    """Cursor of the next page; `null` after the last."""


class Part(TypedDict):
    """One of several outlines on which an object stands: a foot, or a wheel."""

    shape: Shape
    """Its outline from above."""

    offset: Position
    """Where its centre is, seen from the object's [m]: x to the object's right, z forward."""

    heading: float
    """How far it is turned against the object [°], clockwise from above."""


class PartSpec(TypedDict):
    """One of several outlines on which an object stands: a foot, or a wheel."""

    shape: Shape
    """Its outline from above."""

    offset: Position
    """Where its centre is, seen from the object's [m]: x to the object's right, z forward."""

    heading: NotRequired[float]
    """How far it is turned against the object [°], clockwise from above."""


PathItem: TypeAlias = list[float]


Physics: TypeAlias = Literal["thesis", "alpine"]


class PingMessage(TypedDict):
    """Asks for a pong."""

    op: Literal["ping"]
    id: NotRequired[Id]


class PlainEvent(TypedDict):
    """Nothing moves any more, or the session was reset, to its first state or another."""

    op: Literal["event"]
    event: Literal["settled", "reset"]
    tick: Tick
    seq: Seq


class PongMessage(TypedDict):
    """The answer to a ping."""

    op: Literal["pong"]
    id: NotRequired[Id]


class Position(TypedDict):
    """A horizontal position [m]."""

    x: float
    """Along x [m]."""

    z: float
    """Along z [m]."""


Preset: TypeAlias = Literal["thesis", "powder", "packed", "wet", "game"]
"""
A kind of snow: a material, how it gives way under objects, and the air that it fell from. `docs/model.md` has
all values and their sources.
"""


Pressing: TypeAlias = Literal["creep"] | float


class PrintView(TypedDict):
    """A print in the snow."""

    depth: float
    """How deep the deepest of its columns was pressed [m]."""

    bottom: float
    """Elevation of the lowest surface in it afterwards [m]."""


class Probe(TypedDict):
    """A load on level snow."""

    x: float
    """Where it stands along x [m], inside the grid."""

    z: float
    """Where it stands along z [m], inside the grid."""

    mass: float
    """Mass [kg]."""

    area: float
    """Area it stands on [m²]."""

    duration: NotRequired[float | None]
    """Simulated time that it stands there [s]; until the snow has come to rest where there is none."""


class ProbeBatch(TypedDict):
    """Loads to try on the snow."""

    probes: list[Probe]
    """The loads; each is evaluated as if it were the only one."""


class ProbeView(TypedDict):
    """What becomes of a load."""

    sink_depth: float
    """
    Present height of the column less its height under the load, after its duration or once it has
    come to rest, other objects left out [m]. What the snow still settles by itself is counted.
    """

    surface_hardness: float
    """Hardness of the snow at the surface [Pa]; 0 where there is none."""

    pressure: float
    """Pressure of the load, mass · g / area [Pa]."""

    carries: bool
    """Whether the pressure is not above the surface's hardness; never where there is no snow."""


class ProbesMessage(TypedDict):
    """Says how deep loads would sink, as POST …/probes."""

    op: Literal["probes"]
    id: Id
    probes: list[Probe]


class Problem(TypedDict):
    """Why a request was not carried out: problem details after RFC 9457, the same over HTTP and the stream."""

    type: str
    """Stable name of this kind of problem: `urn:firn:problem:…`."""

    title: str
    """What kind of problem it is, in words."""

    status: int
    """HTTP status."""

    detail: str
    """What was wrong with this request."""

    errors: list[FieldError]
    """Each part of the request that was wrong, the first hundred of them; may be empty."""


class Progress(TypedDict):
    """How far a step has come."""

    done: int
    """Ticks it has taken."""

    of: int
    """Ticks it takes at the most."""


class PutTerrainQuery(TypedDict):
    """Put other ground under the snow"""

    scale: NotRequired[float]
    """Metres from one grey to the next, not 0; an image needs it, nothing else may have it."""

    offset: NotRequired[float]
    """Metres at grey 0 (an image only)."""


Quantity: TypeAlias = Literal["depth", "snow_water_equivalent", "liquid_water", "skin_temperature"]


class Readiness(TypedDict):
    """Answer to `GET /readyz`."""

    status: ReadyStatus
    """Whether requests are served."""

    adapter: str
    """Name of the adapter that the snowpacks live on, or `cpu`."""

    backend: str
    """Graphics interface, or `cpu`."""

    auth: Auth
    """Whether clients are asked for tokens."""

    store: StoreStatus
    """How what sessions are kept in is doing."""

    sessions: int
    """Sessions there are."""

    capacity: int
    """Most sessions there may be."""

    schedulable: bool
    """
    Whether a session should be created here: there is room for one, and frames keep up with
    the clock.
    """


ReadyStatus: TypeAlias = Literal["ready", "recovering", "draining", "read_only", "failed"]


class Region(TypedDict):
    """
    A rectangle in metres: the columns whose centres lie in it, lower edges included, upper ones
    not.
    """

    x: float
    """Lower edge along x [m]."""

    z: float
    """Lower edge along z [m]."""

    width: float
    """Extent along x [m]."""

    depth: float
    """Extent along z [m]."""


class ResetSpec(TypedDict):
    """Body of `POST …/reset`."""

    checkpoint: NotRequired[str | None]
    """Name of the restore point to go back to; `null` for the state that the session was created in."""


class Resume(TypedDict):
    """
    The state that the client holds, that of the ground too where `terrain` is wanted: the epoch of the
    `welcome` under which it was told, and the seq of the last whole message.
    """

    epoch: str
    seq: int


class SampleBatch(TypedDict):
    """Points at which the snow is read."""

    points: list[list[float]]
    """The points, each [x, z] in metres, inside the grid."""

    fields: NotRequired[list[SampleField]]
    """What to read at each, nothing twice."""

    load: NotRequired[Load | None]


SampleField: TypeAlias = Literal["depth", "ground", "elevation", "normal", "density", "hardness", "sink"]


class SampleFields(TypedDict):
    """Fields of points: each one that was asked for has a value for each point, in their order; the others are `null`."""

    depth: list[float] | None
    """Snow depth [m], bilinear between the centres of columns."""

    ground: list[float] | None
    """Elevation of the ground [m], bilinear between the centres of columns."""

    elevation: list[float] | None
    """Elevation of the snow's surface [m]: ground and depth."""

    normal: list[list[float]] | None
    """Unit vectors (x, y, z) that stand on the surface; y is up."""

    density: list[float | None] | None
    """
    Density [kg/m³] of the topmost cell of the column that the point is on; `null` where there is no
    snow.
    """

    hardness: list[float | None] | None
    """Hardness [Pa] of that cell; `null` where there is no snow."""

    sink: list[float] | None
    """Depth [m] that the load would sink there, as a probe tells."""


class SamplesMessage(TypedDict):
    """Reads the snow at points, as POST …/samples. Its answer is one message, so it has at most 1 MiB."""

    op: Literal["samples"]
    id: Id
    points: list[list[float]]
    """Points, each [x, z] in metres, inside the grid."""

    fields: NotRequired[list[SampleField]]
    """What is wanted of each; the four of the surface where nothing is said."""

    load: NotRequired[Load | None]
    """The load whose `sink` is wanted."""


Seq: TypeAlias = int
"""
Number of the newest published change. It only grows, by how much depends on what else the server does; it may exceed
32 bits.
"""


class SessionSpec(TypedDict):
    """Body of `POST /v1/sessions`; every field is optional."""

    preset: NotRequired[Preset]
    """Kind of snow: fills what `material`, `air_temperature` and `pressing` leave out."""

    id: NotRequired[str | None]
    """Name of the session, `[A-Za-z0-9_-]{1,64}`; the server makes a ULID where there is none."""

    physics: NotRequired[Physics]
    """Which physics the snow follows, for as long as the session lives."""

    grid: NotRequired[GridSpec]
    """Size of the grid."""

    material: NotRequired[MaterialSpec]
    """Material constants."""

    air_temperature: NotRequired[float]
    """
    Temperature of the air [°C], and of fresh snow; the preset's where there is none. From −40 to 0; with the
    physics `alpine` from −60 to 50, and where `weather` is given that of the weather.
    """

    time_scale: NotRequired[float]
    """Simulated seconds per second: up to 1000, with the physics `alpine` up to 100 000."""

    tick_rate: NotRequired[float]
    """Ticks per second [Hz]."""

    paused: NotRequired[bool]
    """Whether time stands still."""

    snowfall_rate: NotRequired[float]
    """Continuous snowfall [m/h]."""

    pressing: NotRequired[Pressing]
    """How snow gives way under objects; by default the preset's way."""

    idle_timeout_s: NotRequired[float | None]
    """Seconds without request or stream after which the session hibernates."""

    delete_after_s: NotRequired[float | None]
    """Seconds without request or stream after which the session is deleted."""

    initial_snow: NotRequired[list[SnowLayer]]
    """Layers of snow to begin with, from the ground up."""

    terrain: NotRequired[Terrain | None]
    weather_step: NotRequired[float]
    """Length of a weather step [s]; with the physics `alpine` only."""

    site: NotRequired[SiteSpec]
    """Where and when the snowpack is, and how its weather is measured; with the physics `alpine` only."""

    weather: NotRequired[WeatherInputSpec]
    """
    The weather; with the physics `alpine` only. Where there is none it is steady: the air's temperature, 80 % of
    humidity, wind of 2 m/s, and no short wave where the site does not tell where the sun stands.
    """


class SetMessage(TypedDict):
    """Other settings, as PATCH of the session; those left out stay."""

    op: Literal["set"]
    id: Id
    air_temperature: NotRequired[float | None]
    time_scale: NotRequired[float | None]
    """Up to 1000, in alpine snow up to 100 000."""

    paused: NotRequired[bool | None]
    tick_rate: NotRequired[float | None]
    snowfall_rate: NotRequired[float | None]
    stiffness_exponent: NotRequired[float | None]
    pressing: NotRequired[Pressing | None]
    idle_timeout_s: NotRequired[float | None]
    delete_after_s: NotRequired[float | None]


class Settings(TypedDict):
    """The settings of a session that can change while it lives."""

    air_temperature: float
    """Temperature of the air [°C]."""

    time_scale: float
    """Simulated seconds per second."""

    tick_rate: float
    """Ticks per second [Hz]."""

    paused: bool
    """Whether time stands still."""

    snowfall_rate: float
    """Continuous snowfall [m/h]."""

    pressing: Pressing
    """How snow gives way under objects."""

    idle_timeout_s: float | None
    """Seconds without request or stream after which the session hibernates."""

    delete_after_s: float | None
    """Seconds without request or stream after which the session is deleted."""


class SessionView(Settings):
    """A session: its configuration, clock and summary."""

    id: str
    """Its name."""

    tenant: str | None
    """The tenant it belongs to; `null` where that is the operator."""

    physics: NotRequired[Physics]
    """Which physics the snow follows; that of the thesis where nothing is said."""

    weather_step: NotRequired[float]
    """Length of a weather step [s], where the snow is alpine."""

    site: NotRequired[Site]
    """Where and when the snowpack is, where the snow is alpine."""

    grid: Grid
    """Size of the grid."""

    material: Material
    """Material constants."""

    terrain: bool
    """Whether it has a terrain (`GET …/terrain`); without one the ground is level at 0."""

    state: State
    """What it is doing."""

    progress: Progress | None
    locked: bool
    """
    Whether it takes no changes: it came back from a damaged store, and an administrator has to say
    that it is as it should be.
    """

    tick: int
    """Ticks since it was created or reset."""

    seq: int
    """Number of its newest published change. It only grows, and may exceed 32 bits."""

    epoch: str
    """Opaque; (epoch, seq) names one state."""

    sim_time: float
    """Simulated time [s]."""

    settled: bool
    """Whether no snow falls and the last executed cycle changed no cell."""

    summary: Summary
    """Totals."""

    device_memory_bytes: int
    """Device memory that its cells take [bytes]."""

    created_at: str
    """When it was created, RFC 3339."""

    stream_url: str
    """Path of its height stream."""


class CreatedSession(SessionView):
    """Answer to `POST /v1/sessions`."""

    token: str
    """Allows everything about this session."""

    viewer_token: str
    """Allows its reads and streams."""


class SettingsEvent(TypedDict):
    op: Literal["event"]
    event: Literal["settings"]
    tick: Tick
    seq: Seq
    settings: Settings


class SettingsPatch(TypedDict):
    """Body of `PATCH /v1/sessions/{id}`: the settings that change; others stay."""

    air_temperature: NotRequired[float | None]
    """Temperature of the air [°C], from −40 to 0; in alpine snow from −60 to 50, and the weather becomes steady with it."""

    time_scale: NotRequired[float | None]
    """Simulated seconds per second: up to 1000, in alpine snow up to 100 000."""

    paused: NotRequired[bool | None]
    """Whether time stands still."""

    tick_rate: NotRequired[float | None]
    """Ticks per second [Hz]."""

    snowfall_rate: NotRequired[float | None]
    """Continuous snowfall [m/h]."""

    stiffness_exponent: NotRequired[float | None]
    """Exponent n of the stiffness law."""

    pressing: NotRequired[Pressing | None]
    idle_timeout_s: NotRequired[float | None]
    """Seconds without request or stream after which the session hibernates, `null` for never."""

    delete_after_s: NotRequired[float | None]
    """Seconds without request or stream after which the session is deleted; `null` for never."""


class ShapeBox(TypedDict):
    """A rectangle."""

    width: float
    """Extent from left to right [m]."""

    depth: float
    """Extent from back to front [m]."""

    type: Literal["box"]


class ShapeCapsule(TypedDict):
    """A rectangle with half circles at its back and its front."""

    length: float
    """Extent from back to front [m], the half circles included: at least twice the radius."""

    radius: float
    """Radius of the half circles, half its extent from left to right [m]."""

    type: Literal["capsule"]


class ShapeDisk(TypedDict):
    """A circle."""

    radius: float
    """Radius [m]."""

    type: Literal["disk"]


class ShapePolygon(TypedDict):
    """A convex polygon."""

    corners: list[list[float]]
    """Its corners [x, z] [m] in order, either way round."""

    type: Literal["polygon"]


class ShapeWheel(TypedDict):
    """
    A wheel that rolls forward: a cylinder on its side. It touches the snow with its lowest line, and with
    more of its rim the deeper it sinks.
    """

    width: float
    """Extent from left to right [m]."""

    radius: float
    """Radius [m]."""

    type: Literal["wheel"]


Shape: TypeAlias = ShapeBox | ShapeDisk | ShapeCapsule | ShapePolygon | ShapeWheel


class Site(TypedDict):
    """Where and when a snowpack is, and how its weather is measured."""

    latitude: NotRequired[float | None]
    """Latitude [°], north positive."""

    longitude: NotRequired[float | None]
    """Longitude [°], east positive."""

    start: NotRequired[Start | None]
    pressure: NotRequired[float]
    """Air pressure [hPa] while the weather tells none."""

    temperature_height: float
    """Height at which the air's temperature and humidity are measured [m]."""

    wind_height: float
    """Height at which the wind is measured [m]."""

    heights_above: HeightsAbove
    """What those heights are counted from."""

    soil: list[float]
    """Temperatures of the soil at the beginning [°C], in layers of 0.1, 0.2, 0.4 and 0.8 m from the top."""


class SiteSpec(TypedDict):
    """Where and when a snowpack is, and how its weather is measured."""

    latitude: NotRequired[float | None]
    """Latitude [°], north positive."""

    longitude: NotRequired[float | None]
    """Longitude [°], east positive."""

    start: NotRequired[Start | None]
    pressure: NotRequired[float]
    """Air pressure [hPa] while the weather tells none."""

    temperature_height: NotRequired[float]
    """Height at which the air's temperature and humidity are measured [m]."""

    wind_height: NotRequired[float]
    """Height at which the wind is measured [m]."""

    heights_above: NotRequired[HeightsAbove]
    """What those heights are counted from."""

    soil: NotRequired[list[float]]
    """Temperatures of the soil at the beginning [°C], in layers of 0.1, 0.2, 0.4 and 0.8 m from the top."""


class SnowLayer(TypedDict):
    """One layer of the snow a session begins with."""

    depth: float
    """Depth [m]."""

    temperature: NotRequired[float | None]
    """Temperature [°C]; the air's where there is none."""

    density: NotRequired[float | None]
    """Density [kg/m³]; the material's `fresh_density` where there is none."""


class Snowfall(TypedDict):
    """Fresh snow on a region."""

    depth: float
    """Depth [m], at least `cell_size`/256."""

    density: NotRequired[float | None]
    """
    Density [kg/m³]; the material's `fresh_density` where there is none, in alpine snow that of new snow in this
    weather.
    """

    temperature: NotRequired[float | None]
    """Temperature [°C], in alpine snow down to −60; the air's where there is none, 0 at most."""

    region: NotRequired[Region | None]


class SnowfallEvent(TypedDict):
    op: Literal["event"]
    event: Literal["snowfall"]
    tick: Tick
    seq: Seq
    fallen_mass: float
    """Mass that fell, the refused part included [kg]."""

    refused_mass: float
    """Mass that found no room [kg]."""


class SnowfallMessage(TypedDict):
    """Lets snow fall, as POST …/snowfalls."""

    op: Literal["snowfall"]
    id: Id
    depth: float
    """Depth [m], at least cell_size/256."""

    density: NotRequired[float | None]
    """Density [kg/m³]."""

    temperature: NotRequired[float | None]
    """Temperature [°C], in alpine snow down to −60."""

    region: NotRequired[Region | None]
    """The whole grid where there is none."""


class Stamp(TypedDict):
    """When a reply holds: the tick, and the number of the newest published change."""

    tick: int
    """Ticks since the session was created or reset."""

    seq: int
    """Number of the newest published change. It only grows, and may exceed 32 bits."""


class AirTemperatureReply(Stamp):
    """Answer to an air temperature."""

    celsius: float
    """Temperature of the air [°C]."""


class BatchReply(Stamp):
    """Answer to a batch of colliders."""

    results: NotRequired[BatchResults | None]


class CellsView(Stamp):
    """A box of the fixed grid. Arrays have x fastest, then y, then z."""

    origin: CellOrigin
    """First cell."""

    width: int
    """Cells along x."""

    depth: int
    """Cells along z."""

    height: int
    """Cells along y."""

    content: list[ContentName]
    """What each cell holds."""

    fields: dict[str, list[float | None]]
    """The fields asked for, by their names; `null` outside the snow."""


class ClearingReply(Stamp):
    """Answer to a clearing."""

    cleared_mass: float
    """Mass that was removed [kg]."""


class ColliderPage(Stamp, PageColliderView):
    """A page of the colliders of a session."""


class ColliderReply(Stamp, ColliderView):
    """Answer to a collider that was put or patched."""


class ColumnView(Stamp, AlpineColumn):
    """One column's material cells."""

    height: float
    """Snow depth [m]."""

    mass: float
    """Mass [kg]."""

    mean_density: float
    """Mass over volume [kg/m³]; 0 where there is no snow."""

    layers: list[LayerView]
    """The material cells, from the ground up."""

    weak_layers: list[WeakLayerView]
    """Layers less dense than what lies above and below, from the ground up."""


class DigestView(Stamp):
    """The digest of a session."""

    digest: str
    """Hash of all that a snapshot holds: equal digests, equal snowpacks."""


class HeightView(Stamp):
    """The snow depth at a point."""

    height: float
    """Snow depth [m]."""


class HeightsView(Stamp):
    """Heights of a region."""

    origin: Origin
    """First column."""

    width: int
    """Samples along x."""

    depth: int
    """Samples along z."""

    stride: int
    """Columns from one sample to the next."""

    cell_size: float
    """Side of a column [m]."""

    quantity: NotRequired[Quantity]
    """The quantity in `heights`, unless these are depths or elevations."""

    heights: list[float]
    """Snow depths [m], or elevations or the quantity where those are asked for, row by row: index = z · width + x."""


class MassView(Stamp):
    """The mass ledger of a session."""

    present: float
    """Mass of the snow, summed over its cells [kg]; in alpine snow with what has fallen and is too thin for a cell."""

    fallen: float
    """Mass that has fallen [kg], the refused part included."""

    refused: float
    """Mass that found no room [kg]."""

    cleared: float
    """Mass that was cleared [kg]."""

    carried: float
    """Mass that lies on objects [kg]."""

    rained: NotRequired[float]
    """Mass that rained [kg], where the snow is alpine."""

    deposited: NotRequired[float]
    """Mass of vapour that settled on the snow [kg], where the snow is alpine."""

    sublimated: NotRequired[float]
    """Mass that left as vapour [kg], where the snow is alpine."""

    runoff: NotRequired[float]
    """Mass of water that ran off [kg], where the snow is alpine."""

    imbalance_quanta: int
    """
    fallen − refused − cleared − present − carried, in quanta of 2⁻¹⁸ kg/m² in one column: always 0. In alpine snow
    what rained and was deposited is added, and what ran off and sublimated is taken off.
    """


class ProbeReply(Stamp):
    """Answer to probes."""

    probes: list[ProbeView]
    """What becomes of each load, in the order asked for."""


class SampleReply(Stamp):
    """Answer to samples."""

    fields: SampleFields
    """The fields asked for."""


class SnowfallReply(Stamp):
    """Answer to a snowfall."""

    fallen_mass: float
    """Mass that fell [kg], the refused part included."""

    refused_mass: float
    """Mass that found no room [kg]."""


class StampBatch(TypedDict):
    """Loads that press prints into the snow, in one frame."""

    stamps: list[StampSpec]
    """
    The loads, in order: where prints overlap, a later one is pressed into the snow that the earlier one left.
    Together they may cover 4 194 304 columns.
    """


class StampReply(Stamp):
    """Answer to stamps."""

    stamps: list[PrintView]
    """The print of each, in their order."""


class StampSpec(TypedDict):
    """
    A load that presses a print and is gone.

    It has either a `mass` or a `pressure`.
    """

    shape: Shape
    """Outline from above; any but a wheel."""

    position: Position
    """Where its centre is [m]. The outline must cover some of the grid."""

    heading: NotRequired[float]
    """Compass bearing of its front [°]."""

    mass: NotRequired[float | None]
    """Mass [kg], spread over the whole outline."""

    pressure: NotRequired[float | None]
    """Pressure [Pa]."""


class StampsMessage(TypedDict):
    """Presses prints into the snow, as POST …/stamps."""

    op: Literal["stamps"]
    id: Id
    stamps: list[StampSpec]
    """The loads, in order. Together they may cover 4 194 304 columns."""


Start: TypeAlias = str


State: TypeAlias = Literal["running", "paused", "stepping", "hibernating"]


class SteadyWeather(TypedDict):
    """Weather that holds until it is replaced."""

    op: Literal["weather"]
    id: Id
    air_temperature: float
    """Temperature of the air [°C]."""

    relative_humidity: float
    """Relative humidity over water [%]."""

    wind_speed: float
    """Wind speed [m/s]."""

    wind_direction: NotRequired[float | None]
    """Where the wind comes from [°]: 0 is north (+z), 90 is east (+x)."""

    pressure: NotRequired[float | None]
    """Air pressure [hPa]; the site's where there is none."""

    snowfall: NotRequired[float | None]
    """Snowfall, as water [mm/h]."""

    rainfall: NotRequired[float | None]
    """Rainfall [mm/h]."""

    precipitation: NotRequired[float | None]
    """Snow and rain together [mm/h], in place of the two: all snow up to 1.2 °C, else rain."""

    shortwave: NotRequired[float | None]
    """Short-wave radiation on a level surface [W/m²]; worked out where there is none."""

    longwave: NotRequired[float | None]
    """Long-wave radiation from the sky [W/m²]; worked out where there is none."""

    cloud_cover: NotRequired[float | None]
    """Part of the sky that clouds cover; where there is none, 1 while it snows or rains, else 0."""

    sun: NotRequired[SunPosition | None]
    """Where the sun stands; worked out from the site where there is none."""


class StepProgressEvent(TypedDict):
    """
    How far a long step has come: twice a second from half a second after it began, and once when it has
    ended.
    """

    op: Literal["event"]
    event: Literal["step_progress"]
    tick: Tick
    seq: Seq
    progress: Progress | None
    """`null` where the step has ended."""


class StepSpec(TypedDict):
    """
    How far a paused session is to be stepped; exactly one of `ticks`, `seconds` and
    `until_settled`.
    """

    ticks: NotRequired[int | None]
    """Number of ticks."""

    seconds: NotRequired[float | None]
    """Simulated seconds."""

    until_settled: NotRequired[bool | None]
    """Until nothing moves any more; needs `max_seconds`."""

    max_seconds: NotRequired[float | None]
    """Most simulated seconds to step with `until_settled`."""


StoreStatus: TypeAlias = Literal["sound", "damaged", "failing", "gone"]


class StreamQuery(TypedDict):
    """Streams heights and takes changes"""

    token: NotRequired[str]
    """An API key or one of the session's tokens, where there is no `Authorization` header."""


class SubscribeMessage(TypedDict):
    """Begins a subscription, or replaces the one of the same id. At most 64 on a socket."""

    op: Literal["subscribe"]
    id: Id
    region: NotRequired[ColumnRegion | None]
    """The whole grid where there is none."""

    stride: NotRequired[Literal[1, 2, 4, 8]]
    """
    Every how many columns one is sent: those whose column_x and column_z are multiples
    of it.
    """

    max_rate: NotRequired[float]
    """
    Most messages of heights per second of this subscription, on average [Hz], and most events of
    each kind. A new tick may be told up
    to one message early, so that it is told when it happens; changes between ticks wait
    for their turn.
    """

    quantum: NotRequired[float]
    """Step that heights are rounded to [m]."""

    colliders: NotRequired[bool]
    """Whether the colliders in the region are wanted."""

    terrain: NotRequired[bool]
    """Whether the ground in the region is wanted."""

    events: NotRequired[EventsWanted]
    watch: NotRequired[DepthWatches]
    resume: NotRequired[Resume | None]
    """
    The state that the client holds, that of the ground too where `terrain` is wanted: the epoch of the
    `welcome` under which it was told, and the seq of the last whole message.
    """


class Summary(TypedDict):
    """Totals over a snowpack."""

    mean_height: float
    """Mean snow depth [m]."""

    min_height: float
    """Least snow depth [m]."""

    max_height: float
    """Greatest snow depth [m]."""

    total_mass: float
    """Mass of the snow [kg]."""

    mean_density: float
    """Mass over volume [kg/m³]; 0 where there is no snow."""

    active_tiles: int
    """Tiles in which snow still moves."""

    tiles: int
    """Tiles of 8 × 8 columns."""

    colliders: int
    """Objects on the snow."""


class SunPosition(TypedDict):
    """Where the sun stands in the sky."""

    azimuth: float
    """Its direction [°]: 0 is north (+z), 90 is east (+x)."""

    elevation: float
    """How high it stands above the horizon [°]; below 0 it is night."""


class Terrain(TypedDict):
    """Elevation of the ground under each column."""

    heights: list[float]
    """Elevations [m] within ±20 000, row by row: index = z · width + x."""


class TerrainEvent(TypedDict):
    """The snow lies on other ground, as `GET …/terrain` has it."""

    op: Literal["event"]
    event: Literal["terrain"]
    tick: Tick
    seq: Seq
    lowest: float
    """Lowest elevation of the ground [m]."""

    highest: float
    """Highest elevation of the ground [m]."""


Tick: TypeAlias = int


class Tile(TypedDict):
    column_x: int
    """First column along x."""

    column_z: int
    """First column along z."""

    width: int
    """Samples along x."""

    depth: int
    """Samples along z."""

    heights: list[float]
    """
    Snow depths [m], row by row: index = z · width + x. Sample (x, z) is of column
    (column_x + x · stride, column_z + z · stride).
    """


class TokensReply(TypedDict):
    """The tokens of a session."""

    token: str
    """Allows everything about this session."""

    viewer_token: str
    """Allows its reads and streams."""


class UnsubscribeMessage(TypedDict):
    """Ends a subscription. Nothing of it follows the ack."""

    op: Literal["unsubscribe"]
    id: Id


class UpdateMessage(TypedDict):
    """Moves a subscription, and changes what else it wants. Only tiles that came into view are sent."""

    op: Literal["update"]
    id: Id
    region: NotRequired[ColumnRegion | None]
    """The whole grid where there is none."""

    events: NotRequired[EventsWanted | None]
    """As before where it is not said."""

    watch: NotRequired[DepthWatches | None]
    """As before where it is not said."""


class UsageView(TypedDict):
    """What a session takes of the server."""

    device_seconds: float
    """Device time that it has been charged with since the server was started [s]."""

    memory_bytes: MemoryBytes
    """Memory, by what it is for."""


class VerifyReply(TypedDict):
    """What was found in the store."""

    sound: bool
    """Whether nothing is wrong."""

    sessions: int
    """Sessions that can be brought back."""

    broken: list[str]
    """Each session that can't be, by its name, and why."""

    damage: list[str]
    """Everything else that is wrong: with a row, and whose it is, or with the file."""

    rows: int
    """Sound rows, second copies among them."""

    bytes: int
    """What they take [bytes]."""

    file_bytes: int
    """Length of the file [bytes]. What it has beyond the rows is its index and unused pages."""


class WatchEvent(TypedDict):
    """How a watch stands, at the begin of its subscription and with each crossing."""

    op: Literal["event"]
    event: Literal["watch"]
    tick: Tick
    seq: Seq
    subscription: int
    """The subscription that has the watch."""

    id: str
    """The watch."""

    holds: bool
    """
    Whether the mean depth is above (or below) the watch's by now: after a crossing, true where it has
    come to hold and false where it has ceased to.
    """

    mean_depth: float
    """Mean depth of the snow in the region [m]."""


class WeakLayerView(TypedDict):
    """
    A maximal run of cells with a density of at most 0.8 of the least dense of the densest cell
    above and the densest cell below.
    """

    bottom: float
    """Height of its lower face above the ground [m]."""

    thickness: float
    """Thickness [m]."""

    density: float
    """Mean density [kg/m³]."""

    temperature: float
    """Mean temperature, weighted by mass [°C]."""

    contrast: float
    """1 − the smallest ratio of a cell's density to that of the cells around."""


class Weather(TypedDict):
    """
    The weather at one time, as a client tells it.

    Radiation that is left out is worked out: see [`shortwave`](fn@shortwave) and [`longwave`](fn@longwave).
    """

    air_temperature: float
    """Temperature of the air [°C]."""

    relative_humidity: float
    """Relative humidity over water [%]."""

    wind_speed: float
    """Wind speed [m/s]."""

    wind_direction: NotRequired[float | None]
    """Where the wind comes from [°]: 0 is north (+z), 90 is east (+x)."""

    pressure: NotRequired[float | None]
    """Air pressure [hPa]; the site's where there is none."""

    snowfall: NotRequired[float | None]
    """Snowfall, as water [mm/h]; 0 where there is none."""

    rainfall: NotRequired[float | None]
    """Rainfall [mm/h]; 0 where there is none."""

    precipitation: NotRequired[float | None]
    """Snow and rain together [mm/h], in place of `snowfall` and `rainfall`: all snow up to 1.2 °C, else rain."""

    shortwave: NotRequired[float | None]
    """Short-wave radiation on a level surface [W/m²]; worked out from the sun and the clouds where there is none."""

    longwave: NotRequired[float | None]
    """
    Long-wave radiation from the sky [W/m²]; worked out from temperature, humidity and clouds where there is
    none.
    """

    cloud_cover: NotRequired[float | None]
    """
    Part of the sky that clouds cover, 0 to 1. Where there is none, the sky is overcast while snow or rain falls
    and clear else.
    """

    sun: NotRequired[SunPosition | None]


class WeatherEvent(TypedDict):
    """The weather of alpine snow is another from now on."""

    op: Literal["event"]
    event: Literal["weather"]
    tick: Tick
    seq: Seq
    now: WeatherNow


EventMessage: TypeAlias = SnowfallEvent | ClearingEvent | SettingsEvent | WeatherEvent | TerrainEvent | StepProgressEvent | PlainEvent | WatchEvent


WeatherMessage: TypeAlias = SteadyWeather | ChangingWeather


class WeatherNow(TypedDict):
    """The weather at one time, with nothing left out but the sun where nobody knows where it stands."""

    air_temperature: float
    """Temperature of the air [°C]."""

    relative_humidity: float
    """Relative humidity over water [%]."""

    wind_speed: float
    """Wind speed [m/s]."""

    wind_direction: float | None
    """Where the wind comes from [°]; `null` where nobody has told."""

    pressure: float
    """Air pressure [hPa]."""

    snowfall: float
    """Snowfall, as water [mm/h]."""

    rainfall: float
    """Rainfall [mm/h]."""

    shortwave: float
    """Short-wave radiation on a level surface [W/m²]."""

    longwave: float
    """Long-wave radiation from the sky [W/m²]."""

    cloud_cover: float
    """Part of the sky that clouds cover, 0 to 1."""

    sun: SunPosition | None


class WeatherRow(TypedDict):
    """The weather from a time on."""

    air_temperature: float
    """Temperature of the air [°C]."""

    relative_humidity: float
    """Relative humidity over water [%]."""

    wind_speed: float
    """Wind speed [m/s]."""

    wind_direction: NotRequired[float | None]
    """Where the wind comes from [°]: 0 is north (+z), 90 is east (+x)."""

    pressure: NotRequired[float | None]
    """Air pressure [hPa]; the site's where there is none."""

    snowfall: NotRequired[float | None]
    """Snowfall, as water [mm/h]; 0 where there is none."""

    rainfall: NotRequired[float | None]
    """Rainfall [mm/h]; 0 where there is none."""

    precipitation: NotRequired[float | None]
    """Snow and rain together [mm/h], in place of `snowfall` and `rainfall`: all snow up to 1.2 °C, else rain."""

    shortwave: NotRequired[float | None]
    """Short-wave radiation on a level surface [W/m²]; worked out from the sun and the clouds where there is none."""

    longwave: NotRequired[float | None]
    """
    Long-wave radiation from the sky [W/m²]; worked out from temperature, humidity and clouds where there is
    none.
    """

    cloud_cover: NotRequired[float | None]
    """
    Part of the sky that clouds cover, 0 to 1. Where there is none, the sky is overcast while snow or rain falls
    and clear else.
    """

    sun: NotRequired[SunPosition | None]
    at: float
    """Simulated time [s]."""


class WeatherSeries(TypedDict):
    """Weather over time. Before its first row and after its last these hold."""

    series: list[WeatherRow]
    """The rows, in the order of their times."""

    interpolate: bool
    """Whether the weather changes evenly from row to row; else a row holds until the next."""


WeatherInput: TypeAlias = Weather | WeatherSeries


class WeatherSeriesSpec(TypedDict):
    """Weather over time. Before its first row and after its last these hold."""

    series: list[WeatherRow]
    """The rows, in the order of their times."""

    interpolate: NotRequired[bool]
    """Whether the weather changes evenly from row to row; else a row holds until the next."""


WeatherInputSpec: TypeAlias = Weather | WeatherSeriesSpec


class WeatherView(Stamp):
    """The weather of alpine snow: what was told, and what holds now."""

    sim_time: float
    """Simulated time [s]."""

    steps: int
    """Steps of weather that the snow has taken."""

    now: WeatherNow
    """What holds now."""

    derived: list[str]
    """What of that was not told but worked out: `shortwave`, `longwave`, `sun`, `pressure`, `cloud_cover`."""

    weather: WeatherInput
    """What was told."""


class WelcomeMessage(TypedDict):
    """The first message of every stream."""

    op: Literal["welcome"]
    session: str
    """Name of the session."""

    epoch: str
    """Opaque; (epoch, seq) names one state."""

    tick: Tick
    seq: Seq
    tile_size: Literal[8]
    """Columns along one side of a tile."""

    grid: Grid
    settings: Settings
