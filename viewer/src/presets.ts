// What each preset fills in; docs/model.md has the same, and where the values come from.

import type { Material, Preset, Pressing } from "firn-client";

/** A kind of snow. */
export interface Snow extends Pick<Material, "fresh_density" | "max_density" | "hardness_law" | "grain_size_mm"> {
  name: string;
  pressing: Pressing;
  air_temperature: number;
}

/** Every preset, by the name that the API knows it by; the first is the default. */
export const presets: Record<Preset, Snow> = {
  thesis: { ...snow("As in the thesis", 20, 100, -3), pressing: "creep" },
  powder: snow("Powder", 30, 300, -10),
  packed: snow("Packed", 400, 600, -5),
  wet: snow("Wet", 100, 600, 0),
  game: { ...snow("For games", 60, 450, -3), hardness_law: "gold", grain_size_mm: 10 },
};

function snow(name: string, fresh_density: number, max_density: number, air_temperature: number): Snow {
  const law = { hardness_law: "calibrated", grain_size_mm: 0.5 } as const;
  return { name, fresh_density, max_density, ...law, air_temperature, pressing: 0.25 };
}

/** The values of its material, and how it gives way under objects, in a line. */
export function describe({ fresh_density, max_density, hardness_law, grain_size_mm, pressing }: Snow): string {
  const grains = hardness_law === "gold" ? `, grains of ${grain_size_mm} mm` : "";
  const way = pressing === "creep" ? "creeps under objects" : `pressed by objects in ${pressing} s`;
  return `${fresh_density} to ${max_density} kg/m³, hardness law ${hardness_law}${grains}, ${way}`;
}
