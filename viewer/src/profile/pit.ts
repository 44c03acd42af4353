// A column drawn as the profile of a snow pit: hardness as bars and temperature as a line, both from 0 on the right; density beside
// them; weak layers marked across. Alpine snow has hardness by hand, and liquid water beside density.

import type { Column, Layer } from "firn-client";
import { svg } from "../dom.ts";
import { decimal } from "../format.ts";
import { hands, rank, runs, wetness } from "./hand.ts";
import { type Scale, scale } from "./scale.ts";

const WIDTH = 380;
const HEIGHT = 430;
const TOP = 44;
const BOTTOM = HEIGHT - 44;
/** Wetness up to here [%] is drawn on the same scale: what snow holds against gravity. */
const WET = 5;

/** Places of a panel, from left to right. */
interface Panel {
  left: number;
  right: number;
}

/** Where things are drawn: hardness and temperature, density, and water where there may be some. */
interface Panels {
  main: Panel;
  side: Panel;
  water: Panel | null;
}

const dry: Panels = { main: { left: 40, right: 216 }, side: { left: 230, right: 338 }, water: null };
const wet: Panels = {
  main: { left: 40, right: 190 },
  side: { left: 202, right: 266 },
  water: { left: 278, right: 338 },
};

/** The drawing. */
export function pit(column: Column): SVGSVGElement {
  const { layers, weak_layers } = column;
  const byHand = layers.some((layer) => layer.hand_hardness !== undefined);
  const { main, side, water } = byHand ? wet : dry;
  const right = (water ?? side).right;
  const top = Math.max(column.height, 0.01);
  const y = scale(0, top, BOTTOM, TOP, 6);
  const most = (of: (layer: Layer) => number) => layers.reduce((most, layer) => Math.max(most, of(layer)), 0);
  const hard = ({ hand_hardness: hand, hardness }: Layer) => (byHand ? (hand ? rank(hand) : 0) : hardness);
  const hardness = scale(0, byHand ? hands.length + 0.4 : most(hard) || 1, main.right, main.left, byHand ? 7 : 4);
  const coldest = most((layer) => -layer.temperature);
  const temperature = scale(0, -Math.max(coldest * 1.1, 1), main.right, main.left, 4);
  const density = scale(0, most((layer) => layer.density) * 1.05 || 1, side.left, side.right, water ? 2 : 3);
  const wettest = Math.max(WET, most(wetness) * 1.05);
  const volume = water && scale(0, wettest, water.left, water.right, 2);
  return svg(
    "svg",
    { class: "pit", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": describe(column) },
    ...weak_layers.map((layer) =>
      svg("rect", {
        class: "weak",
        x: main.left,
        width: right - main.left,
        y: y(layer.bottom + layer.thickness),
        height: Math.max(2, y(layer.bottom) - y(layer.bottom + layer.thickness)),
      }),
    ),
    ...frame(y, column.height, water ? [main, side, water] : [main, side]),
    ...axis(hardness, BOTTOM + 15, "hardness", byHand ? "Hand hardness" : "Hardness, Pa", main, byHand ? hand : number),
    ...axis(temperature, TOP - 8, "temperature", "Temperature, °C", main),
    ...axis(density, BOTTOM + 15, "density", "Density, kg/m³", side),
    ...(volume && water ? axis(volume, BOTTOM + 15, "water", "Water, %", water) : []),
    ...layers.map((layer) => bar(layer, y, hardness, hard(layer), main.right)),
    svg("path", { class: "density", d: steps(layers, y, side.left, (layer) => density(layer.density)) }),
    volume &&
      water &&
      svg("path", { class: "water", d: steps(layers, y, water.left, (layer) => volume(wetness(layer))) }),
    svg("path", { class: "temperature", d: line(layers, y, temperature) }),
    ...weak_layers.map((layer) =>
      svg("text", { class: "weak", x: right + 4, y: y(layer.bottom + layer.thickness / 2) + 4 }, "weak"),
    ),
  );
}

/** The pit's wall: its borders, and height above the ground. */
function frame(y: Scale, height: number, panels: Panel[]): SVGElement[] {
  const [first, last] = [panels[0], panels.at(-1)] as [Panel, Panel];
  const lines = y.ticks.flatMap((tick) => [
    svg("line", { class: "grid", x1: first.left, x2: last.right, y1: y(tick), y2: y(tick) }),
    svg(
      "text",
      { class: "height", x: first.left - 5, y: y(tick) + 4, "text-anchor": "end" },
      decimal(tick, height < 2 ? 2 : 1),
    ),
  ]);
  const borders = panels.map(({ left, right }) =>
    svg("rect", { class: "border", x: left, width: right - left, y: TOP, height: BOTTOM - TOP }),
  );
  return [...lines, ...borders, svg("text", { x: 4, y: TOP - 10 }, "m")];
}

function axis(values: Scale, y: number, name: string, title: string, panel: Panel, label = number): SVGElement[] {
  const above = y < TOP;
  const told = values.ticks.filter((tick) => label(tick) !== "");
  const labels = told.map((tick) =>
    svg("text", { class: name, x: values(tick), y, "text-anchor": "middle" }, label(tick)),
  );
  const middle = (panel.left + panel.right) / 2;
  const at = above ? y - 17 : y + 18;
  return [...labels, svg("text", { class: `title ${name}`, x: middle, y: at, "text-anchor": "middle" }, title)];
}

function number(tick: number): string {
  return decimal(tick, Math.abs(tick) % 1 === 0 ? 0 : 1);
}

/** The class of hand hardness that a bar up to a tick has. */
function hand(tick: number): string {
  return hands[tick - 1] ?? "";
}

function bar(layer: Layer, y: Scale, hardness: Scale, hard: number, right: number): SVGElement {
  const top = y(layer.bottom + layer.thickness);
  const left = hardness(hard);
  return svg("rect", {
    class: "hardness",
    x: left,
    width: right - left,
    y: top,
    height: Math.max(0.5, y(layer.bottom) - top),
  });
}

/** Steps from the ground up. */
function steps(layers: Layer[], y: Scale, left: number, place: (layer: Layer) => number): string {
  const points = layers.flatMap((layer) => [
    `${place(layer).toFixed(1)} ${y(layer.bottom).toFixed(1)}`,
    `${place(layer).toFixed(1)} ${y(layer.bottom + layer.thickness).toFixed(1)}`,
  ]);
  return points.length > 0 ? `M${left} ${BOTTOM} L${points.join(" L")} L${left} ${y(topOf(layers)).toFixed(1)} Z` : "";
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
  const hard = runs(layers);
  const byHand = hard ? [`hand hardness from the ground up: ${hard}`] : [];
  return [about, ...byHand, ...weak].join("; ");
}
