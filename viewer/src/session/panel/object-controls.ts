// What the chosen object can be told: how it is turned, how it moves by itself, what snow does with it.

import type { Collider, ColliderPatch } from "firn-client";
import { h, numberField } from "../../dom.ts";
import { decimal, mass } from "../../format.ts";
import { type Desk, setting } from "./panel.ts";

/** The controls, and what shows an object in them. */
export function objectControls(desk: Desk): { element: HTMLElement; show: (collider: Collider) => void } {
  const { mover } = desk;
  let collider: Collider | null = null;
  const change = (patch: ColliderPatch) => collider && mover.change(collider, patch);

  const angle = h("output", {});
  const turn = () => {
    angle.textContent = `${heading.value}°`;
    change({ heading: heading.valueAsNumber });
  };
  const heading = h("input", { type: "range", min: 0, max: 359, step: 1, "aria-label": "Turn it", input: turn });
  const hold = () => change({ airborne: airborne.checked });
  const airborne = h("input", { type: "checkbox", name: "airborne", change: hold });
  const letThrough = () => change({ shelters: !through.checked });
  const through = h("input", { type: "checkbox", name: "falls-through", change: letThrough });

  const speed = { min: -100, max: 100 };
  const [eastField, east] = numberField("Velocity east", "m/s", speed);
  const [northField, north] = numberField("Velocity north", "m/s", speed);
  const [rateField, rate] = numberField("Turn rate", "°/s", { min: -720, max: 720 });
  const send = async () => change({ velocity: { x: east.valueAsNumber || 0, z: north.valueAsNumber || 0 } });
  const [showEast, showNorth] = [setting(east, desk, send), setting(north, desk, send)];
  const showRate = setting(rate, desk, async (turn_rate) => change({ turn_rate }));

  const kilograms = h("output", { name: "burden" });
  const burden = h("p", { class: "burden" }, h("span", {}, "Snow on it"), kilograms);
  const element = h(
    "div",
    { class: "section turn" },
    h("label", { class: "slider" }, h("span", {}, "Heading"), heading, angle),
    h("label", { class: "check" }, airborne, "Held up"),
    h("label", { class: "check" }, through, "Snow falls through it"),
    eastField,
    northField,
    rateField,
    burden,
  );
  const show = (now: Collider) => {
    // A slider that is held tells the newest heading itself.
    const held = heading.matches(":active") && collider?.id === now.id;
    collider = now;
    airborne.checked = now.airborne;
    through.checked = !now.shelters;
    showEast(now.velocity?.x ?? 0);
    showNorth(now.velocity?.z ?? 0);
    showRate(now.turn_rate ?? 0);
    burden.hidden = !now.burden;
    kilograms.textContent = mass(now.burden ?? 0);
    if (held) return;
    heading.value = String(bearing(now.heading));
    angle.textContent = `${decimal(bearing(now.heading), 0)}°`;
  };
  return { element, show };
}

/** A heading from 0 to 360°. */
export function bearing(degrees: number): number {
  return ((degrees % 360) + 360) % 360;
}
