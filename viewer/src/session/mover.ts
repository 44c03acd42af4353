// Changes of objects on their way to the server.

import type { Collider, ColliderPatch, Grid, Position } from "firn-client";
import { destination } from "../scene/motion.ts";
import type { Look } from "./look.ts";
import type { Model } from "./model.ts";

/** Between two changes of an object there is at least this time [ms]. */
const PAUSE = 40;

/** A place for an object, to the millimetre: its centre stays within the grid, whatever hangs over. */
export function fitInto(grid: Grid, x: number, z: number): Position {
  const fit = (at: number, columns: number) =>
    Math.min(Math.max(Math.round(at * 1000), 0), Math.floor(columns * grid.cell_size * 1000 - 0.5)) / 1000;
  return { x: fit(x, grid.width), z: fit(z, grid.depth) };
}

/** Sends one change at a time, of each object always the newest. */
export class Mover {
  private readonly model: Model;
  private readonly look: Look;
  private readonly report: (error: unknown) => void;
  private readonly waiting = new Map<string, { id: string; patch: ColliderPatch }>();
  /** Where objects were moved to, and the state that has them there, as soon as it is known. */
  private readonly moved = new Map<string, { position: Position; seq: number }>();
  private busy = false;

  constructor(model: Model, look: Look, report: (error: unknown) => void) {
    this.model = model;
    this.look = look;
    this.report = report;
  }

  /** Where an object is or is going: as this page has moved it, until the stream tells of that. */
  where(collider: Collider): Position {
    const moved = this.moved.get(collider.id);
    const told = this.model.overview.get()?.seq ?? 0;
    return moved && moved.seq > told ? moved.position : destination(collider);
  }

  /** Moves an object, its centre kept within the grid. It leaves a track unless it is lifted. */
  move(collider: Collider, x: number, z: number, lift: boolean): void {
    const position = fitInto(this.model.grid, x, z);
    this.moved.set(collider.id, { position, seq: Number.POSITIVE_INFINITY });
    this.change(collider, lift || this.look.lift.get() ? { position } : { position, sweep: true });
  }

  /** Changes something of an object: where it is, its heading, how it moves, whether it is held up. */
  change({ id }: Collider, change: ColliderPatch): void {
    // A sweep takes a heading along to its end, so other changes stay apart from it.
    const key = `${change.sweep ? "sweep" : "change"} ${id}`;
    // What does not change is left out: what is known of it here may be old.
    this.waiting.set(key, { id, patch: { ...this.waiting.get(key)?.patch, ...change } });
    if (!this.busy) this.send();
  }

  private async send(): Promise<void> {
    this.busy = true;
    for (const [key, { id, patch }] of this.waiting) {
      this.waiting.delete(key);
      const pause = new Promise((resolve) => setTimeout(resolve, PAUSE));
      await this.ask(id, patch);
      await pause;
    }
    this.busy = false;
  }

  private async ask(id: string, patch: ColliderPatch): Promise<void> {
    const seq = await this.model.session.patchCollider(id, patch).then(({ seq }) => seq, this.report);
    const moved = this.moved.get(id);
    // What failed is where the stream says it is.
    if (moved && moved.position === patch.position) moved.seq = seq ?? 0;
  }
}
