// Prints that are pressed into the snow where somebody clicks.

import type { Shape } from "firn-client";
import { choice, h, numberField } from "../../dom.ts";
import { decimal } from "../../format.ts";
import { foot } from "../kinds.ts";
import { fitInto } from "../mover.ts";
import type { Desk } from "./panel.ts";
import { pointForm } from "./point.ts";

/** Usual loads [kg]. */
const loads = { foot: 80, box: 500 };

/** The controls, and what presses a print somewhere [m]. */
export function printTool(desk: Desk): { element: HTMLElement; press: (x: number, z: number) => void } {
  const { model, report, say } = desk;
  let kind: keyof typeof loads = "foot";
  const [loadField, load] = numberField("Load", "kg", { value: loads[kind], min: 0.001, max: 1e9, required: true });
  const [sideField, side] = numberField("Side", "m", { value: 1, min: 0.01, required: true });
  const [bearingField, bearing] = numberField("Points to", "°", { value: 0, min: -360, max: 360 });
  const choose = (chosen: typeof kind) => {
    kind = chosen;
    load.value = String(loads[kind]);
    sideField.hidden = kind !== "box";
  };
  const kinds = [
    ["foot", "Foot"],
    ["box", "Box"],
  ] as const;

  const send = async (x: number, z: number) => {
    const asked = kind === "box" ? [load, side, bearing] : [load, bearing];
    if (!asked.every((input) => input.reportValidity())) return;
    const width = side.valueAsNumber;
    const shape: Shape = kind === "foot" ? foot : { type: "box", width, depth: width };
    const heading = bearing.valueAsNumber || 0;
    const position = fitInto(model.grid, x, z);
    const { stamps } = await model.session.stamp(
      [{ shape, position, heading, mass: load.valueAsNumber }],
      crypto.randomUUID(),
    );
    say(`The print is ${decimal(stamps[0]?.depth ?? 0, 2)} m deep.`);
  };
  const press = (x: number, z: number) => void send(x, z).catch(report);
  const element = h(
    "div",
    { class: "section" },
    choice("Print of a", kinds, kind, choose),
    loadField,
    sideField,
    bearingField,
    pointForm("At", "Press the print", desk, press),
  );
  choose(kind);
  return { element, press };
}
