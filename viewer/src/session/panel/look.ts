// How the snow is shown.

import { choice, h } from "../../dom.ts";
import { type Colour, columnFields, type Field, fields } from "../../fields.ts";
import { isAlpine } from "../../physics.ts";
import type { Cut } from "../look.ts";
import { type Desk, section } from "./panel.ts";

/** The section. */
export function lookSection({ look, model }: Desk): HTMLElement {
  const shape = choice(
    "Shape",
    [
      ["surface", "Surface"],
      ["cells", "Cells"],
    ],
    look.shape.get(),
    (shape) => look.shape.set(shape),
  );
  const colour = h(
    "select",
    { name: "colour", change: () => look.colour.set(colour.value as Colour) },
    h("option", { value: "white" }, "White"),
    ...options(fields),
    ...(isAlpine(model.view.get()) ? [h("optgroup", { label: "Of whole columns" }, ...options(columnFields))] : []),
  );

  const axis = h(
    "select",
    { name: "cut", change: () => cut() },
    h("option", { value: "" }, "None"),
    h("option", { value: "x" }, "Along x"),
    h("option", { value: "z" }, "Along z"),
    h("option", { value: "y" }, "Level"),
  );
  const at = h("input", {
    type: "range",
    min: 0,
    max: 1,
    step: 0.01,
    value: 0.5,
    "aria-label": "Place of the cut",
    input: () => cut(),
  });
  const cut = () => {
    look.cut.set(axis.value === "" ? null : { axis: axis.value as Cut["axis"], at: at.valueAsNumber });
    at.disabled = axis.value === "";
    // Only cells have an inside.
    if (axis.value !== "") shape.querySelector<HTMLInputElement>("[value=cells]")?.click();
  };
  at.disabled = true;

  const colliders = h("input", {
    type: "checkbox",
    name: "show-colliders",
    checked: true,
    change: () => look.colliders.set(colliders.checked),
  });
  return section(
    "View",
    shape,
    h("label", { class: "field wide" }, h("span", {}, "Colour"), colour),
    h("label", { class: "field wide" }, h("span", {}, "Cut"), axis),
    at,
    h("label", { class: "check" }, colliders, "Show objects"),
  );
}

function options(fields: Record<string, Field>): HTMLOptionElement[] {
  return Object.entries(fields).map(([name, { name: text }]) => h("option", { value: name }, text));
}
