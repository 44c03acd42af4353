// The controls of a session, in sections.

import { h } from "../../dom.ts";
import { isAlpine } from "../../physics.ts";
import type { Look } from "../look.ts";
import type { Model } from "../model.ts";
import type { Mover } from "../mover.ts";
import type { Tools } from "../pointer.ts";
import type { Viewport } from "../viewport.ts";
import { checkpointsSection } from "./checkpoints.ts";
import { lookSection } from "./look.ts";
import { measureSection } from "./measure.ts";
import { objectsSection } from "./objects.ts";
import { snowSection } from "./snow.ts";
import { terrainSection } from "./terrain.ts";
import { timeSection } from "./time.ts";
import { weatherSection } from "./weather.ts";

/** What every section works with. */
export interface Desk {
  model: Model;
  look: Look;
  mover: Mover;
  /** Null where this browser can't draw. */
  viewport: Viewport | null;
  /** Tells what was done. */
  say: (text: string) => void;
  /** Tells what went wrong. */
  report: (error: unknown) => void;
}

/** The panel, and what its tools do on the picture. */
export function panel(desk: Desk): { element: HTMLElement; tools: Tools } {
  const objects = objectsSection(desk);
  const sections = [
    timeSection(desk),
    ...(isAlpine(desk.model.view.get()) ? [weatherSection(desk)] : []),
    snowSection(desk),
    terrainSection(desk),
    lookSection(desk),
    objects.element,
    measureSection(desk),
    checkpointsSection(desk),
  ];
  return { element: h("aside", { class: "panel", "aria-label": "Controls" }, ...sections), tools: objects.tools };
}

/** A section that can be folded. */
export function section(title: string, ...children: (Node | string | null)[]): HTMLDetailsElement {
  const body = h("div", { class: "section" }, ...children);
  return h("details", { open: true }, h("summary", {}, title), body);
}

/** A field whose value is sent once it was changed; until then it shows what holds. */
export function setting(
  input: HTMLInputElement,
  { report }: Desk,
  send: (value: number) => Promise<unknown>,
): (value: number) => void {
  input.addEventListener("change", async () => {
    if (!input.reportValidity() || Number.isNaN(input.valueAsNumber)) return;
    await send(input.valueAsNumber).catch(report);
  });
  return (value) => {
    if (document.activeElement !== input) input.value = String(Number(value.toFixed(4)));
  };
}
