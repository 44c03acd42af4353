// A path for the chosen object: points on the snow, and the time that it takes.

import { action, h, numberField } from "../../dom.ts";
import { decimal } from "../../format.ts";
import { destination } from "../../scene/motion.ts";
import { lengthOf } from "../../scene/ways.ts";
import { fitInto } from "../mover.ts";
import type { Desk } from "./panel.ts";
import { pointForm } from "./point.ts";

/** The controls, and what adds a point [m], sends the object off, and forgets the path. */
export function pathTool(desk: Desk): {
  element: HTMLElement;
  add: (x: number, z: number) => void;
  go: () => void;
  giveUp: () => void;
} {
  const { model, look, report, say } = desk;
  const [overField, over] = numberField("Takes", "s", { value: 10, min: 0.01, max: 86_400 });
  const told = h("p", { class: "hint", role: "status" });
  const chosen = () => model.colliders.get().find(({ id }) => id === look.chosen.get());

  const add = (x: number, z: number) => {
    const to = fitInto(model.grid, x, z);
    look.draft.set([...look.draft.get(), [to.x, to.z]]);
  };
  const giveUp = () => {
    if (look.draft.get().length > 0) look.draft.set([]);
  };
  const send = async () => {
    const [object, draft] = [chosen(), look.draft.get()];
    if (!object) return say("Choose an object first.");
    if (draft.length === 0) return say("Click where it should go first.");
    if (!over.reportValidity()) return;
    await model.session.patchCollider(object.id, { path: draft.map((point) => [...point]), over: over.valueAsNumber });
    giveUp();
    say(`${object.id} ${model.view.get().paused ? "goes as soon as the clock runs" : "is on its way"}.`);
  };
  const go = () => void send().catch(report);

  const show = () => {
    const [object, draft] = [chosen(), look.draft.get()];
    const from = object && destination(object);
    const length = lengthOf(from ? [[from.x, from.z], ...draft] : draft);
    const points = draft.length === 1 ? "1 point" : `${draft.length} points`;
    const path = draft.length > 0 ? `${points}, ${decimal(length, 1)} m` : "Click where it should go.";
    // What is told once more is not read out once more.
    const text = object ? `${object.id}: ${path}` : "Choose an object first.";
    if (told.textContent !== text) told.textContent = text;
  };
  look.draft.watch(show);
  look.chosen.watch(show);
  model.colliders.watch(() => look.tool.get() === "path" && show());

  const keys = (event: KeyboardEvent) => {
    if (event.key === "Escape") giveUp();
    else if (event.key === "Enter" && event.target === over) go();
  };
  const stop = h("button", { type: "button", click: giveUp }, "Give up");
  const element = h(
    "div",
    { class: "section", keydown: keys },
    told,
    pointForm("To", "Add the point", desk, add),
    overField,
    h("div", { class: "buttons" }, action("Go", { class: "primary" }, send, report), stop),
    h("p", { class: "hint" }, "On the picture Enter goes and Escape gives up."),
  );
  return { element, add, go, giveUp };
}
