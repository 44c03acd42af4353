// What this page knows about the session: its stream's news and its totals.

import type {
  Change,
  Collider,
  ColumnRegion,
  Grid,
  Session,
  SessionView,
  Stream,
  StreamState,
  Subscription,
} from "firn-client";
import { Ground, isSame } from "./ground.ts";
import { Value } from "./value.ts";

/** At most so many samples along a side are watched of the whole grid. */
const OVERVIEW = 256;
/** Columns along a side of the part that is watched column by column, where the whole is watched coarsely. */
const DETAIL = 128;
/** How often totals are asked for [ms]. */
const TOTALS = 1000;

/** A session, live. */
export class Model {
  readonly session: Session;
  readonly grid: Grid;
  /** The ground under the snow; null until it is known. */
  readonly ground: Value<Ground | null>;
  /** Settings, clock and totals. */
  readonly view: Value<SessionView>;
  readonly state = new Value<StreamState>({ name: "connecting" });
  readonly colliders = new Value<Collider[]>([]);
  /** Heights of the whole grid; coarse where it is large. A new change for each message. */
  readonly overview = new Value<Change | null>(null);
  /** Heights of every column around the middle of the picture, where the overview is coarse. */
  readonly detail = new Value<Change | null>(null);
  /** The ground under each column of a region: that of `detail`, or the one that `detail` is about to show. */
  readonly near = new Value<{ region: ColumnRegion; heights: Float32Array | null } | null>(null);
  private readonly stream: Stream;
  private readonly closely: Subscription | null = null;
  private nearRegion: ColumnRegion;
  private timer = 0;
  /** How often the ground was asked for: of several answers only the last counts. */
  private laid = 0;
  private ended = false;

  constructor(session: Session, view: SessionView) {
    this.session = session;
    this.grid = view.grid;
    this.view = new Value(view);
    this.ground = new Value(view.terrain ? null : new Ground(session, null));
    this.stream = session.stream({
      onState: (state) => this.state.set(state),
      onEvent: ({ event }) => (event === "terrain" || event === "reset" ? this.lay() : this.refresh()),
      onWelcome: () => this.lay(),
    });
    const stride = overviewStride(view.grid);
    this.stream.subscribe({ stride, colliders: true }, (change) => {
      if (change.colliders) this.colliders.set(change.colliders);
      this.overview.set(change);
    });
    this.nearRegion = around(view.grid, view.grid.width / 2, view.grid.depth / 2);
    if (stride > 1) {
      // Until all of a new region has come, the old one is shown.
      const show = (change: Change) => change.field.complete && this.detail.set(change);
      this.closely = this.stream.subscribe({ region: this.nearRegion }, show);
    }
  }

  /** Looks closely at the surroundings of a column. */
  lookAt(column_x: number, column_z: number): void {
    const { column_x: x, column_z: z, width, depth } = this.nearRegion;
    const far = Math.max(Math.abs(column_x - x - width / 2), Math.abs(column_z - z - depth / 2));
    const next = around(this.grid, column_x, column_z);
    if (!this.closely || far < DETAIL / 4 || (next.column_x === x && next.column_z === z)) return;
    this.nearRegion = next;
    this.closely.update(next);
    this.layNear().catch(() => this.layLater());
  }

  /** Asks for the totals, now and from then on. */
  async refresh(): Promise<void> {
    clearTimeout(this.timer);
    if (this.ended) return;
    const view = await this.session.get().catch(() => null);
    if (view) this.view.set(view);
    clearTimeout(this.timer);
    if (!this.ended) this.timer = window.setTimeout(() => this.refresh(), document.hidden ? 10 * TOTALS : TOTALS);
  }

  /** Asks for the ground, and the totals. */
  private async lay(): Promise<void> {
    const turn = ++this.laid;
    await this.refresh();
    const stride = overviewStride(this.grid);
    const terrain = this.view.get().terrain ? this.session.terrain({ stride }) : { heights: null };
    try {
      const ground = new Ground(this.session, (await terrain).heights);
      if (turn !== this.laid || this.ended) return;
      this.ground.set(ground);
      await this.layNear();
    } catch {
      if (turn === this.laid) this.layLater();
    }
  }

  /** Asks for the ground once more after it could not be had. */
  private layLater(): void {
    const turn = this.laid;
    window.setTimeout(() => turn === this.laid && !this.ended && this.lay(), TOTALS);
  }

  /** Asks for the ground under what is watched closely. */
  private async layNear(): Promise<void> {
    const [ground, region] = [this.ground.get(), this.nearRegion];
    if (!this.closely || !ground) return;
    const heights = await ground.under(region);
    if (ground === this.ground.get() && isSame(region, this.nearRegion)) this.near.set({ region, heights });
  }

  /** Tries to connect at once. */
  reconnect(): void {
    this.stream.retryNow();
  }

  close(): void {
    this.ended = true;
    clearTimeout(this.timer);
    this.stream.close();
  }
}

function overviewStride({ width, depth }: Grid): 1 | 2 | 4 | 8 {
  const fits = ([1, 2, 4, 8] as const).find((stride) => Math.max(width, depth) / stride <= OVERVIEW);
  return fits ?? 8;
}

/** The part of a grid that is watched closely, around a column; whole tiles. */
function around(grid: Grid, column_x: number, column_z: number): ColumnRegion {
  const first = (at: number, columns: number) =>
    Math.round(Math.max(0, Math.min(at - DETAIL / 2, columns - DETAIL)) / 8) * 8;
  const x = first(column_x, grid.width);
  const z = first(column_z, grid.depth);
  return { column_x: x, column_z: z, width: Math.min(DETAIL, grid.width - x), depth: Math.min(DETAIL, grid.depth - z) };
}
