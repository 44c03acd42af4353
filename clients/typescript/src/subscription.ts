// What a stream's client watches, and what it holds of it.

import type { SubscribeMessage } from "./generated.ts";
import { HeightField } from "./height-field.ts";
import type { GroundTile, HeightMessage, Tile } from "./height-stream.ts";
import type { Collider, ColumnRegion, DepthWatch, EventsWanted, Welcome } from "./types.ts";

/** What is to be watched. */
export type Watch = Omit<SubscribeMessage, "op" | "id" | "resume">;

/** News of a subscription. */
export interface Change {
  /** All heights of the region, already up to date. */
  field: HeightField;
  /** What changed: tiles with their heights in quanta. */
  tiles: Tile[];
  /** Tiles whose ground was told with this, where the subscription wants it; it is in `field.ground` already. */
  terrain: GroundTile[];
  /** Whether all ground is level at 0, but those. */
  level: boolean;
  /** All objects in the region, where any of them changed. */
  colliders: Collider[] | null;
  /** Number of the state. It only grows, and may exceed 32 bits. */
  seq: number;
  tick: number;
  /** After the connection was lost: whether exactly what was missed came; null otherwise. */
  recovered: boolean | null;
}

/** Keeps the heights of a region in sync. Made by `Stream.subscribe`. */
export class Subscription {
  readonly id: number;
  private readonly watch: Watch;
  private readonly onChange: (change: Change) => void;
  private readonly tell: (message: object) => void;
  private field: HeightField | null = null;
  /** Parts of a message whose last part is still to come. */
  private parts: HeightMessage[] = [];
  /** The newest state that was told in full. */
  private seen: { epoch: string; seq: number } | null = null;
  private epoch = "";

  constructor(id: number, watch: Watch, tell: (message: object) => void, onChange: (change: Change) => void) {
    this.id = id;
    this.watch = { ...watch };
    this.tell = tell;
    this.onChange = onChange;
  }

  /** The seq of the newest state that was told in full; 0 before the first. */
  get seq(): number {
    return this.seen?.seq ?? 0;
  }

  /** Moves it; only what came into view is sent. Returns the heights known of the new region, null before the first. */
  update(region: ColumnRegion): HeightField | null {
    this.watch.region = region;
    this.field?.moveTo(region);
    this.tell({ op: "update", id: this.id, region });
    return this.field;
  }

  /** Wants other events, or other watches; how these stand is told at once. What is left out stays. */
  want({ events, watch }: { events?: EventsWanted; watch?: DepthWatch[] }): void {
    if (events !== undefined) this.watch.events = events;
    if (watch !== undefined) this.watch.watch = watch;
    this.tell({ op: "update", id: this.id, region: this.watch.region, events, watch });
  }

  /** Ends it. */
  close(): void {
    this.tell({ op: "unsubscribe", id: this.id });
  }

  /** What to send once the stream is open. Who holds all of the region asks for what it missed only. */
  begin(welcome: Welcome): object {
    this.parts = [];
    this.epoch = welcome.epoch;
    const { width, depth } = welcome.grid;
    if (this.field?.grid.width !== width || this.field.grid.depth !== depth) {
      this.field = new HeightField(welcome.grid, this.watch.stride ?? 1, this.watch.region, this.watch.terrain);
    }
    const resume = this.field.complete && this.seen ? { resume: this.seen } : {};
    return { op: "subscribe", id: this.id, ...this.watch, ...resume };
  }

  /** Takes in a message, or a part of one. */
  take(message: HeightMessage): void {
    this.parts.push(message);
    if (message.more || !this.field) return;
    const parts = this.parts;
    this.parts = [];
    const tiles = parts.flatMap((part) => part.tiles);
    const terrain = parts.flatMap((part) => part.terrain);
    const level = parts.some((part) => part.level);
    const told = parts.flatMap((part) => part.colliders ?? []);
    const colliders = parts.some((part) => part.colliders) ? told : null;
    if (message.op === "snapshot") this.field.forget();
    for (const tile of tiles) this.field.put(tile, this.watch.quantum ?? 0.001);
    if (level) this.field.putLevelGround();
    for (const tile of terrain) this.field.putGround(tile);
    const { seq, tick } = message;
    this.seen = { epoch: this.epoch, seq };
    const recovered = parts.find((part) => part.recovered !== null)?.recovered ?? null;
    this.onChange({ field: this.field, tiles, terrain, level, colliders, seq, tick, recovered });
  }
}
