// What the next object is: its kind, sizes, mass, heading and name.

import type { ColliderSpec } from "firn-client";
import { h, numberField } from "../../dom.ts";
import { type Kind, kinds, type Size } from "../kinds.ts";

/** What was filled in. The name is empty where the page may choose one. */
type Wanted = Omit<ColliderSpec, "id" | "position"> & { kind: Kind; name: string };

/** The form; it reads as null where a field is not as it has to be, which the browser then tells. */
export function objectForm(): { element: HTMLElement; read: () => Wanted | null; forgetName: () => void } {
  const kind = h(
    "select",
    { name: "kind", change: () => choose() },
    ...Object.entries(kinds).map(([value, { name }]) => h("option", { value }, name)),
  );
  const sizes: Record<Size, [HTMLLabelElement, HTMLInputElement]> = {
    width: numberField("Width", "m", { value: 1, min: 0.01 }),
    depth: numberField("Depth", "m", { value: 1, min: 0.01 }),
    length: numberField("Length", "m", { value: 1.5, min: 0.01 }),
    radius: numberField("Radius", "m", { value: 0.5, min: 0.01 }),
  };
  const [massField, mass] = numberField("Mass", "kg", { min: 0.001, max: 1e9 });
  const [headingField, heading] = numberField("Heading", "°", { value: 0, min: -360, max: 360 });
  const name = h("input", { name: "object-name", pattern: "[A-Za-z0-9_\\-]{1,64}", autocomplete: "off" });

  const chosen = () => kind.value as Kind;
  const choose = () => {
    const { sizes: asked, mass: usual } = kinds[chosen()];
    for (const [size, [field]] of Object.entries(sizes)) field.hidden = !(asked as readonly string[]).includes(size);
    mass.value = String(usual);
    name.placeholder = `${chosen()}-…`;
  };
  choose();

  const size = (of: Size) => sizes[of][1];
  const read = () => {
    const { sizes: asked, make } = kinds[chosen()];
    if (![...asked.map(size), mass, heading, name].every((input) => input.reportValidity())) return null;
    const [width, depth] = [size("width").valueAsNumber, size("depth").valueAsNumber];
    const [length, radius] = [size("length").valueAsNumber, size("radius").valueAsNumber];
    const standing = make({ width, depth, length, radius });
    const degrees = heading.valueAsNumber || 0;
    return { kind: chosen(), name: name.value, mass: mass.valueAsNumber, heading: degrees, ...standing };
  };
  const element = h(
    "div",
    { class: "section" },
    h("label", { class: "field wide" }, h("span", {}, "Kind"), kind),
    ...Object.values(sizes).map(([field]) => field),
    massField,
    headingField,
    h("label", { class: "field wide" }, h("span", {}, "Name"), name),
  );
  const forgetName = () => {
    name.value = "";
  };
  return { element, read, forgetName };
}
