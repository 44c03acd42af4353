// The dialog that creates a session.

import type { CreatedSession, Physics, Preset, SessionSpec } from "firn-client";
import { h, numberField } from "../dom.ts";
import { physics } from "../physics.ts";
import { describe, presets } from "../presets.ts";
import { explain, server } from "../server.ts";
import { terrainChoice } from "../terrain/choice.ts";
import { beginning } from "../weather/beginning.ts";

/** Snow that alpine sessions begin with at first [m], and that of others. */
const SNOW: Record<Physics, number> = { thesis: 5.8, alpine: 1 };

/** Opens it; a session that was created is shown at once. */
export function createDialog(): void {
  const name = h("input", {
    type: "text",
    name: "id",
    pattern: "[A-Za-z0-9_\\-]{1,64}",
    autocomplete: "off",
    placeholder: "chosen by the server",
  });
  const [widthField, width] = numberField("Width", "columns", {
    value: 50,
    min: 1,
    max: 2048,
    step: 1,
    required: true,
  });
  const [depthField, depth] = numberField("Depth", "columns", {
    value: 50,
    min: 1,
    max: 2048,
    step: 1,
    required: true,
  });
  const [heightField, height] = numberField("Height", "cells", {
    value: 50,
    min: 1,
    max: 255,
    step: 1,
    required: true,
  });
  const [cellField, cell] = numberField("Cell size", "m", { value: 0.2, min: 0.02, max: 2, required: true });
  const [snowField, snow] = numberField("Snow", "m", { value: SNOW.thesis, min: 0, max: 1000, required: true });
  const [airField, air] = numberField("Air", "°C", { value: -3, min: -40, max: 0, required: true });
  const [densityField, density] = numberField("Density", "kg/m³", { value: 250, min: 10, max: 917, required: true });
  const kinds = Object.entries(presets).map(([value, { name }]) => h("option", { value }, name));
  const kind = h("select", { name: "preset", change: () => fill() }, ...kinds);
  const filled = h("p", { class: "hint" });
  const fill = () => {
    const snow = presets[kind.value as Preset];
    filled.textContent = describe(snow);
    air.valueAsNumber = snow.air_temperature;
  };
  fill();
  const kindPart = h(
    "fieldset",
    { class: "section" },
    h("label", { class: "field wide" }, h("span", {}, "Kind of snow"), kind),
    filled,
  );
  const alpine = beginning();
  const laws = Object.entries(physics).map(([value, { name }]) => h("option", { value }, name));
  const law = h("select", { name: "physics", change: () => follow() }, ...laws);
  const chosen = () => law.value as Physics;
  /** Asks for what snow of the chosen physics reads, and for nothing else. */
  const follow = () => {
    const isAlpine = chosen() === "alpine";
    kindPart.hidden = airField.hidden = air.disabled = isAlpine;
    alpine.element.hidden = alpine.element.disabled = densityField.hidden = density.disabled = !isAlpine;
    if (snow.valueAsNumber === SNOW[isAlpine ? "thesis" : "alpine"]) snow.valueAsNumber = SNOW[chosen()];
  };
  follow();
  const sizes = [width, depth];
  const terrain = terrainChoice(
    () => ({ width: width.valueAsNumber, depth: depth.valueAsNumber }),
    (size) => {
      [width.valueAsNumber, depth.valueAsNumber] = [size.width, size.depth];
      terrain.check();
    },
  );
  for (const input of sizes) input.addEventListener("input", () => terrain.check());
  const button = h("button", { class: "primary" }, "Create");
  const paused = h("input", { type: "checkbox" });
  const problem = h("p", { class: "problem", role: "alert" });

  /** What only one of the physics reads. */
  const own = (): Partial<SessionSpec> => {
    const depth = snow.valueAsNumber;
    if (chosen() === "thesis") {
      const initial_snow = depth > 0 ? [{ depth }] : [];
      return { preset: kind.value as Preset, air_temperature: air.valueAsNumber, initial_snow };
    }
    const initial_snow = depth > 0 ? [{ depth, density: density.valueAsNumber }] : [];
    return { physics: "alpine", ...alpine.read(), initial_snow };
  };
  const spec = (): SessionSpec => ({
    ...(name.value ? { id: name.value } : {}),
    grid: {
      width: width.valueAsNumber,
      depth: depth.valueAsNumber,
      height: height.valueAsNumber,
      cell_size: cell.valueAsNumber,
    },
    paused: paused.checked,
    ...own(),
  });
  /** Creates the session on its ground, or none. */
  const create = async (): Promise<CreatedSession> => {
    const lay = terrain.read();
    const created = await server().createSession(spec());
    const session = server().session(created.id);
    try {
      await lay?.(session);
    } catch (error) {
      await session.delete().catch(() => {});
      throw error;
    }
    return created;
  };
  const submit = async (event: SubmitEvent) => {
    event.preventDefault();
    problem.textContent = "";
    alpine.tell(null);
    button.disabled = true;
    try {
      const created = await create();
      const { auth } = await server().readiness();
      if (auth === "open") leave(created.id);
      else showTokens(created);
    } catch (error) {
      if (!alpine.tell(error)) problem.textContent = explain(error);
    } finally {
      button.disabled = false;
    }
  };
  const leave = (id: string) => {
    dialog.close();
    location.hash = `#/sessions/${encodeURIComponent(id)}`;
  };
  const showTokens = (created: CreatedSession) => {
    const row = (label: string, value: string) =>
      h("label", { class: "token" }, h("span", {}, label), h("input", { readonly: true, value }));
    dialog.replaceChildren(
      h("h2", {}, created.id),
      h("p", {}, "Its tokens are told only this once."),
      row("May do everything", created.token),
      row("May only look", created.viewer_token),
      h(
        "div",
        { class: "buttons" },
        h("button", { type: "button", class: "primary", click: () => leave(created.id) }, "Open it"),
      ),
    );
  };

  const form = h(
    "form",
    { submit },
    h("h2", {}, "New session"),
    h("label", { class: "field wide" }, h("span", {}, "Name"), name),
    h("label", { class: "field wide" }, h("span", {}, "Physics"), law),
    kindPart,
    h("div", { class: "pairs" }, widthField, depthField, heightField, cellField, snowField, airField, densityField),
    terrain.element,
    alpine.element,
    h("label", { class: "check" }, paused, "Begin paused"),
    problem,
    h("div", { class: "buttons" }, h("button", { type: "button", click: () => dialog.close() }, "Cancel"), button),
  );
  const dialog = h("dialog", { class: "dialog", "aria-label": "New session", close: () => dialog.remove() }, form);
  document.body.append(dialog);
  dialog.showModal();
}
