// What the colours mean, in units.

import { h } from "../dom.ts";
import { decimal } from "../format.ts";
import type { Pictures, Shade } from "./picture.ts";

/** The legend; hidden where everything is white. */
export function legend(pictures: Pictures): HTMLElement {
  const element = h("figure", { class: "legend", hidden: true });
  pictures.shade.watch((shade) => {
    element.hidden = !shade;
    if (shade) fill(element, shade);
  });
  return element;
}

function fill(element: HTMLElement, { field, range, whole, columns }: Shade): void {
  const { low, high } = range;
  const digits = high - low < 1 ? 2 : high - low < 10 ? 1 : 0;
  const sign = (part: number) => (part === 0 && range.below ? "≤\u202f" : part === 1 && range.above ? "≥\u202f" : "");
  const labels = [0, 0.25, 0.5, 0.75, 1].map((part) =>
    h("span", {}, `${sign(part)}${decimal(low + part * (high - low), digits)}`),
  );
  const bar = h("div", { class: "bar", role: "img", "aria-label": `from ${low} to ${high} ${field.unit}` });
  // Set as a property: the page's policy allows no inline styles.
  bar.style.background = `linear-gradient(to right, ${field.colours.map((hex) => `#${hex}`).join(", ")})`;
  const part = whole ? "" : ` of ${columns.width} × ${columns.depth} columns around the middle`;
  element.replaceChildren(
    h("figcaption", {}, `${field.name}${part}, ${field.unit}`),
    bar,
    h("div", { class: "labels" }, ...labels),
  );
}
