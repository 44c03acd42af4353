// A place on the snow in numbers, for who does not click.

import { h, numberField } from "../../dom.ts";
import { decimal } from "../../format.ts";
import type { Desk } from "./panel.ts";

/** Fields for x and z after a word, and a button that hands them on [m]. */
export function pointForm(
  word: string,
  button: string,
  { model }: Desk,
  run: (x: number, z: number) => void,
): HTMLFormElement {
  const { width, depth, cell_size } = model.grid;
  const field = (axis: string, columns: number) => {
    const side = columns * cell_size;
    return numberField(`${word} ${axis}`, "m", { value: decimal(side / 2, 1), min: 0, max: side });
  };
  const [xField, x] = field("x", width);
  const [zField, z] = field("z", depth);
  const submit = (event: SubmitEvent) => {
    event.preventDefault();
    if (!Number.isNaN(x.valueAsNumber + z.valueAsNumber)) run(x.valueAsNumber, z.valueAsNumber);
  };
  const buttons = h("div", { class: "buttons" }, h("button", {}, button));
  return h("form", { class: "section", submit }, h("div", { class: "pair" }, xField, zField), buttons);
}
