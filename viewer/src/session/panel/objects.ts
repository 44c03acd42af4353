// The objects on the snow: put, choose, move, turn, hold up, remove; the paths that they follow, and prints.

import { action, choice, h, numberField } from "../../dom.ts";
import { isAlpine } from "../../physics.ts";
import { freeName } from "../kinds.ts";
import type { Tool } from "../look.ts";
import { fitInto } from "../mover.ts";
import type { Tools } from "../pointer.ts";
import { objectForm } from "./object-form.ts";
import { objectList } from "./object-list.ts";
import { type Desk, section, setting } from "./panel.ts";
import { pathTool } from "./path.ts";
import { printTool } from "./print.ts";

/** What a click on the snow does. */
const tools = [
  ["profile", "Profile"],
  ["place", "Put"],
  ["path", "Path"],
  ["print", "Print"],
] as const;

/** The section, and what its tools do on the picture. */
export function objectsSection(desk: Desk): { element: HTMLElement; tools: Tools } {
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
  const [path, print] = [pathTool(desk), printTool(desk)];
  look.tool.watch((tool) => {
    path.element.hidden = tool !== "path";
    print.element.hidden = tool !== "print";
    if (tool !== "path") path.giveUp();
  });
  const lift = h("input", { type: "checkbox", name: "lift", change: () => look.lift.set(lift.checked) });
  const element = section(
    "Objects",
    pressingFields(desk),
    form.element,
    h("div", { class: "buttons" }, action("Put in the middle", { class: "primary" }, middle, report)),
    h("p", { class: "hint", "aria-hidden": "true" }, "What a click on the snow does"),
    choice<Tool>("What a click on the snow does", tools, look.tool.get(), (tool) => look.tool.set(tool)),
    path.element,
    print.element,
    h("label", { class: "check" }, lift, "Lift objects when they are moved"),
    h("p", { class: "hint" }, "Otherwise they leave a track. With Shift they are lifted, too."),
    ...objectList(desk),
  );
  const { add, go, giveUp } = path;
  return {
    element,
    tools: { place: (x, z) => void place(x, z).catch(report), path: add, print: print.press, go, giveUp },
  };
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
  const creeping = h("label", { class: "check", hidden: isAlpine(view.get()) }, creeps, "Snow creeps under them");
  return h("div", {}, creeping, secondsField);
}
