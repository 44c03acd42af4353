// The choice of the ground that a new session lies on.

import { h, numberField } from "../dom.ts";
import { hills } from "./hills.ts";
import { imageFields, type Lay, type Size } from "./image.ts";

/** The choice. */
export interface TerrainChoice {
  element: HTMLElement;
  /** Takes notice of another size of the grid. */
  check(): void;
  /** What lays the ground that was chosen; null for level ground. Throws where something is missing. */
  read(): Lay | null;
}

/** The fields. `size` is the grid's as it is entered; `follow` enters another. */
export function terrainChoice(size: () => Size, follow: (size: Size) => void): TerrainChoice {
  const [reliefField, relief] = numberField("Relief", "m", { value: 3, min: 0.1, max: 40_000, required: true });
  const [seedField, seed] = numberField("Seed", "", { value: 1, min: 0, max: 2 ** 31 - 1, step: 1, required: true });
  const image = imageFields(size, follow);
  const parts = {
    flat: h("fieldset", {}),
    hills: h(
      "fieldset",
      { class: "section" },
      h("div", { class: "pairs" }, reliefField, seedField),
      h("p", { class: "hint" }, "From 0 m up to the relief. Another seed makes other hills."),
    ),
    image: h("fieldset", { class: "section" }, ...image.elements),
  };
  const kind = h(
    "select",
    { name: "terrain", change: () => show() },
    h("option", { value: "flat" }, "Flat"),
    h("option", { value: "hills" }, "Hills"),
    h("option", { value: "image" }, "A PNG"),
  );
  const chosen = () => kind.value as keyof typeof parts;
  const show = () => {
    for (const [name, part] of Object.entries(parts)) {
      part.hidden = name !== chosen();
      // What is out of sight is not asked for.
      part.disabled = part.hidden;
    }
  };
  show();
  const read = (): Lay | null => {
    if (chosen() === "flat") return null;
    if (chosen() === "image") return image.read();
    const { width, depth } = size();
    const [metres, lot] = [relief.valueAsNumber, seed.valueAsNumber];
    return (session) => session.putTerrain(hills(width, depth, metres, lot));
  };
  const label = h("label", { class: "field wide" }, h("span", {}, "Terrain"), kind);
  const element = h("div", { class: "section" }, label, parts.hills, parts.image);
  return { element, check: image.check, read };
}
