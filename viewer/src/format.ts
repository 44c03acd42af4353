// Numbers and times for people.

import type { SessionView } from "firn-client";

/** A number with a fixed count of decimals, and a true minus sign. */
export function decimal(value: number, digits: number): string {
  const text = value.toFixed(digits);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

/** A number with three significant digits, and its unit. */
export function quantity(value: number, unit: string): string {
  const digits = value === 0 ? 0 : Math.max(0, 2 - Math.floor(Math.log10(Math.abs(value))));
  return `${decimal(value, Math.min(digits, 3))}\u202f${unit}`;
}

/** A mass, in tonnes where it has many kilograms. */
export function mass(kilograms: number): string {
  return kilograms >= 10_000 ? quantity(kilograms / 1000, "t") : quantity(kilograms, "kg");
}

/** A duration as h:mm:ss or m:ss. */
export function duration(seconds: number): string {
  const whole = Math.floor(seconds);
  const [hours, minutes, rest] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  const two = (n: number) => String(n).padStart(2, "0");
  return hours > 0 ? `${hours}:${two(minutes)}:${two(rest)}` : `${minutes}:${two(rest)}`;
}

/** The date and the time of day a while [s] after a start as RFC 3339 writes it, in the zone of that start. */
export function moment(start: string, seconds: number): string {
  const text = start.toUpperCase();
  const [, sign, hours, minutes] = /([+-])(\d\d):(\d\d)$/.exec(text) ?? [];
  const ahead = (sign === "-" ? -1 : 1) * (60 * Number(hours ?? 0) + Number(minutes ?? 0));
  const local = new Date(Date.parse(text) + 1000 * seconds + 60_000 * ahead);
  if (Number.isNaN(local.valueOf())) return duration(seconds);
  const zone = ahead === 0 ? "" : `${sign === "-" ? "−" : "+"}${Number(hours)}${minutes === "00" ? "" : `:${minutes}`}`;
  return `${local
    .toISOString()
    .replace("T", " ")
    .replace(/:\d\d\.\d+Z$/, "")} UTC${zone}`;
}

/** What time it is in a session: a date where its site has a start, else how long it has lasted. */
export function clock({ site, sim_time }: Pick<SessionView, "site" | "sim_time">): string {
  return site?.start ? moment(site.start, sim_time) : duration(sim_time);
}

/** The point of the compass nearest to an angle from the north over the east [°]. */
export function compass(degrees: number): string {
  return ["N", "NE", "E", "SE", "S", "SW", "W", "NW"][Math.round(degrees / 45) % 8] as string;
}
