// REST against the real server.

import assert from "node:assert/strict";
import { after, test } from "node:test";

import { type ColliderSpec, Firn, ProblemError, type StampSpec } from "../src/index.ts";
import { startServer } from "./server.ts";

const server = await startServer({ args: ["--backend", "cpu"] });
const firn = new Firn(server.url);

after(() => server.stop());

test("a session's life over REST", async () => {
  const created = await firn.createSession({ id: "life", paused: true, grid: { width: 16, depth: 12, height: 30 } });
  assert.equal(created.state, "paused");
  assert.ok(created.token.length > 0 && created.viewer_token.length > 0);
  const session = firn.session("life");

  const { fallen_mass } = await session.snowfall({ depth: 4, temperature: -8 }, "once");
  assert.ok(Math.abs(fallen_mass - 4 * 20 * 16 * 12 * 0.04) < 1e-6);
  await session.setAirTemperature(-12);
  const crate = { mass: 300, shape: { type: "box", width: 1, depth: 1 }, position: { x: 1.5, z: 1 } } as const;
  const put = await session.putCollider({ id: "crate", ...crate });
  assert.equal(put.id, "crate");
  assert.ok((await session.putCollider(crate)).id.length > 0);
  await session.batchColliders({ delete: ["crate"] });
  assert.equal((await session.colliders()).items.length, 1);

  const stepped = await session.step({ until_settled: true, max_seconds: 600 });
  assert.ok(stepped.settled && stepped.tick > 0 && stepped.air_temperature === -12);
  assert.deepEqual([stepped.state, stepped.progress], ["paused", null]);
  await assert.rejects(session.endStep(), { status: 409 });
  const { heights } = await session.heights();
  assert.equal(heights.length, 16 * 12);
  assert.ok(Math.abs((await session.height(0.1, 0.1)).height - (heights[0] as number)) < 1e-6);
  const ground = Float32Array.from({ length: 16 * 12 }, (_, i) => i / 8);
  assert.ok((await session.putTerrain(ground)).seq > 0);
  assert.deepEqual((await session.terrain()).heights, ground);
  assert.equal((await session.get()).terrain, true);
  const column = await session.column(0, 0);
  assert.ok(column.layers.length > 0 && Math.abs(column.height - (heights[0] as number)) < 1e-6);
  const cells = await session.cells({ width: 2, depth: 3, height: 4, fields: ["density", "hardness"] });
  assert.equal(cells.content.length, 24);
  assert.equal(cells.fields.hardness?.length, 24);
  assert.equal((await session.mass()).imbalance_quanta, 0);
  assert.ok((await session.usage()).memory_bytes.device > 0);
  const { probes } = await session.probe([{ x: 3, z: 2, mass: 80, area: 0.05 }]);
  assert.ok((probes[0]?.sink_depth ?? 0) > 0);
  const load = { mass: 80, area: 0.05 };
  const { fields } = await session.sample({ points: [[3, 2], [1, 1]], fields: ["sink", "normal"], load });
  assert.equal(fields.sink?.[0], probes[0]?.sink_depth);
  assert.equal(fields.normal?.[1]?.length, 3);
  assert.equal(fields.depth, null);

  const { digest } = await session.digest();
  await firn.restoreSession(await session.snapshot(), "copy");
  assert.equal((await firn.session("copy").digest()).digest, digest);
  const names: string[] = [];
  for await (const { id } of firn.sessions()) names.push(id);
  assert.deepEqual(names, ["copy", "life"]);

  const kept = await session.putCheckpoint("deep");
  assert.deepEqual(await session.checkpoints(), [kept]);
  const saved = await session.snapshot();
  await session.clear({ depth: 1 });
  assert.ok((await session.get()).summary.max_height > 1, "what is under the crate stays");
  for (const { id } of (await session.colliders()).items) await session.deleteCollider(id);
  await session.clear({ depth: 1 });
  assert.ok((await session.get()).summary.max_height <= 1);
  assert.equal((await session.reset("deep")).tick, kept.tick);
  assert.equal((await session.digest()).digest, digest);
  await session.deleteCheckpoint("deep");
  await assert.rejects(session.reset("deep"), { status: 404 });
  await session.clear({ depth: 1 });
  await session.resetToSnapshot(saved);
  assert.equal((await session.digest()).digest, digest);
  assert.equal((await session.reset()).tick, 0);
  await session.delete();
  await firn.session("copy").delete();
});

test("a refusal names the field", async () => {
  const refused = firn.createSession({ air_temperature: 4 });
  await assert.rejects(refused, (error) => {
    assert.ok(error instanceof ProblemError);
    assert.equal(error.status, 422);
    assert.equal(error.problem.errors[0]?.pointer, "/air_temperature");
    assert.match(error.message, /-40/);
    return true;
  });
  await assert.rejects(firn.session("nobody").get(), { status: 404 });
});

test("objects of any shape, and batches that skip errors", async () => {
  const grid = { width: 16, depth: 12, height: 30 };
  await firn.createSession({ id: "shapes", paused: true, grid, initial_snow: [{ depth: 2 }] });
  const session = firn.session("shapes");
  const shape = { type: "wheel", width: 0.2, radius: 0.3 } as const;
  const cart: ColliderSpec = {
    id: "cart",
    mass: 60,
    footprints: [
      { shape, offset: { x: -0.5, z: 0 } },
      { shape, offset: { x: 0.5, z: 0 } },
    ],
    position: { x: 1, z: 1 },
    heading: 45,
  };
  const put = await session.putCollider(cart);
  assert.ok(!put.shape && put.footprints?.length === 2 && put.heading === 45);
  assert.ok(Math.abs(put.pressure * put.contact_area - 60 * 9.81) < 1e-3);

  const lost: ColliderSpec = { id: "lost", mass: 1, shape, position: { x: 99, z: 1 } };
  const batch = { put: [{ ...cart, airborne: true }, lost], delete: ["nobody"] };
  await assert.rejects(session.batchColliders(batch), { status: 422 });
  const { results } = await session.batchColliders({ ...batch, on_error: "skip" });
  assert.deepEqual(
    results?.put.map(({ id, result, errors }) => [id, result, errors?.[0]?.pointer]),
    [
      ["cart", "replaced", undefined],
      ["lost", "skipped", "/put/1/position"],
    ],
  );
  assert.deepEqual(results?.delete, [{ id: "nobody", result: "absent" }]);
  const { airborne, contact_area, pressure } = await session.collider("cart");
  assert.deepEqual([airborne, contact_area, pressure], [true, 0, 0]);
});

test("stamps leave prints", async () => {
  const grid = { width: 16, depth: 12, height: 30 };
  await firn.createSession({ id: "prints", preset: "game", paused: true, grid, initial_snow: [{ depth: 1 }] });
  const session = firn.session("prints");
  const foot: StampSpec = { shape: { type: "box", width: 0.4, depth: 0.6 }, position: { x: 1, z: 1.1 }, mass: 80 };
  const { stamps, seq } = await session.stamp([foot], "one step");
  const { depth, bottom } = stamps[0] ?? { depth: 0, bottom: 0 };
  assert.ok(depth > 0.05);
  const { heights } = await session.heights();
  assert.ok(Math.abs(bottom - (heights[5 * 16 + 5] as number)) < 1e-6);
  assert.equal((await session.stamp([foot], "one step")).seq, seq);
  assert.deepEqual((await session.heights()).heights, heights);
  assert.equal((await session.colliders()).items.length, 0);
  await assert.rejects(session.stamp([{ ...foot, pressure: 1 }]), { status: 422 });
});

test("alpine snow and its weather", async () => {
  const grid = { width: 16, depth: 12, height: 30 };
  const site = { latitude: 46.8, longitude: 9.8, start: "2026-03-20T11:00:00Z" };
  const mild = { air_temperature: 5, relative_humidity: 70, wind_speed: 2 };
  const initial_snow = [{ depth: 1, density: 300 }];
  await firn.createSession({ id: "alp", physics: "alpine", paused: true, grid, site, initial_snow, weather: mild });
  const session = firn.session("alp");
  assert.deepEqual((await session.weather()).weather, mild);
  await session.setWeather({ series: [{ at: 0, ...mild, shortwave: 600 }] });
  const { now, derived } = await session.weather();
  assert.deepEqual([now.shortwave, derived.includes("shortwave"), derived.includes("longwave")], [600, false, true]);
  await session.patch({ time_scale: 3600 });
  await session.step({ seconds: 6 * 3600 });
  const [swe, water] = await Promise.all(
    (["snow_water_equivalent", "liquid_water"] as const).map(async (quantity) => (await session.heights({ quantity })).heights),
  );
  const column = await session.column(0, 0);
  assert.ok(Math.abs((swe?.[0] as number) - column.snow_water_equivalent) < 1e-3);
  const wet = column.layers.reduce((sum, layer) => sum + (layer.liquid_water ?? 0), 0);
  assert.ok(wet > 0 && Math.abs((water?.[0] as number) - wet) < 1e-3);
  assert.ok(column.layers.every(({ hand_hardness }) => hand_hardness));
  await assert.rejects(session.setWeather({ ...mild, wind_speed: -1 }), { status: 422 });
  await firn.createSession({ id: "thesis", paused: true, grid });
  assert.equal((await firn.session("thesis").get()).physics, undefined);
  await assert.rejects(firn.session("thesis").weather(), { status: 409 });
});
