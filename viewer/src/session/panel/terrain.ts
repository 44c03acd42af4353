// The ground under the snow, and another one put there.

import { action, h } from "../../dom.ts";
import { decimal } from "../../format.ts";
import { imageFields } from "../../terrain/image.ts";
import { type Desk, section } from "./panel.ts";

/** The section. */
export function terrainSection({ model, report, say }: Desk): HTMLElement {
  const range = h("p", { class: "hint" });
  model.ground.watch((ground) => {
    if (!ground) return;
    const { base, relief } = ground;
    range.textContent =
      relief > 0 ? `From ${decimal(base, 1)} to ${decimal(base + relief, 1)} m.` : `Level, at ${decimal(base, 1)} m.`;
  });
  const image = imageFields(() => model.grid);
  const put = async () => {
    await image.read()(model.session);
    say("The snow lies on the new ground.");
  };
  const element = section(
    "Terrain",
    range,
    ...image.elements,
    h("div", { class: "buttons" }, action("Put under the snow", {}, put, report)),
  );
  element.open = false;
  return element;
}
