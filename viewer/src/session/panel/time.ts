// The clock: start, pause, step, time scale, reset.

import { action, h, numberField } from "../../dom.ts";
import { physics, physicsOf } from "../../physics.ts";
import { type Desk, section, setting } from "./panel.ts";

/** The section. */
export function timeSection(desk: Desk): HTMLElement {
  const { model, report, say } = desk;
  const { session } = model;
  const { highestTimeScale } = physics[physicsOf(model.view.get())];
  const refresh = () => model.refresh();

  const set = (paused: boolean) => async () => {
    await session.patch({ paused });
    await refresh();
  };
  const start = action("Start", { class: "primary" }, set(false), report);
  const stop = action("Pause", { class: "primary" }, set(true), report);
  const [ticksField, ticks] = numberField("Step", "ticks", { value: 60, min: 1, max: 1_000_000, step: 1 });
  const step = async (spec: Parameters<typeof session.step>[0]) => {
    const { tick, settled } = await session.step(spec);
    say(`Tick ${tick}${settled ? ", settled" : ""}.`);
    await refresh();
  };
  const stepButton = action("Step", {}, () => step({ ticks: ticks.valueAsNumber }), report);
  const settleButton = action("Settle", {}, () => step({ until_settled: true, max_seconds: 3600 }), report);
  const bar = h("progress", { "aria-label": "Progress" });
  const endButton = action("End the step", {}, () => session.endStep().then(refresh), report);
  const underWay = h("div", { class: "buttons" }, bar, endButton);
  const resetButton = action("Reset", {}, () => session.reset().then(refresh), report);

  const [scaleField, scale] = numberField("Time scale", "×", { min: 0, max: highestTimeScale });
  const showScale = setting(scale, desk, (time_scale) => session.patch({ time_scale }));

  model.view.watch((view) => {
    start.hidden = !view.paused;
    stop.hidden = view.paused;
    // A step is for sessions that stand still.
    for (const button of [stepButton, settleButton]) button.disabled = view.state !== "paused";
    underWay.hidden = !view.progress;
    bar.max = view.progress?.of ?? 1;
    bar.value = view.progress?.done ?? 0;
    showScale(view.time_scale);
  });
  return section(
    "Time",
    h("div", { class: "buttons" }, start, stop, resetButton),
    scaleField,
    ticksField,
    h("div", { class: "buttons" }, stepButton, settleButton),
    underWay,
  );
}
