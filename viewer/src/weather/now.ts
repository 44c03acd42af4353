// The weather that holds now, for people.

import type { WeatherView } from "firn-client";
import { h } from "../dom.ts";
import { compass, decimal, quantity } from "../format.ts";

/** Its values; which of them were worked out is said beside them. */
export function weatherNow({ now, derived }: WeatherView): HTMLElement[] {
  const { wind_direction: from, sun } = now;
  const rows: [string, string, string][] = [
    ["air_temperature", "Air", `${decimal(now.air_temperature, 1)} °C`],
    ["relative_humidity", "Humidity", `${decimal(now.relative_humidity, 0)} %`],
    ["wind_speed", "Wind", `${decimal(now.wind_speed, 1)} m/s${from == null ? "" : `, ${compass(from)}`}`],
    ["cloud_cover", "Clouds", `${decimal(100 * now.cloud_cover, 0)} %`],
    ["snowfall", "Snowfall", quantity(now.snowfall, "mm/h")],
    ["rainfall", "Rainfall", quantity(now.rainfall, "mm/h")],
    ["pressure", "Pressure", `${decimal(now.pressure, 0)} hPa`],
    ["shortwave", "Short wave", `${decimal(now.shortwave, 0)} W/m²`],
    ["longwave", "Long wave", `${decimal(now.longwave, 0)} W/m²`],
    ["sun", "Sun", sun ? place(sun) : "unknown"],
  ];
  return rows.flatMap(([name, label, value]) => [
    h("dt", {}, label, derived.includes(name) ? h("small", {}, " worked out") : null),
    h("dd", {}, value),
  ]);
}

function place({ azimuth, elevation }: { azimuth: number; elevation: number }): string {
  return elevation < 0 ? "below the horizon" : `${decimal(elevation, 0)}° high, ${compass(azimuth)}`;
}
