// Reading the snow in numbers, and as a picture.

import { send } from "firn-client";
import { action, h, numberField } from "../../dom.ts";
import { cellField } from "../../fields.ts";
import { decimal, mass as massText } from "../../format.ts";
import { type Desk, section } from "./panel.ts";

/** What the ledger is told of; the later ones only alpine snow has. */
const entries = [
  ["present", "Present"],
  ["fallen", "Fallen"],
  ["refused", "Refused"],
  ["cleared", "Cleared"],
  ["rained", "Rained"],
  ["deposited", "Hoar"],
  ["sublimated", "Sublimated"],
  ["runoff", "Run off"],
] as const;

/** The section. */
export function measureSection({ model, look, viewport, report }: Desk): HTMLElement {
  const { session, grid } = model;
  const size = (columns: number) => columns * grid.cell_size;
  const [xField, x] = numberField("x", "m", { value: decimal(size(grid.width) / 2, 1), min: 0, max: size(grid.width) });
  const [zField, z] = numberField("z", "m", { value: decimal(size(grid.depth) / 2, 1), min: 0, max: size(grid.depth) });
  look.column.watch((column) => {
    if (!column) return;
    x.value = decimal(size(column.column_x + 0.5), 2);
    z.value = decimal(size(column.column_z + 0.5), 2);
  });
  const answer = h("dl", { class: "answers", role: "status" });
  const tell = (rows: [string, string][]) =>
    answer.replaceChildren(...rows.flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]));

  const height = async () => {
    const { height } = await session.height(x.valueAsNumber, z.valueAsNumber);
    tell([["Height", `${decimal(height, 3)} m`]]);
  };
  const profile = async () => {
    const column = (at: number, count: number) => Math.min(Math.max(Math.floor(at / grid.cell_size), 0), count - 1);
    const column_x = column(x.valueAsNumber, grid.width);
    look.column.set({ column_x, column_z: column(z.valueAsNumber, grid.depth) });
  };
  const mass = async () => {
    const ledger = await session.mass();
    const { imbalance_quanta } = ledger;
    tell([
      ...entries.flatMap(([name, label]): [string, string][] => {
        const kilograms = ledger[name];
        return kilograms === undefined ? [] : [[label, massText(kilograms)]];
      }),
      ["Imbalance", `${imbalance_quanta} quanta`],
    ]);
  };
  const save = async () => {
    const colour = look.colour.get();
    const query = {
      view: look.shape.get() === "cells" ? "grid" : "surface",
      field: cellField(colour) ? colour : undefined,
      width: 1600,
      height: 1200,
    };
    const path = `/v1/sessions/${encodeURIComponent(session.id)}/render.png`;
    const response = await send(session.access, path, { query, accept: "image/png" });
    const url = URL.createObjectURL(await response.blob());
    h("a", { href: url, download: `${session.id}.png` }).click();
    setTimeout(() => URL.revokeObjectURL(url), 60_000);
  };
  return section(
    "Measure",
    h("div", { class: "pair" }, xField, zField),
    h(
      "div",
      { class: "buttons" },
      action("Get height", {}, height, report),
      action("Profile", {}, profile, report),
      action("Get mass", {}, mass, report),
    ),
    answer,
    viewport ? h("div", { class: "buttons" }, action("Save a picture", {}, save, report)) : null,
  );
}
