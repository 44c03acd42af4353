// The objects on the snow: put, choose, move, remove.

import type { Collider, Shape } from "firn-client";
import { action, choice, h, numberField } from "../../dom.ts";
import { decimal, mass as massText, quantity } from "../../format.ts";
import type { Tool } from "../look.ts";
import { fitInto } from "../pointer.ts";
import { type Desk, section, setting } from "./panel.ts";

/** More objects than these are not listed. */
const MOST = 50;

/** The section, and what puts an object somewhere [m]. */
export function objectsSection(desk: Desk): { element: HTMLElement; place: (x: number, z: number) => void } {
  const { model, look, viewport, report, say } = desk;
  const form = shapeForm();
  const place = async (x: number, z: number) => {
    const { mass, shape } = form.read();
    const put = await model.session.putCollider({ mass, shape, position: fitInto(model.grid, shape, x, z) });
    look.chosen.set(put.id);
    say("It stands on the snow.");
  };
  const middle = () => {
    const { width, depth, cell_size } = model.grid;
    const { x, z } = viewport?.middle() ?? { x: (width * cell_size) / 2, z: (depth * cell_size) / 2 };
    return place(x, z);
  };
  const tools = [
    ["profile", "Click: profile"],
    ["place", "Click: put"],
  ] as const;
  const list = h("ul", { class: "objects" });
  const more = h("p", { class: "hint" });
  const show = () => {
    const colliders = model.colliders.get();
    list.hidden = colliders.length === 0;
    showList(list, colliders.slice(0, MOST), desk);
    more.textContent = colliders.length > MOST ? `and ${colliders.length - MOST} more` : "";
  };
  model.colliders.watch(show);
  look.chosen.watch(show);
  const element = section(
    "Objects",
    pressingFields(desk),
    form.element,
    h("div", { class: "buttons" }, action("Put in the middle", { class: "primary" }, middle, report)),
    viewport ? choice<Tool>("What a click does", tools, look.tool.get(), (tool) => look.tool.set(tool)) : null,
    list,
    more,
  );
  return { element, place: (x, z) => void place(x, z).catch(report) };
}

/** How snow gives way under objects. */
function pressingFields(desk: Desk): HTMLElement {
  const { session, view } = desk.model;
  const [secondsField, seconds] = numberField("Pressed in", "s", { min: 0, max: 10 });
  const showSeconds = setting(seconds, desk, (pressing) => session.patch({ pressing }));
  const change = () => session.patch({ pressing: creeps.checked ? "creep" : 0.25 }).catch(desk.report);
  const creeps = h("input", { type: "checkbox", change: () => void change() });
  view.watch(({ pressing }) => {
    creeps.checked = pressing === "creep";
    secondsField.hidden = creeps.checked;
    if (typeof pressing === "number") showSeconds(pressing);
  });
  return h("div", {}, h("label", { class: "check" }, creeps, "Snow creeps under them"), secondsField);
}

function shapeForm(): { element: HTMLElement; read: () => { mass: number; shape: Shape } } {
  const [massField, mass] = numberField("Mass", "kg", { value: 100, min: 0.001, max: 1e9 });
  const [widthField, width] = numberField("Width", "m", { value: 1, min: 0.01 });
  const [depthField, depth] = numberField("Depth", "m", { value: 1, min: 0.01 });
  const [radiusField, radius] = numberField("Radius", "m", { value: 0.5, min: 0.01 });
  let type: Shape["type"] = "box";
  const choose = (chosen: Shape["type"]) => {
    type = chosen;
    widthField.hidden = type !== "box";
    depthField.hidden = type !== "box";
    radiusField.hidden = type !== "disk";
  };
  choose("box");
  const types = [
    ["box", "Box"],
    ["disk", "Disk"],
  ] as const;
  const element = h(
    "div",
    { class: "section" },
    choice("Shape of the object", types, "box", choose),
    massField,
    widthField,
    depthField,
    radiusField,
  );
  const read = () => {
    const box: Shape = { type: "box", width: width.valueAsNumber, depth: depth.valueAsNumber };
    const shape: Shape = type === "box" ? box : { type, radius: radius.valueAsNumber };
    return { mass: mass.valueAsNumber, shape };
  };
  return { element, read };
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
    const { sink_depth, pressure, resting, mass } = collider;
    const facts = `${massText(mass)} · ${quantity(pressure, "Pa")} · ${decimal(sink_depth, 2)} m deep`;
    (row.querySelector("small") as HTMLElement).textContent = resting ? `${facts}, at rest` : facts;
    row.dataset["sink"] = String(sink_depth);
  }
  for (const gone of rows.values()) gone.remove();
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
    const way = ways[event.key];
    const collider = model.colliders.get().find((collider) => collider.id === id);
    if (event.key === "Delete") void remove();
    if (!way || !collider) return;
    event.preventDefault();
    look.chosen.set(id);
    mover.move(collider, collider.position.x + way[0], collider.position.z + way[1]);
  };
  const choose = () => look.chosen.set(look.chosen.get() === id ? null : id);
  const title = "Arrow keys move it, Delete removes it";
  return h(
    "li",
    { "data-id": id },
    h(
      "button",
      { type: "button", class: "quiet pick", title, click: choose, keydown: keys },
      h("strong", {}, id),
      h("small", {}),
    ),
    h("button", { type: "button", class: "quiet", "aria-label": `Remove ${id}`, click: remove }, "×"),
  );
}
