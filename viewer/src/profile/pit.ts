// A column drawn as the profile of a snow pit: hardness as bars and temperature as a line, both from 0 on the right; density beside
// them; weak layers marked across.

import type { Column, Layer } from "firn-client";
import { svg } from "../dom.ts";
import { decimal } from "../format.ts";
import { type Scale, scale } from "./scale.ts";

const WIDTH = 380;
const HEIGHT = 430;
const TOP = 44;
const BOTTOM = HEIGHT - 44;
/** Hardness and temperature. */
const MAIN = { left: 40, right: 216 };
/** Density. */
const SIDE = { left: 230, right: 338 };

/** The drawing. */
export function pit(column: Column): SVGSVGElement {
  const top = Math.max(column.height, 0.01);
  const y = scale(0, top, BOTTOM, TOP, 6);
  const most = (of: (layer: Layer) => number) => column.layers.reduce((most, layer) => Math.max(most, of(layer)), 0);
  const hardness = scale(0, most((layer) => layer.hardness) || 1, MAIN.right, MAIN.left, 4);
  const coldest = most((layer) => -layer.temperature);
  const temperature = scale(0, -Math.max(coldest * 1.1, 1), MAIN.right, MAIN.left, 4);
  const density = scale(0, most((layer) => layer.density) * 1.05 || 1, SIDE.left, SIDE.right, 3);
  return svg(
    "svg",
    { class: "pit", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": describe(column) },
    ...column.weak_layers.map((layer) =>
      svg("rect", {
        class: "weak",
        x: MAIN.left,
        width: SIDE.right - MAIN.left,
        y: y(layer.bottom + layer.thickness),
        height: Math.max(2, y(layer.bottom) - y(layer.bottom + layer.thickness)),
      }),
    ),
    ...frame(y, column.height),
    ...axis(hardness, BOTTOM + 15, "hardness", "Hardness, Pa", MAIN),
    ...axis(temperature, TOP - 8, "temperature", "Temperature, °C", MAIN),
    ...axis(density, BOTTOM + 15, "density", "Density, kg/m³", SIDE),
    ...column.layers.map((layer) => bar(layer, y, hardness)),
    svg("path", { class: "density", d: steps(column.layers, y, density) }),
    svg("path", { class: "temperature", d: line(column.layers, y, temperature) }),
    ...column.weak_layers.map((layer) =>
      svg("text", { class: "weak", x: SIDE.right + 4, y: y(layer.bottom + layer.thickness / 2) + 4 }, "weak"),
    ),
  );
}

/** The pit's wall: its borders, and height above the ground. */
function frame(y: Scale, height: number): SVGElement[] {
  const lines = y.ticks.flatMap((tick) => [
    svg("line", { class: "grid", x1: MAIN.left, x2: SIDE.right, y1: y(tick), y2: y(tick) }),
    svg(
      "text",
      { class: "height", x: MAIN.left - 5, y: y(tick) + 4, "text-anchor": "end" },
      decimal(tick, height < 2 ? 2 : 1),
    ),
  ]);
  const borders = [MAIN, SIDE].map(({ left, right }) =>
    svg("rect", { class: "border", x: left, width: right - left, y: TOP, height: BOTTOM - TOP }),
  );
  return [...lines, ...borders, svg("text", { x: 4, y: TOP - 10 }, "m")];
}

function axis(
  values: Scale,
  y: number,
  name: string,
  title: string,
  panel: { left: number; right: number },
): SVGElement[] {
  const above = y < TOP;
  const labels = values.ticks.map((tick) =>
    svg(
      "text",
      { class: name, x: values(tick), y, "text-anchor": "middle" },
      decimal(tick, Math.abs(tick) % 1 === 0 ? 0 : 1),
    ),
  );
  const middle = (panel.left + panel.right) / 2;
  const at = above ? y - 17 : y + 18;
  return [...labels, svg("text", { class: `title ${name}`, x: middle, y: at, "text-anchor": "middle" }, title)];
}

function bar(layer: Layer, y: Scale, hardness: Scale): SVGElement {
  const top = y(layer.bottom + layer.thickness);
  const left = hardness(layer.hardness);
  return svg("rect", {
    class: "hardness",
    x: left,
    width: MAIN.right - left,
    y: top,
    height: Math.max(0.5, y(layer.bottom) - top),
  });
}

/** Steps from the ground up. */
function steps(layers: Layer[], y: Scale, density: Scale): string {
  const points = layers.flatMap((layer) => [
    `${density(layer.density).toFixed(1)} ${y(layer.bottom).toFixed(1)}`,
    `${density(layer.density).toFixed(1)} ${y(layer.bottom + layer.thickness).toFixed(1)}`,
  ]);
  return points.length > 0
    ? `M${SIDE.left} ${BOTTOM} L${points.join(" L")} L${SIDE.left} ${y(topOf(layers)).toFixed(1)} Z`
    : "";
}

function line(layers: Layer[], y: Scale, temperature: Scale): string {
  const points = layers.map(
    (layer) => `${temperature(layer.temperature).toFixed(1)} ${y(layer.bottom + layer.thickness / 2).toFixed(1)}`,
  );
  return points.length > 0 ? `M${points.join(" L")}` : "";
}

function topOf(layers: Layer[]): number {
  const last = layers.at(-1);
  return last ? last.bottom + last.thickness : 0;
}

/** For those who can't see it. */
function describe({ height, mean_density, layers, weak_layers }: Column): string {
  const weak = weak_layers.map(
    ({ bottom, density }) => `a weak layer ${decimal(bottom, 2)} m above the ground, ${decimal(density, 0)} kg/m³`,
  );
  const about = `Profile of ${decimal(height, 2)} m of snow, ${decimal(mean_density, 0)} kg/m³ on average, ${layers.length} cells`;
  return [about, ...weak].join("; ");
}
