// The weather that alpine snow feels: what holds now, and another one.

import type { WeatherView } from "firn-client";
import { action, h } from "../../dom.ts";
import { moment } from "../../format.ts";
import { explain } from "../../server.ts";
import { weatherFields } from "../../weather/fields.ts";
import { weatherNow } from "../../weather/now.ts";
import { type Desk, section } from "./panel.ts";

/** Between two looks at the weather there is at least this time [ms], and so many times as long as a look takes: series are long. */
const LEAST_PAUSE = 2000;
const PAUSE = 20;

/** The section. */
export function weatherSection({ model, report, say }: Desk): HTMLElement {
  const { session } = model;
  const when = h("p", { class: "hint" });
  const told = h("p", { class: "hint" });
  const now = h("dl", { class: "answers" });
  const fields = weatherFields("", "section");
  let [busy, touched] = [false, false];

  const show = (view: WeatherView) => {
    now.replaceChildren(...weatherNow(view));
    told.textContent = origin(view);
    if (!touched) fields.fill(view);
  };
  const look = async () => {
    if (busy || !element.open || document.hidden) return;
    busy = true;
    const begin = performance.now();
    try {
      show(await session.weather());
    } catch (error) {
      told.textContent = explain(error);
    }
    setTimeout(() => (busy = false), Math.max(LEAST_PAUSE, PAUSE * (performance.now() - begin)));
  };
  const set = async () => {
    const weather = fields.read();
    if (!weather) return;
    try {
      await session.putWeather(weather);
    } catch (error) {
      if (!fields.tell(error)) throw error;
      return;
    }
    fields.tell(null);
    touched = false;
    say("The weather holds from now on.");
    show(await session.weather());
    await model.refresh();
  };
  const form = h(
    "div",
    { class: "section", input: () => (touched = true) },
    h("h3", {}, "Other weather"),
    ...fields.elements,
    h("div", { class: "buttons" }, action("Set the weather", { class: "primary" }, set, report)),
  );
  const element = section("Weather", when, now, told, form);
  element.addEventListener("toggle", look);
  model.view.watch(({ site, sim_time }) => {
    when.hidden = !site?.start;
    if (site?.start) when.textContent = `It is ${moment(site.start, sim_time)}.`;
    look();
  });
  return element;
}

/** Where it comes from. */
function origin({ weather }: WeatherView): string {
  if (!("series" in weather)) return "";
  const rows = weather.series.length === 1 ? "one row" : `${weather.series.length} rows`;
  return `From a series of ${rows}. Other weather takes its place.`;
}
