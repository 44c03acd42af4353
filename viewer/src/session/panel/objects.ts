// The objects on the snow: put, choose, move, turn, hold up, remove.

import { action, choice, h, numberField } from "../../dom.ts";
import { freeName } from "../kinds.ts";
import type { Tool } from "../look.ts";
import { fitInto } from "../pointer.ts";
import { objectForm } from "./object-form.ts";
import { objectList } from "./object-list.ts";
import { type Desk, section, setting } from "./panel.ts";

/** The section, and what puts an object somewhere [m]. */
export function objectsSection(desk: Desk): { element: HTMLElement; place: (x: number, z: number) => void } {
  const { model, look, viewport, report, say } = desk;
  const form = objectForm();
  // The stream tells of new objects a moment later, so those of this page are remembered.
  const named = new Set<string>();
  const place = async (x: number, z: number) => {
    const wanted = form.read();
    if (!wanted) return;
    const { kind, name, ...object } = wanted;
    const id = name || freeName(kind, new Set([...named, ...model.colliders.get().map(({ id }) => id)]));
    named.add(id);
    await model.session.putCollider({ id, ...object, position: fitInto(model.grid, x, z) });
    form.forgetName();
    look.chosen.set(id);
    say(`${id} stands on the snow.`);
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
  const element = section(
    "Objects",
    pressingFields(desk),
    form.element,
    h("div", { class: "buttons" }, action("Put in the middle", { class: "primary" }, middle, report)),
    viewport ? choice<Tool>("What a click does", tools, look.tool.get(), (tool) => look.tool.set(tool)) : null,
    ...objectList(desk),
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
