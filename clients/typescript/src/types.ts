// What the server is sent and what it answers, named as on the wire. SI units and °C; api/openapi.json says more.

/** When something holds. */
export interface Stamp {
  /** Ticks since the session was created or reset. */
  tick: number;
  /** Number of the newest published change. */
  seq: number;
}

/** Size of a session's grid. */
export interface Grid {
  /** Columns along x. */
  width: number;
  /** Columns along z. */
  depth: number;
  /** Slots for material cells in each column. */
  height: number;
  /** Side of a fresh cell, and of a column [m]. */
  cell_size: number;
}

/** Material constants. */
export interface Material {
  /** Density of fresh snow [kg/m³]. */
  fresh_density: number;
  /** Density at which snow compacts no further [kg/m³]. */
  max_density: number;
  /** Exponent n of the stiffness law k = ρⁿ. */
  stiffness_exponent: number;
  hardness_law: "calibrated" | "regression" | "gold";
  /** Grain size [mm], read by the law `gold` only. */
  grain_size_mm: number;
  load_distribution: "two_to_one" | "uniform" | "surface";
}

/** What can be changed about a session at any time. */
export interface Settings {
  /** Temperature of the air [°C], −40 to 0. */
  air_temperature: number;
  /** Simulated seconds per second, 0 to 1000. */
  time_scale: number;
  /** Ticks per second [Hz], 1 to 240. */
  tick_rate: number;
  /** Whether time stands still. */
  paused: boolean;
  /** Continuous snowfall [m/h]. */
  snowfall_rate: number;
  /** Idle time until it hibernates [s]. */
  idle_timeout_s: number | null;
  /** Idle time until it is deleted [s]. */
  delete_after_s: number | null;
}

/** Other settings; those left out stay. */
export type SettingsPatch = Partial<Settings> & { stiffness_exponent?: number };

/** A layer of the snow that a session begins with. */
export interface SnowLayer {
  /** Depth [m]. */
  depth: number;
  /** Temperature [°C]; the air's where there is none. */
  temperature?: number;
  /** Density [kg/m³]; that of fresh snow where there is none. */
  density?: number;
}

/** The ground. */
export interface Terrain {
  /** Elevations [m], row by row: index = z · width + x. */
  heights: number[];
}

/** A session that is to be created. */
export type SessionSpec = Partial<Settings> & {
  /** Its name, `[A-Za-z0-9_-]{1,64}`; the server makes one where there is none. */
  id?: string;
  grid?: Partial<Grid>;
  material?: Partial<Material>;
  /** From the ground up. */
  initial_snow?: SnowLayer[];
  terrain?: Terrain | null;
};

/** Totals of a session. */
export interface Summary {
  /** Mean snow depth [m]. */
  mean_height: number;
  /** Least snow depth [m]. */
  min_height: number;
  /** Greatest snow depth [m]. */
  max_height: number;
  /** Mass of the snow [kg]. */
  total_mass: number;
  /** Mass over volume [kg/m³]. */
  mean_density: number;
  /** Tiles in which snow still moves. */
  active_tiles: number;
  /** Tiles of 8 × 8 columns. */
  tiles: number;
  colliders: number;
}

/** A session. */
export interface SessionView extends Settings, Stamp {
  id: string;
  grid: Grid;
  material: Material;
  terrain: Terrain | null;
  state: "running" | "paused" | "hibernating";
  /** Opaque; (epoch, seq) names one state. */
  epoch: string;
  /** Simulated time [s]. */
  sim_time: number;
  /** Whether nothing moves. */
  settled: boolean;
  summary: Summary;
  /** Device memory that its cells take [bytes]. */
  device_memory_bytes: number;
  created_at: string;
  stream_url: string;
}

/** A session that was just created, with its tokens. They are told once. */
export interface CreatedSession extends SessionView {
  /** Allows everything about this session. */
  token: string;
  /** Allows its reads and streams. */
  viewer_token: string;
}

/** A page of a list. */
export interface Page<T> {
  items: T[];
  /** Cursor of the next page; null after the last. */
  next_cursor: string | null;
}

/** How far to step: by ticks, by simulated seconds, or until nothing moves. */
export type StepSpec =
  | { ticks: number }
  | { seconds: number }
  | { until_settled: true; max_seconds: number };

/** A rectangle in metres: the columns whose centres lie in it. */
export interface Region {
  x: number;
  z: number;
  width: number;
  depth: number;
}

/** A rectangle of columns. */
export interface ColumnRegion {
  column_x: number;
  column_z: number;
  width: number;
  depth: number;
}

/** Snow that is to fall at once. */
export interface Snowfall extends SnowLayer {
  /** Where; everywhere where there is none. */
  region?: Region;
}

export interface SnowfallReply extends Stamp {
  /** Mass that fell, the refused part included [kg]. */
  fallen_mass: number;
  /** Mass that found no room [kg]. */
  refused_mass: number;
}

/** What a plough does. */
export interface Clearing {
  /** Depth left standing [m]. */
  depth: number;
  region?: Region;
}

export interface ClearingReply extends Stamp {
  /** Mass that was removed [kg]. */
  cleared_mass: number;
}

/** Outline of an object from above [m]. */
export type Shape = { type: "box"; width: number; depth: number } | { type: "disk"; radius: number };

/** Centre of an object [m]. */
export interface Position {
  x: number;
  z: number;
}

/** An object that is to be put on the snow. */
export interface ColliderSpec {
  /** Its name; the server makes one where there is none. */
  id?: string;
  /** Mass [kg]. */
  mass: number;
  shape: Shape;
  position: Position;
}

/** An object on the snow, and how it stands there. */
export interface Collider {
  id: string;
  /** Mass [kg]. */
  mass: number;
  shape: Shape;
  position: Position;
  /** Elevation of its bottom [m]. */
  bottom: number;
  /** How far it has sunk where it stands [m]. */
  sink_depth: number;
  /** Area in contact [m²]. */
  contact_area: number;
  /** Pressure on the area in contact [Pa]. */
  pressure: number;
  /** Whether it stayed as it was over the last cycle. */
  resting: boolean;
}

/** Objects to put, which need ids, and ids of those to remove: up to 4096 in all, all or none. */
export interface ColliderBatch {
  put?: (ColliderSpec & { id: string })[];
  delete?: string[];
}

/** Which heights to read. */
export interface HeightsQuery extends Partial<ColumnRegion> {
  /** Every how many columns one is told. */
  stride?: 1 | 2 | 4 | 8;
  /** Elevations of the surface, the terrain added. */
  surface?: boolean;
}

/** A material cell of a column. */
export interface Layer {
  /** Height of its lower face above the ground [m]. */
  bottom: number;
  /** Thickness [m]. */
  thickness: number;
  /** Density [kg/m³]. */
  density: number;
  /** Temperature [°C]. */
  temperature: number;
  /** Hardness [Pa]. */
  hardness: number;
  /** Vertical stress on it [Pa]. */
  stress: number;
  /** Mass [kg]. */
  mass: number;
}

/** A layer less dense than what lies above and below. */
export interface WeakLayer {
  bottom: number;
  thickness: number;
  density: number;
  temperature: number;
  /** 1 − the smallest ratio of a cell's density to that of the cells around. */
  contrast: number;
}

/** A column, layer by layer from the ground up. */
export interface Column extends Stamp {
  /** Snow depth [m]. */
  height: number;
  /** Mass [kg]. */
  mass: number;
  /** Mass over volume [kg/m³]. */
  mean_density: number;
  layers: Layer[];
  weak_layers: WeakLayer[];
}

/** A field of the fixed grid. */
export type CellField =
  | "density"
  | "temperature"
  | "hardness"
  | "stiffness"
  | "stress"
  | "external_stress"
  | "indent"
  | "mass"
  | "fill";

/** Which cells of the fixed grid to read. */
export interface CellsQuery extends Partial<ColumnRegion> {
  /** First cell along y. */
  cell_y?: number;
  /** Cells along y. */
  height?: number;
  fields?: CellField[];
}

/** A box of the fixed grid; arrays have x fastest, then y, then z. */
export interface Cells extends Stamp {
  origin: { column_x: number; column_z: number; cell_y: number };
  width: number;
  depth: number;
  height: number;
  content: ("air" | "snow" | "ground")[];
  /** The fields asked for; null outside the snow. */
  fields: Partial<Record<CellField, (number | null)[]>>;
}

/** The mass ledger [kg]. */
export interface MassLedger extends Stamp {
  present: number;
  /** The refused part included. */
  fallen: number;
  refused: number;
  cleared: number;
  /** fallen − refused − cleared − present, in quanta: always 0. */
  imbalance_quanta: number;
}

/** A load that might be put somewhere. */
export interface ProbeSpec extends Position {
  /** Mass [kg]. */
  mass: number;
  /** Area it stands on [m²]. */
  area: number;
}

/** What becomes of a load. */
export interface Probe {
  /** Present height of the column less its height once it has come to rest under the load [m]. */
  sink_depth: number;
  /** Hardness of the snow at the surface [Pa]; 0 where there is none. */
  surface_hardness: number;
  /** Pressure of the load [Pa]. */
  pressure: number;
  /** Whether the surface carries it as it is. */
  carries: boolean;
}

/** Answer to `GET /readyz`. */
export interface Readiness {
  status: string;
  /** What the snowpacks are computed on. */
  adapter: string;
  backend: string;
  /** `open` where nobody is asked for a token. */
  auth: string;
  sessions: number;
  capacity: number;
  /** Whether a session could be created now. */
  schedulable: boolean;
}

/** Something that happened in a session, told live. */
export type StreamEvent = Stamp &
  (
    | { event: "snowfall"; fallen_mass: number; refused_mass: number }
    | { event: "clearing"; cleared_mass: number }
    | { event: "settings"; settings: Settings }
    | { event: "settled" }
    | { event: "reset" }
  );

/** The first message of a stream. */
export interface Welcome extends Stamp {
  session: string;
  epoch: string;
  /** Columns along one side of a tile. */
  tile_size: number;
  grid: Grid;
  settings: Settings;
}

/** What is wrong with a request (RFC 9457). */
export interface Problem {
  type: string;
  title: string;
  status: number;
  detail: string;
  /** Each part of the request that was wrong. */
  errors: { pointer: string; detail: string }[];
}
