// The objects that there are. The one that is chosen has controls of its own.

import type { Collider } from "firn-client";
import { h } from "../../dom.ts";
import { decimal, mass as massText, quantity } from "../../format.ts";
import { speedOf } from "../../scene/motion.ts";
import { describe } from "../kinds.ts";
import { bearing, objectControls } from "./object-controls.ts";
import type { Desk } from "./panel.ts";

/** More objects than these are not listed. */
const MOST = 50;
/** A key turns by so much [°]. */
const TURN = 15;

/** The list, and how many more there are. */
export function objectList(desk: Desk): HTMLElement[] {
  const { model, look } = desk;
  const list = h("ul", { class: "objects" });
  const more = h("p", { class: "hint" });
  const controls = objectControls(desk);
  const show = () => {
    const colliders = model.colliders.get();
    list.hidden = colliders.length === 0;
    showList(list, colliders.slice(0, MOST), desk);
    more.textContent = colliders.length > MOST ? `and ${colliders.length - MOST} more` : "";
    const chosen = colliders.find(({ id }) => id === look.chosen.get());
    const row = list.querySelector("li.chosen");
    if (chosen) controls.show(chosen);
    if (!row) controls.element.remove();
    else if (controls.element.parentElement !== row) row.append(controls.element);
  };
  model.colliders.watch(show);
  look.chosen.watch(show);
  return [list, more];
}

/** Rows that stay keep the focus. */
function showList(list: HTMLUListElement, colliders: readonly Collider[], desk: Desk): void {
  const rows = new Map([...list.children].map((row) => [(row as HTMLElement).dataset["id"], row as HTMLElement]));
  for (const collider of colliders) {
    const row = rows.get(collider.id) ?? list.appendChild(objectRow(collider.id, desk));
    rows.delete(collider.id);
    const chosen = collider.id === desk.look.chosen.get();
    row.classList.toggle("chosen", chosen);
    const pick = row.querySelector("button") as HTMLButtonElement;
    pick.setAttribute("aria-pressed", String(chosen));
    const [what, how] = pick.querySelectorAll("small");
    (what as HTMLElement).textContent = `${describe(collider)}, ${massText(collider.mass)}`;
    (how as HTMLElement).textContent = stands(collider);
    row.dataset["sink"] = String(collider.sink_depth);
  }
  for (const gone of rows.values()) gone.remove();
}

function stands(collider: Collider): string {
  const { airborne, pressure, sink_depth, resting } = collider;
  const speed = speedOf(collider);
  const how = collider.path?.length ? "on its path" : "moving";
  const moves = speed > 0 ? `, ${how} at ${decimal(speed, 2)} m/s` : collider.turn_rate ? ", turning" : "";
  if (airborne) return `held up${moves}`;
  const facts = `${quantity(pressure, "Pa")} · ${decimal(sink_depth, 2)} m deep`;
  return `${facts}${moves || (resting ? ", at rest" : "")}`;
}

function objectRow(id: string, { model, look, mover, report }: Desk): HTMLElement {
  const remove = () => model.session.deleteCollider(id).catch(report);
  const keys = (event: KeyboardEvent) => {
    const step = model.grid.cell_size;
    const ways: Record<string, [number, number]> = {
      ArrowLeft: [-step, 0],
      ArrowRight: [step, 0],
      ArrowUp: [0, -step],
      ArrowDown: [0, step],
    };
    const turns: Record<string, number> = { r: TURN, R: -TURN };
    const [way, turn] = [ways[event.key], turns[event.key]];
    const collider = model.colliders.get().find((collider) => collider.id === id);
    if (event.key === "Delete") void remove();
    // What the browser does with Ctrl and a letter stays its own.
    if (!(way || turn) || !collider || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    look.chosen.set(id);
    const { x, z } = mover.where(collider);
    if (way) mover.move(collider, x + way[0], z + way[1], event.shiftKey);
    if (turn) mover.change(collider, { heading: bearing(collider.heading + turn) });
  };
  const choose = () => look.chosen.set(look.chosen.get() === id ? null : id);
  const title = "Arrow keys move it, with Shift they lift it; R and Shift+R turn it, Delete removes it";
  return h(
    "li",
    { "data-id": id },
    h(
      "button",
      { type: "button", class: "quiet pick", title, click: choose, keydown: keys },
      h("strong", {}, id),
      h("small", {}),
      h("small", {}),
    ),
    h("button", { type: "button", class: "quiet", "aria-label": `Remove ${id}`, click: remove }, "×"),
  );
}
