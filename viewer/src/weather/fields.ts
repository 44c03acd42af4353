// The fields of a weather that holds until it is replaced.

import { ProblemError, type Weather, type WeatherView } from "firn-client";
import { type Attributes, h, numberField } from "../dom.ts";

/** A number that is asked for. */
interface Asked {
  label: string;
  unit: string;
  low: number;
  high: number;
  /** What it is at first; what has none may stay empty. */
  value?: number;
  /** What it is multiplied by for people. */
  factor?: number;
}

/** Everything that is asked for, by the name that the API knows it by. */
const asked = {
  air_temperature: { label: "Air temperature", unit: "°C", low: -60, high: 50, value: -3 },
  relative_humidity: { label: "Humidity", unit: "%", low: 0, high: 100, value: 80 },
  wind_speed: { label: "Wind", unit: "m/s", low: 0, high: 100, value: 2 },
  cloud_cover: { label: "Clouds", unit: "%", low: 0, high: 1, factor: 100 },
  snowfall: { label: "Snowfall", unit: "mm/h", low: 0, high: 1000, value: 0 },
  rainfall: { label: "Rainfall", unit: "mm/h", low: 0, high: 1000, value: 0 },
  wind_direction: { label: "Wind from", unit: "°", low: 0, high: 360 },
  pressure: { label: "Pressure", unit: "hPa", low: 300, high: 1100 },
  shortwave: { label: "Short wave", unit: "W/m²", low: 0, high: 2000 },
  longwave: { label: "Long wave", unit: "W/m²", low: 0, high: 1000 },
} satisfies Record<string, Asked>;

type Name = keyof typeof asked;

/** Those that are seldom given. */
const seldom: readonly Name[] = ["wind_direction", "pressure", "shortwave", "longwave"];
const names = Object.keys(asked) as Name[];

/** The fields. */
export interface WeatherFields {
  elements: HTMLElement[];
  /** What was entered; null where something is wrong with it, which the browser then tells. */
  read(): Weather | null;
  /** Shows the weather that holds. What of it was worked out stays empty. */
  fill(view: WeatherView): void;
  /** Tells beside the fields what the server refused, and takes back what was told before. Whether each refusal has its field. */
  tell(error: unknown): boolean;
}

/** The fields. `at` is the JSON pointer of the weather in what is sent; `layout` the class of what the fields stand in. */
export function weatherFields(at: string, layout: string): WeatherFields {
  const fields = new Map(names.map((name) => [name, field(name)]));
  /** Where the sun stands, where somebody told. */
  let sun: Weather["sun"] | undefined;
  const stand = (wanted: (name: Name) => boolean) =>
    h("div", { class: layout }, ...names.filter(wanted).map((name) => fields.get(name)?.element));
  const more = h(
    "details",
    { class: "more" },
    h("summary", {}, "More"),
    stand((name) => seldom.includes(name)),
    h("p", { class: "hint" }, "What is left empty is worked out."),
  );
  // What is out of sight can't be asked for.
  more.addEventListener("invalid", () => (more.open = true), { capture: true });

  const read = () => {
    const inputs = names.map((name) => [name, fields.get(name)?.input as HTMLInputElement] as const);
    if (inputs.some(([, input]) => !input.reportValidity())) return null;
    const entered = inputs.filter(([, input]) => input.value !== "");
    const values = entered.map(([name, input]) => [name, input.valueAsNumber / factor(name)]);
    return { ...Object.fromEntries(values), ...(sun ? { sun } : {}) } as Weather;
  };
  const fill = ({ now, derived }: WeatherView) => {
    sun = derived.includes("sun") ? undefined : (now.sun ?? undefined);
    for (const [name, { input }] of fields) {
      const value = now[name];
      const shown = value == null ? "" : String(Number((value * factor(name)).toFixed(2)));
      const workedOut = derived.includes(name);
      input.value = workedOut ? "" : shown;
      input.placeholder = workedOut && value != null ? (value * factor(name)).toFixed(0) : "";
    }
  };
  const tell = (error: unknown) => {
    for (const { say } of fields.values()) say("");
    if (!(error instanceof ProblemError)) return false;
    const { errors } = error.problem;
    const placed = errors.filter(({ pointer, detail }) => {
      const name = names.find((name) => pointer === `${at}/${name}`);
      if (name && seldom.includes(name)) more.open = true;
      if (name) fields.get(name)?.say(detail);
      return name;
    });
    return errors.length > 0 && placed.length === errors.length;
  };
  return { elements: [stand((name) => !seldom.includes(name)), more], read, fill, tell };
}

/** A field with room for what is wrong with it. */
function field(name: Name) {
  const { label, unit, low, high, value }: Asked = asked[name];
  const id = `wrong-${name}`;
  const limits: Attributes = { min: low * factor(name), max: high * factor(name) };
  const [element, input] = numberField(label, unit, { ...limits, value, required: value !== undefined });
  const wrong = h("p", { class: "problem", id });
  const say = (text: string) => {
    wrong.textContent = text;
    input.setAttribute("aria-invalid", String(text !== ""));
    if (text) input.setAttribute("aria-describedby", id);
    else input.removeAttribute("aria-describedby");
  };
  input.addEventListener("input", () => say(""));
  return { element: h("div", {}, element, wrong), input, say };
}

function factor(name: Name): number {
  const { factor }: Asked = asked[name];
  return factor ?? 1;
}
