// How the connection stands, what time it is, and how fast everything goes.

import type { StreamState } from "firn-client";
import { h } from "../dom.ts";
import { clock, decimal, mass } from "../format.ts";
import type { Model } from "./model.ts";
import type { Viewport } from "./viewport.ts";

/** Rates are averages over this time [ms]. */
const WINDOW = 1000;
/** How the server closes streams whose token no longer holds. */
const BAD_TOKEN = 3500;

/** The connection, told as it is. `askForToken` is offered where the server wants one. */
export function connection(model: Model, askForToken: () => void): { element: HTMLElement; close: () => void } {
  const text = h("span", {});
  const retry = h("button", { type: "button", class: "quiet", click: () => model.reconnect() }, "Now");
  const token = h("button", { type: "button", class: "quiet", click: askForToken }, "Enter a token");
  const element = h(
    "p",
    { class: "connection", role: "status" },
    h("i", { "aria-hidden": "true" }),
    text,
    retry,
    token,
  );
  const show = () => {
    const state = model.state.get();
    element.dataset["state"] = state.name;
    text.textContent = words(state);
    retry.hidden = state.name !== "waiting";
    token.hidden = !wantsToken(state);
  };
  model.state.watch(show);
  const countdown = window.setInterval(() => model.state.get().name === "waiting" && show(), 250);
  return { element, close: () => clearInterval(countdown) };
}

/** Whether another token may open the stream again. */
function wantsToken(state: StreamState): boolean {
  if (state.name !== "closed") return false;
  return state.code === BAD_TOKEN || [401, 403].includes(state.problem?.status ?? 0);
}

function words(state: StreamState): string {
  switch (state.name) {
    case "connecting":
      return "Connecting…";
    case "open":
      return "Live";
    case "waiting": {
      const seconds = Math.max(0, Math.ceil((state.retry_at - Date.now()) / 1000));
      return `Not connected: ${state.reason}. Trying again in ${seconds} s.`;
    }
    case "closed":
      return `Ended: ${state.reason}`;
  }
}

/** Clock and totals. */
export function facts(model: Model): HTMLElement {
  const element = h("p", { class: "facts" });
  model.view.watch((view) => {
    const { settled, paused, progress, summary } = view;
    const state = progress ? "stepping" : paused ? "paused" : settled ? "settled" : "running";
    const depth = `${decimal(summary.mean_height, 2)} m`;
    element.textContent = [clock(view), state, depth, mass(summary.total_mass)].join(" · ");
    element.dataset["height"] = String(summary.mean_height);
  });
  return element;
}

/** Frames drawn, and ticks simulated, per second. */
export function rates(model: Model, viewport: Viewport | null): { element: HTMLElement; close: () => void } {
  const element = h("p", { class: "rates", title: "Frames drawn, and ticks simulated, per second" });
  let before = { frames: 0, tick: model.view.get().tick, at: performance.now() };
  const measure = () => {
    const now = { frames: viewport?.stage.drawn ?? 0, tick: newestTick(model), at: performance.now() };
    const seconds = (now.at - before.at) / 1000;
    const rate = (count: number) => Math.max(0, Math.round(count / seconds));
    element.textContent = `${rate(now.frames - before.frames)} frames/s · ${rate(now.tick - before.tick)} ticks/s`;
    element.dataset.frames = String(now.frames);
    element.dataset.at = String(now.at);
    before = now;
  };
  const timer = window.setInterval(measure, WINDOW);
  return { element, close: () => clearInterval(timer) };
}

function newestTick(model: Model): number {
  return Math.max(model.view.get().tick, model.overview.get()?.tick ?? 0);
}
