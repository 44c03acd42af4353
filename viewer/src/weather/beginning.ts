// What a session of alpine snow begins with beside others: where and when it is, its weather, and what snow lies there.

import type { SessionSpec } from "firn-client";
import { type Attributes, h, numberField } from "../dom.ts";
import { weatherFields } from "./fields.ts";

/** The fields. */
export interface Beginning {
  element: HTMLFieldSetElement;
  /** What was entered; null where something is wrong with it, which the browser then tells. */
  read(): Partial<SessionSpec> | null;
  /** Tells beside the fields what the server refused, and takes back what was told before. Whether each refusal has its field. */
  tell(error: unknown): boolean;
}

/** The fields; at first they are those of Col de Porte, where snow has been measured for long, and of today. */
export function beginning(): Beginning {
  const required: Attributes = { required: true };
  const [latitudeField, latitude] = numberField("Latitude", "° N", { value: 45.3, min: -90, max: 90, ...required });
  const [longitudeField, longitude] = numberField("Longitude", "° E", {
    value: 5.77,
    min: -180,
    max: 180,
    ...required,
  });
  const now = `${new Date().toISOString().slice(0, 10)}T00:00`;
  const start = h("input", { type: "datetime-local", name: "start", value: now, ...required });
  const [stepField, step] = numberField("Weather step", "s", { value: 900, min: 60, max: 3600, ...required });
  const [scaleField, scale] = numberField("Time scale", "×", { value: 600, min: 0, max: 100_000, ...required });
  const weather = weatherFields("/weather", "pairs");
  const part = (title: string, ...fields: HTMLElement[]) =>
    h("fieldset", { class: "section" }, h("legend", {}, title), ...fields);
  const element = h(
    "fieldset",
    { class: "section alpine" },
    part(
      "Site",
      h("div", { class: "pairs" }, latitudeField, longitudeField),
      h("label", { class: "field wide" }, h("span", {}, "Start, UTC"), start),
      h("div", { class: "pairs" }, stepField, scaleField),
    ),
    part("Weather", ...weather.elements),
  );
  const read = () => {
    const steady = weather.read();
    return (
      steady && {
        site: { latitude: latitude.valueAsNumber, longitude: longitude.valueAsNumber, start: `${start.value}:00Z` },
        weather_step: step.valueAsNumber,
        time_scale: scale.valueAsNumber,
        weather: steady,
      }
    );
  };
  return { element, read, tell: weather.tell };
}
