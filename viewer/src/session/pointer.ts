// What fingers, mouse and keys do with the picture: open profiles, place, choose and drag objects, draw
// paths, press prints, turn the camera.

import type { Collider } from "firn-client";
import type { Look } from "./look.ts";
import type { Model } from "./model.ts";
import type { Mover } from "./mover.ts";
import type { Viewport } from "./viewport.ts";

/** Further than this [px] is a drag and no click. */
const CLICK = 5;
/** One press of an arrow key turns by so much [rad]. */
const TURN = 0.08;

/** What clicks on the snow do, by tool, and keys on the picture. */
export interface Tools {
  place(x: number, z: number): void;
  path(x: number, z: number): void;
  print(x: number, z: number): void;
  /** Sends the chosen object along the path. */
  go(): void;
  /** Forgets the path. */
  giveUp(): void;
}

/** Listens to the canvas. */
export function listen(viewport: Viewport, model: Model, look: Look, mover: Mover, tools: Tools): void {
  const { canvas, controls } = viewport.stage;
  let down: { x: number; y: number; pointer: number } | null = null;
  let drag: { collider: Collider; level: number; dx: number; dz: number } | null = null;

  const begin = (event: PointerEvent) => {
    if (!event.isPrimary || event.button !== 0) return;
    down = { x: event.clientX, y: event.clientY, pointer: event.pointerId };
    // A path that was begun goes past other objects, too.
    const draws = look.tool.get() === "path" && look.draft.get().length > 0;
    const hit = draws ? null : viewport.pick(event.clientX, event.clientY);
    const collider = hit?.body ? model.colliders.get().find(({ id }) => id === hit.body) : undefined;
    if (!hit || !collider) return;
    // The camera stays where it is while an object is dragged.
    event.stopImmediatePropagation();
    controls.enabled = false;
    canvas.setPointerCapture(event.pointerId);
    look.chosen.set(collider.id);
    const { x, z } = mover.where(collider);
    drag = { collider, level: hit.y, dx: x - hit.x, dz: z - hit.z };
  };
  const move = (event: PointerEvent) => {
    if (!drag || !isDrag(event)) return;
    const to = viewport.pickLevel(event.clientX, event.clientY, drag.level);
    if (to) mover.move(drag.collider, to.x + drag.dx, to.z + drag.dz, event.shiftKey);
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
    const tool = look.tool.get();
    // A path is for the object that is chosen already.
    if (!hit) return tool === "path" ? undefined : look.chosen.set(null);
    if (tool !== "profile") return tools[tool](hit.x, hit.z);
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
  canvas.addEventListener("keydown", (event) => {
    if (event.key === "Escape") tools.giveUp();
    else if (event.key === "Enter" && look.tool.get() === "path") tools.go();
    else turn(event, viewport);
  });
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
