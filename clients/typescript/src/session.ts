// A session over REST.

import type { GetCellsQuery } from "./generated.ts";
import { type Access, ask, ProblemError, type Request, send } from "./http.ts";
import { Stream, type StreamOptions } from "./stream.ts";
import type {
  BatchReply,
  Cells,
  Checkpoint,
  CheckpointList,
  Clearing,
  ClearingReply,
  Collider,
  ColliderBatch,
  ColliderPage,
  ColliderPatch,
  ColliderSpec,
  Column,
  HeightsQuery,
  MassLedger,
  PageQuery,
  Probe,
  ProbeSpec,
  SampleBatch,
  SampleFields,
  SessionView,
  SettingsPatch,
  Snowfall,
  SnowfallReply,
  Stamp,
  StampReply,
  StampSpec,
  StepSpec,
  TerrainQuery,
  Tokens,
  Usage,
  WeatherInput,
  WeatherView,
} from "./types.ts";

/** Media type of a snapshot. */
const SNAPSHOT = "application/vnd.firn.snapshot";

/** Which cells of the fixed grid to read. */
export interface CellsQuery extends Omit<GetCellsQuery, "fields"> {
  /** Names of fields. */
  fields?: string[];
}

/** Heights of a region, or another quantity of its columns, row by row: index = z · width + x. */
export interface Heights extends Stamp {
  heights: Float32Array;
}

/** The snow at points. Of the fields that were asked for a value for each point, `null` for the others. */
export interface Samples extends Stamp {
  fields: SampleFields;
}

/** One session of a server. A change is answered once it is applied and visible to the next read. */
export class Session {
  readonly access: Access;
  readonly id: string;

  constructor(access: Access, id: string) {
    this.access = access;
    this.id = id;
  }

  private path(rest = ""): string {
    return `/v1/sessions/${encodeURIComponent(this.id)}${rest}`;
  }

  private call<T>(rest: string, request?: Request): Promise<T> {
    return ask(this.access, this.path(rest), request);
  }

  /** Its configuration, clock and summary. */
  get(): Promise<SessionView> {
    return this.call("");
  }

  /** Changes settings; those left out stay. */
  patch(settings: SettingsPatch): Promise<SessionView> {
    return this.call("", { method: "PATCH", body: settings });
  }

  /** Deletes it. */
  async delete(): Promise<void> {
    await send(this.access, this.path(), { method: "DELETE" });
  }

  /** Steps it while it is paused. Aborting the signal ends the step early. */
  step(step: StepSpec, signal?: AbortSignal): Promise<SessionView> {
    return this.call("/step", { method: "POST", body: step, signal });
  }

  /** Ends the step under way at the tick it has reached; 409 where there is none. */
  async endStep(): Promise<void> {
    await send(this.access, this.path("/step"), { method: "DELETE" });
  }

  /** Back to the state it was created in, or to a restore point. */
  reset(checkpoint?: string): Promise<SessionView> {
    return this.call("/reset", { method: "POST", body: { checkpoint } });
  }

  /** Makes it what a snapshot of the same grid and ground holds. */
  resetToSnapshot(snapshot: ArrayBuffer | Uint8Array): Promise<SessionView> {
    return this.call("/reset", { method: "POST", body: snapshot, contentType: SNAPSHOT });
  }

  /** Its restore points, in ascending order of their names. */
  async checkpoints(): Promise<Checkpoint[]> {
    return (await this.call<CheckpointList>("/checkpoints")).items;
  }

  /** Keeps its present state under a name; a restore point of that name is replaced. */
  putCheckpoint(name: string): Promise<Checkpoint> {
    return this.call(`/checkpoints/${encodeURIComponent(name)}`, { method: "PUT" });
  }

  /** Deletes a restore point. */
  async deleteCheckpoint(name: string): Promise<void> {
    await send(this.access, this.path(`/checkpoints/${encodeURIComponent(name)}`), { method: "DELETE" });
  }

  /** New tokens; the old ones stop working. */
  renewTokens(): Promise<Tokens> {
    return this.call("/tokens", { method: "POST" });
  }

  /** The whole session in one piece, for `Firn.restoreSession`. */
  async snapshot(): Promise<ArrayBuffer> {
    return (await send(this.access, this.path("/snapshot"), { accept: SNAPSHOT })).arrayBuffer();
  }

  /** A hash of what a snapshot holds. */
  digest(): Promise<Stamp & { digest: string }> {
    return this.call("/digest");
  }

  /**
   * Lets snow fall at once; above objects it lies on them, unless their `shelters` is false. With an idempotency key, repeats add
   * nothing.
   */
  snowfall(snowfall: Snowfall, idempotencyKey?: string): Promise<SnowfallReply> {
    return this.call("/snowfalls", { method: "POST", body: snowfall, idempotencyKey });
  }

  /** Leaves at most a depth standing. The snow under objects stays, unless they are airborne. */
  clear(clearing: Clearing, idempotencyKey?: string): Promise<ClearingReply> {
    return this.call("/clearings", { method: "POST", body: clearing, idempotencyKey });
  }

  /** Sets the air temperature [°C]. */
  setAirTemperature(celsius: number): Promise<Stamp & { celsius: number }> {
    return this.call("/air-temperature", { method: "PUT", body: { celsius } });
  }

  /** The weather of alpine snow: what was told, what holds now, and what of that was worked out. */
  weather(): Promise<WeatherView> {
    return this.call("/weather");
  }

  /** Gives alpine snow another weather: values that hold until they are replaced, or a series. */
  putWeather(weather: WeatherInput): Promise<Stamp> {
    return this.call("/weather", { method: "PUT", body: weather });
  }

  /** A page of the objects on the snow. */
  colliders(query: PageQuery = {}): Promise<ColliderPage> {
    return this.call("/colliders", { query });
  }

  /** An object on the snow: where it stands, how it moves, and its `burden`, the snow that lies on it [kg]. */
  collider(id: string): Promise<Collider & Stamp> {
    return this.call(`/colliders/${encodeURIComponent(id)}`);
  }

  /**
   * Changes parts of an object; the others stay as they are. `position` and `heading` lift it to another place; with `sweep` they push
   * it there in the next cycle, and it leaves a track. `velocity` and `position` end a path.
   */
  patchCollider(id: string, patch: ColliderPatch): Promise<Collider & Stamp> {
    return this.call(`/colliders/${encodeURIComponent(id)}`, { method: "PATCH", body: patch });
  }

  /**
   * Puts an object on the snow; replaces the one of the same id. It moves by itself with a `velocity` [m/s], a `turn_rate` [°/s], or a
   * `path` [m] that it takes `over` a time [s].
   */
  putCollider(collider: ColliderSpec): Promise<Collider & Stamp> {
    const { id, ...body } = collider;
    if (id == null) return this.call("/colliders", { method: "POST", body });
    return this.call(`/colliders/${encodeURIComponent(id)}`, { method: "PUT", body });
  }

  /** Removes an object. */
  async deleteCollider(id: string): Promise<void> {
    await send(this.access, this.path(`/colliders/${encodeURIComponent(id)}`), { method: "DELETE" });
  }

  /**
   * Puts and removes many objects in one frame: all or none, or with `on_error: "skip"` those without error. It then has
   * `results`, one for each.
   */
  batchColliders(batch: ColliderBatch): Promise<BatchReply> {
    return this.call("/colliders:batch", { method: "POST", body: batch });
  }

  /** Presses the prints of up to 4096 loads into the snow in one frame, all or none. */
  stamp(stamps: StampSpec[], idempotencyKey?: string): Promise<StampReply> {
    return this.call("/stamps", { method: "POST", body: { stamps }, idempotencyKey });
  }

  /** Snow depths [m]; of alpine snow also another `quantity` of the columns, in its unit. */
  heights(query: HeightsQuery = {}, signal?: AbortSignal): Promise<Heights> {
    return this.floats("/heights", query, signal);
  }

  /** Elevations of the ground [m]. */
  terrain(query: TerrainQuery = {}): Promise<Heights> {
    return this.floats("/terrain", query);
  }

  /** Lays other ground under the snow: an elevation [m] for each column, row by row. */
  putTerrain(elevations: Float32Array): Promise<Stamp> {
    const bytes = new DataView(new ArrayBuffer(4 * elevations.length));
    elevations.forEach((elevation, i) => bytes.setFloat32(4 * i, elevation, true));
    return this.putGround(bytes.buffer, "application/octet-stream");
  }

  /** The same from a grey image of 8 or 16 bits, a pixel for each column: metres = grey · scale + offset. */
  putTerrainImage(png: ArrayBuffer, scale: number, offset = 0): Promise<Stamp> {
    return this.putGround(png, "image/png", { scale, offset });
  }

  private putGround(body: ArrayBuffer, contentType: string, query: Record<string, number> = {}): Promise<Stamp> {
    return this.call("/terrain", { method: "PUT", body, contentType, query });
  }

  private async floats(below: string, query: HeightsQuery, signal?: AbortSignal): Promise<Heights> {
    const accept = "application/octet-stream";
    const response = await send(this.access, this.path(below), { query, accept, signal });
    const view = new DataView(await response.arrayBuffer());
    const heights = Float32Array.from({ length: view.byteLength / 4 }, (_, i) => view.getFloat32(4 * i, true));
    const stamp = (name: string) => Number(response.headers.get(name));
    return { tick: stamp("firn-tick"), seq: stamp("firn-seq"), heights };
  }

  /** The snow depth at a point [m]. */
  height(x: number, z: number): Promise<Stamp & { height: number }> {
    return this.call("/height", { query: { x, z } });
  }

  /** A column, layer by layer, with its weak layers. */
  column(column_x: number, column_z: number, signal?: AbortSignal): Promise<Column> {
    return this.call(`/columns/${column_x}/${column_z}`, { signal });
  }

  /** A column of alpine snow as a snow profile after CAAML 6.0.3, as XML. */
  async snowProfile(column_x: number, column_z: number): Promise<string> {
    const request = { query: { format: "caaml" }, accept: "application/xml" };
    return (await send(this.access, this.path(`/columns/${column_x}/${column_z}`), request)).text();
  }

  /** Cells of the fixed grid. */
  cells(query: CellsQuery = {}, signal?: AbortSignal): Promise<Cells> {
    const { fields, ...box } = query;
    return this.call("/cells", { query: { ...box, fields: fields?.join(",") }, signal });
  }

  /** The mass ledger [kg]; `carried` lies on objects. */
  mass(): Promise<MassLedger> {
    return this.call("/mass");
  }

  /** What it takes of the server: device time and memory. */
  usage(): Promise<Usage> {
    return this.call("/usage");
  }

  /** How deep loads would sink, without putting them there. */
  probe(probes: ProbeSpec[]): Promise<Stamp & { probes: Probe[] }> {
    return this.call("/probes", { method: "POST", body: { probes } });
  }

  /** The snow at points, each [x, z] in metres: `fields` of them, the four of the surface where nothing is said. */
  sample(batch: SampleBatch, signal?: AbortSignal): Promise<Samples> {
    return this.call("/samples", { method: "POST", body: batch, signal });
  }

  /** Opens a stream, which connects again by itself and resumes. */
  stream(options: StreamOptions = {}): Stream {
    const url = new URL(this.path("/stream"), this.access.url);
    url.protocol = url.protocol.replace("http", "ws");
    if (this.access.token) url.searchParams.set("token", this.access.token);
    return new Stream(url, () => this.whyNoStream(), options);
  }

  /** WebSockets don't tell why a connection failed: this asks. */
  private async whyNoStream(): Promise<ProblemError | null> {
    try {
      await this.get();
      return null;
    } catch (error) {
      return error instanceof ProblemError ? error : null;
    }
  }
}
