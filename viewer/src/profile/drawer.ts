// The drawer with the profile of the column that was chosen.

import type { AlpineColumn, Column } from "firn-client";
import { h } from "../dom.ts";
import { decimal, quantity } from "../format.ts";
import { isAlpine } from "../physics.ts";
import type { ColumnPlace, Look } from "../session/look.ts";
import type { Model } from "../session/model.ts";
import { pit } from "./pit.ts";

/** The profile follows the snow, but no faster than this [ms]. */
const REFRESH = 500;

/** The drawer; hidden where no column is chosen. */
export function profileDrawer(model: Model, look: Look, report: (error: unknown) => void): HTMLElement {
  const title = h("h2", { id: "profile-title" });
  const body = h("div", {});
  const close = h(
    "button",
    { type: "button", class: "quiet", "aria-label": "Close the profile", click: () => look.column.set(null) },
    "×",
  );
  const element = h(
    "section",
    { class: "profile", "aria-labelledby": "profile-title", hidden: true },
    h("header", {}, title, close),
    body,
  );
  let busy = false;

  const refresh = async (): Promise<void> => {
    const place = look.column.get();
    if (!place || busy) return;
    busy = true;
    try {
      const column = await model.session.column(place.column_x, place.column_z);
      if (look.column.get() === place) show(body, column);
    } catch (error) {
      report(error);
    }
    setTimeout(() => {
      busy = false;
      if (look.column.get() !== place || model.overview.get() !== drawn) refresh();
      drawn = model.overview.get();
    }, REFRESH);
  };
  let drawn = model.overview.get();
  element.addEventListener("keydown", ({ key }) => key === "Escape" && look.column.set(null));
  look.column.watch((place) => {
    element.hidden = place === null;
    if (place) title.textContent = heading(place, model);
    refresh();
  });
  model.overview.watch(() => refresh());
  // The weather changes alpine snow also where its heights stay.
  let tick = 0;
  model.view.watch((view) => {
    if (isAlpine(view) && view.tick !== tick) refresh();
    tick = view.tick;
  });
  return element;
}

function heading({ column_x, column_z }: ColumnPlace, { grid }: Model): string {
  const metres = (column: number) => decimal((column + 0.5) * grid.cell_size, 1);
  return `Profile at ${metres(column_x)} m, ${metres(column_z)} m`;
}

function show(body: HTMLElement, column: Column): void {
  const weak = column.weak_layers.map(({ bottom, thickness, density, contrast }) =>
    h(
      "li",
      {},
      `${decimal(bottom, 2)}–${decimal(bottom + thickness, 2)} m: ${decimal(density, 0)} kg/m³, ${decimal(contrast * 100, 0)} % less dense than around`,
    ),
  );
  const totals = `${decimal(column.height, 2)} m, ${quantity(column.mean_density, "kg/m³")} on average, ${column.layers.length} cells`;
  body.replaceChildren(
    h("p", { class: "hint" }, totals),
    facts(column),
    column.layers.length > 0 ? pit(column) : h("p", {}, "No snow here."),
    ...(weak.length > 0 ? [h("h3", {}, "Weak layers"), h("ul", { class: "weak-layers" }, ...weak)] : []),
  );
}

/** What is told of a column of alpine snow; nothing is of others. */
function facts(column: Partial<AlpineColumn>): HTMLElement {
  const { snow_water_equivalent: water, skin_temperature: skin, albedo, runoff } = column;
  const rows: [string, number | undefined, (value: number) => string][] = [
    ["Snow water equivalent", water, (value) => quantity(value, "kg/m²")],
    ["Skin temperature", skin, (value) => `${decimal(value, 1)} °C`],
    ["Albedo", albedo, (value) => decimal(value, 2)],
    ["Run off so far", runoff, (value) => quantity(value, "kg/m²")],
  ];
  const told = rows.flatMap(([label, value, text]) =>
    typeof value === "number" ? [h("dt", {}, label), h("dd", {}, text(value))] : [],
  );
  return h("dl", { class: "answers" }, ...told);
}
