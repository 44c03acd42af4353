// How the snow is shown.

import { choice, h } from "../../dom.ts";
import { type FieldName, fields } from "../../fields.ts";
import type { Cut } from "../look.ts";
import { type Desk, section } from "./panel.ts";

const colours = Object.entries(fields) as [FieldName, (typeof fields)[FieldName]][];

/** The section. */
export function lookSection({ look }: Desk): HTMLElement {
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
    { name: "colour", change: () => look.colour.set(colour.value as FieldName | "white") },
    h("option", { value: "white" }, "White"),
    ...colours.map(([name, field]) => h("option", { value: name }, field.name)),
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
