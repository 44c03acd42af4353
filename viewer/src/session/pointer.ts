// What fingers, mouse and keys do with the picture: open profiles, place, choose and drag objects, turn the camera.

import type { Collider, ColliderPatch, Grid, Position } from "firn-client";
import type { Look } from "./look.ts";
import type { Model } from "./model.ts";
import type { Viewport } from "./viewport.ts";

/** Further than this [px] is a drag and no click. */
const CLICK = 5;
/** Between two moves of a dragged object there is at least this time [ms]. */
const MOVE_PAUSE = 40;
/** One press of an arrow key turns by so much [rad]. */
const TURN = 0.08;

/** A place for an object, to the millimetre: its centre stays within the grid, whatever hangs over. */
export function fitInto(grid: Grid, x: number, z: number): Position {
  const fit = (at: number, columns: number) =>
    Math.min(Math.max(Math.round(at * 1000), 0), Math.floor(columns * grid.cell_size * 1000 - 0.5)) / 1000;
  return { x: fit(x, grid.width), z: fit(z, grid.depth) };
}

/** Sends one change of an object at a time, always the newest. */
export class Mover {
  private readonly model: Model;
  private readonly report: (error: unknown) => void;
  private next: { id: string; patch: ColliderPatch } | null = null;
  private busy = false;

  constructor(model: Model, report: (error: unknown) => void) {
    this.model = model;
    this.report = report;
  }

  /** Moves an object, its centre kept within the grid. */
  move(collider: Collider, x: number, z: number): void {
    this.change(collider, { position: fitInto(this.model.grid, x, z) });
  }

  /** Changes something of an object: where it is, its heading, whether it is held up. */
  change({ id }: Collider, change: ColliderPatch): void {
    // What does not change is left out: what is known of it here may be old.
    const waiting = this.next?.id === id ? this.next.patch : {};
    this.next = { id, patch: { ...waiting, ...change } };
    if (!this.busy) this.send();
  }

  private async send(): Promise<void> {
    this.busy = true;
    while (this.next) {
      const { id, patch } = this.next;
      this.next = null;
      const pause = new Promise((resolve) => setTimeout(resolve, MOVE_PAUSE));
      await this.model.session.patchCollider(id, patch).catch(this.report);
      await pause;
    }
    this.busy = false;
  }
}

/** Listens to the canvas. `place` puts a new object somewhere [m]. */
export function listen(
  viewport: Viewport,
  model: Model,
  look: Look,
  mover: Mover,
  place: (x: number, z: number) => void,
): void {
  const { canvas, controls } = viewport.stage;
  let down: { x: number; y: number; pointer: number } | null = null;
  let drag: { collider: Collider; level: number; dx: number; dz: number } | null = null;

  const begin = (event: PointerEvent) => {
    if (!event.isPrimary || event.button !== 0) return;
    down = { x: event.clientX, y: event.clientY, pointer: event.pointerId };
    const hit = viewport.pick(event.clientX, event.clientY);
    const collider = hit?.body ? model.colliders.get().find(({ id }) => id === hit.body) : undefined;
    if (!hit || !collider) return;
    // The camera stays where it is while an object is dragged.
    event.stopImmediatePropagation();
    controls.enabled = false;
    canvas.setPointerCapture(event.pointerId);
    look.chosen.set(collider.id);
    drag = { collider, level: hit.y, dx: collider.position.x - hit.x, dz: collider.position.z - hit.z };
  };
  const move = (event: PointerEvent) => {
    if (!drag || !isDrag(event)) return;
    const to = viewport.pickLevel(event.clientX, event.clientY, drag.level);
    if (to) mover.move(drag.collider, to.x + drag.dx, to.z + drag.dz);
  };
  const end = (event: PointerEvent) => {
    const clicked = down !== null && !drag && event.type === "pointerup" && !isDrag(event);
    drag = null;
    down = null;
    controls.enabled = true;
    if (clicked) click(event);
  };
  const isDrag = (event: PointerEvent) =>
    down !== null && Math.hypot(event.clientX - down.x, event.clientY - down.y) > CLICK;
  const click = (event: PointerEvent) => {
    const hit = viewport.pick(event.clientX, event.clientY, false);
    if (!hit) return look.chosen.set(null);
    if (look.tool.get() === "place") return place(hit.x, hit.z);
    const { cell_size, width, depth } = model.grid;
    const index = (at: number, count: number) => Math.min(Math.max(Math.floor(at / cell_size), 0), count - 1);
    look.chosen.set(null);
    look.column.set({ column_x: index(hit.x, width), column_z: index(hit.z, depth) });
  };

  // Before the camera's own listeners.
  canvas.addEventListener("pointerdown", begin, { capture: true });
  canvas.addEventListener("pointermove", move);
  canvas.addEventListener("pointerup", end);
  canvas.addEventListener("pointercancel", end);
  canvas.addEventListener("keydown", (event) => turn(event, viewport));
}

function turn(event: KeyboardEvent, { stage }: Viewport): void {
  const turns: Record<string, [number, number, number]> = {
    ArrowLeft: [-TURN, 0, 1],
    ArrowRight: [TURN, 0, 1],
    ArrowUp: [0, -TURN, 1],
    ArrowDown: [0, TURN, 1],
    "+": [0, 0, 0.9],
    "-": [0, 0, 1.1],
  };
  const by = turns[event.key];
  if (!by) return;
  event.preventDefault();
  stage.turn(...by);
}
