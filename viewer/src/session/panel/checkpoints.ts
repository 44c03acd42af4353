// Restore points: states that the session can go back to.

import type { Checkpoint } from "firn-client";
import { action, h } from "../../dom.ts";
import { duration } from "../../format.ts";
import { type Desk, section } from "./panel.ts";

/** The section. */
export function checkpointsSection(desk: Desk): HTMLElement {
  const { model, report, say } = desk;
  const { session } = model;
  const list = h("ul", { class: "objects" });
  const show = async () => {
    const points = await session.checkpoints();
    list.hidden = points.length === 0;
    list.replaceChildren(...points.map((point) => row(point, desk, show)));
  };
  const name = h("input", { name: "checkpoint", required: true, pattern: "[A-Za-z0-9_\\-]{1,64}", maxlength: 64 });
  const keep = async () => {
    if (!name.reportValidity()) return;
    const kept = await session.putCheckpoint(name.value);
    say(`Kept as ${kept.name}.`);
    await show();
  };
  void show().catch(report);
  return section(
    "Restore points",
    h("label", { class: "field wide" }, h("span", {}, "Keep as"), name),
    h("div", { class: "buttons" }, action("Keep this state", {}, keep, report)),
    list,
  );
}

function row({ name, sim_time }: Checkpoint, { model, report, say }: Desk, show: () => Promise<void>): HTMLElement {
  const goBack = async () => {
    await model.session.reset(name);
    say(`Back to ${name}.`);
    await model.refresh();
  };
  const remove = () => model.session.deleteCheckpoint(name).then(show);
  return h(
    "li",
    {},
    h("span", { class: "pick" }, h("strong", {}, name), h("small", {}, duration(sim_time))),
    action("Go back", { class: "quiet", "aria-label": `Go back to ${name}` }, goBack, report),
    action("×", { class: "quiet", "aria-label": `Delete ${name}` }, remove, report),
  );
}
