// What time it is in a session, where the wind comes from, and hardness by hand.

import assert from "node:assert/strict";
import { test } from "node:test";
import { clock, compass, moment } from "../src/format.ts";
import { rank, runs, wetness } from "../src/profile/hand.ts";

test("a date is told in the zone of the start", () => {
  for (const [start, seconds, told] of [
    ["2005-10-01T00:00:00Z", 0, "2005-10-01 00:00 UTC"],
    ["2005-12-31T23:30:00Z", 1800, "2006-01-01 00:00 UTC"],
    ["2005-10-01T02:00:00+02:00", 900, "2005-10-01 02:15 UTC+2"],
    ["2005-09-30t17:00:00.5-03:30", 59.4, "2005-09-30 17:00 UTC−3:30"],
  ] as const) {
    assert.equal(moment(start, seconds), told);
  }
  const pressure = 1013.25;
  const site = { pressure, temperature_height: 2, wind_height: 10, heights_above: "snow" } as const;
  const told = (start?: string) =>
    clock({ site: { ...site, soil: [5, 5, 5, 5], ...(start ? { start } : {}) }, sim_time: 3661 });
  assert.equal(told(), "1:01:01");
  assert.equal(told("2005-10-01T00:00:00Z"), "2005-10-01 01:01 UTC");
  assert.equal(clock({ sim_time: 61 }), "1:01");
  assert.equal(moment("2005-10-01T00:00:00Z", 1e16), "2777777777777:46:40");
});

test("a direction is that of the nearest point of the compass", () => {
  const told = [0, 22, 23, 90, 180, 247, 337, 338, 360].map(compass);
  assert.deepEqual(told, ["N", "N", "NE", "E", "S", "SW", "NW", "N", "N"]);
});

test("hand hardness is told once where layers on end have the same, and wetness as a part of the volume", () => {
  const layer = { bottom: 0, thickness: 0.1, density: 300, temperature: 0, hardness: 1, stress: 1, mass: 1 };
  const hands = ["P", "P", "K", "F"] as const;
  assert.equal(runs(hands.map((hand_hardness) => ({ ...layer, hand_hardness }))), "pencil, knife, fist");
  assert.equal(runs([layer]), "");
  assert.deepEqual(
    ["F", "4F", "I"].map((hand) => rank(hand as "F")),
    [1, 2, 6],
  );
  assert.equal(wetness({ ...layer, liquid_water: 3 }), 3);
  assert.equal(wetness(layer), 0);
});
