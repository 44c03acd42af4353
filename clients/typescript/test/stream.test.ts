// Streams against the real server.

import assert from "node:assert/strict";
import { after, test } from "node:test";

import {
  type Change,
  DisconnectedError,
  Firn,
  HeightField,
  type StreamEvent,
  type StreamState,
} from "../src/index.ts";
import { openLine } from "./line.ts";
import { startServer } from "./server.ts";

const server = await startServer({ args: ["--backend", "cpu"] });
const firn = new Firn(server.url);

after(() => server.stop());

/** Changes of a subscription, one after another. */
class Inbox {
  readonly changes: Change[] = [];
  private waiting: (() => void) | null = null;

  readonly put = (change: Change): void => {
    this.changes.push(change);
    this.waiting?.();
  };

  /** The newest change once it is of a state. */
  async until(wanted: (change: Change) => boolean): Promise<Change> {
    for (;;) {
      const newest = this.changes.at(-1);
      if (newest && wanted(newest)) return newest;
      await new Promise<void>((resolve) => {
        this.waiting = resolve;
      });
    }
  }
}

function assertClose(field: HeightField, heights: Float32Array, tolerance = 0.000501): void {
  assert.equal(field.heights.length, heights.length);
  field.heights.forEach((height, i) => {
    assert.ok(Math.abs(height - (heights[i] as number)) <= tolerance, `sample ${i}: ${height} and ${heights[i]}`);
  });
}

test("a subscription holds the heights that REST tells", async (t) => {
  const grid = { width: 50, depth: 20, height: 30 };
  await firn.createSession({ id: "watched", grid, paused: true, initial_snow: [{ depth: 3 }] });
  const session = firn.session("watched");
  const stream = session.stream();
  t.after(() => stream.close());
  const [whole, coarse, part] = [new Inbox(), new Inbox(), new Inbox()];
  stream.subscribe({ colliders: true, max_rate: 60 }, whole.put);
  stream.subscribe({ stride: 4, max_rate: 60 }, coarse.put);
  const moved = stream.subscribe({ region: { column_x: 3, column_z: 3, width: 4, depth: 4 }, max_rate: 60 }, part.put);
  await Promise.all([whole, coarse, part].map((inbox) => inbox.until(({ field }) => field.complete)));

  const fall = { depth: 0.5, region: { x: 1, z: 1, width: 3, depth: 1 } };
  const { seq } = await stream.command("snowfall", fall);
  await stream.command("collider.put", {
    collider: { id: "sledge", mass: 50, shape: { type: "disk", radius: 0.4 }, position: { x: 5, z: 2 } },
  });
  const told = await whole.until((change) => change.seq >= seq && change.colliders?.length === 1);
  assertClose(told.field, (await session.heights()).heights);
  const { field } = await coarse.until((change) => change.seq >= seq);
  assertClose(field, (await session.heights({ stride: 4 })).heights);

  const region = { column_x: 8, column_z: 0, width: 24, depth: 8 };
  assert.equal(moved.update(region)?.complete, false);
  const after = await part.until((change) => change.field.complete);
  assert.deepEqual(after.field.region, region);
  assertClose(after.field, (await session.heights(region)).heights);

  await assert.rejects(stream.command("snowfall", { depth: -1 }), { status: 422 });
  stream.close();
  assert.equal(stream.state.name, "closed");
  await assert.rejects(stream.command("snowfall", { depth: 1 }), DisconnectedError);
});

test("a subscription holds the ground where it is wanted", async (t) => {
  const grid = { width: 20, depth: 12, height: 10 };
  const slope = Float32Array.from({ length: 20 * 12 }, (_, i) => (i % 20) / 4 - Math.floor(i / 20));
  const heights = [...slope];
  await firn.createSession({ id: "slope", grid, paused: true, initial_snow: [{ depth: 1 }], terrain: { heights } });
  const session = firn.session("slope");
  const stream = session.stream();
  t.after(() => stream.close());
  const [whole, coarse, part, bare] = [new Inbox(), new Inbox(), new Inbox(), new Inbox()];
  stream.subscribe({ terrain: true, max_rate: 60 }, whole.put);
  stream.subscribe({ terrain: true, stride: 4, max_rate: 60 }, coarse.put);
  const near = { column_x: 0, column_z: 0, width: 8, depth: 8 };
  const moved = stream.subscribe({ terrain: true, region: near, max_rate: 60 }, part.put);
  stream.subscribe({ max_rate: 60 }, bare.put);
  const all = [whole, coarse, part, bare].map((inbox) => inbox.until(({ field }) => field.complete));
  const told = (await Promise.all(all)).map(({ field, terrain, level }) => [field.ground.length, terrain.length, level]);
  assert.deepEqual(told, [[240, 6, false], [15, 6, false], [64, 1, false], [0, 0, false]]);
  const { field } = whole.changes[0] as Change;
  assert.deepEqual(field.ground, slope);
  assert.deepEqual((coarse.changes[0] as Change).field.ground, (await session.terrain({ stride: 4 })).heights);

  moved.update({ ...near, width: 16 });
  const after = await part.until((change) => change.field.complete);
  assert.deepEqual(after.field.ground, (await session.terrain({ ...near, width: 16 })).heights);
  assert.equal(after.terrain.length, 1);

  await session.clear({ depth: 0.5 });
  assert.equal((await whole.until(() => whole.changes.length > 1)).terrain.length, 0);
  await session.putTerrain(slope.map((elevation) => 1 - 2 * elevation));
  const laid = await whole.until(({ terrain }) => terrain.length > 0 && whole.changes.length > 1);
  assert.deepEqual([laid.tiles.length, laid.terrain.length], [0, 6]);
  assert.deepEqual(field.ground, slope.map((elevation) => 1 - 2 * elevation));
  await session.putTerrain(new Float32Array(240));
  await whole.until(({ level }) => level);
  assert.deepEqual(field.ground, new Float32Array(240));
});

test("events come where they are wanted, and watches tell each crossing", async (t) => {
  const grid = { width: 16, depth: 8, height: 30 };
  await firn.createSession({ id: "events", grid, paused: true, initial_snow: [{ depth: 1 }] });
  const session = firn.session("events");
  const events: StreamEvent[] = [];
  let heard = () => {};
  const stream = session.stream({
    onEvent: (event) => {
      events.push(event);
      heard();
    },
  });
  t.after(() => stream.close());
  const next = async (): Promise<StreamEvent> => {
    while (events.length === 0) {
      await new Promise<void>((resolve) => {
        heard = resolve;
      });
    }
    return events.shift() as StreamEvent;
  };
  const holds = async (id: string) => {
    const event = await next();
    assert.ok(event.event === "watch" && event.id === id, JSON.stringify(event));
    return event.holds;
  };
  const region = { column_x: 0, column_z: 0, width: 8, depth: 8 };
  const watch = [{ id: "deep", region, above: 1.5 }];
  const near = stream.subscribe({ region, max_rate: 60, watch }, () => {});
  assert.equal(await holds("deep"), false);
  // A clearing of the other tile is not told.
  await session.clear({ depth: 0.5, region: { x: 1.6, z: 0, width: 1.6, depth: 1.6 } });
  const { fallen_mass } = await session.snowfall({ depth: 0.25, region: { x: 0, z: 0, width: 1.6, depth: 1.6 } });
  const event = await next();
  assert.ok(event.event === "snowfall" && event.fallen_mass === fallen_mass, JSON.stringify(event));
  near.want({ events: false, watch: [{ id: "all", below: 0.1 }] });
  assert.equal(await holds("all"), false);
  await session.clear({ depth: 0 });
  assert.equal(await holds("all"), true);
});

test("weather comes and is told over the stream", async (t) => {
  const grid = { width: 4, depth: 4, height: 20 };
  await firn.createSession({ id: "weather", physics: "alpine", grid, paused: true, initial_snow: [{ depth: 1 }] });
  const session = firn.session("weather");
  const told: StreamEvent[] = [];
  const stream = session.stream({ onEvent: (event) => told.push(event) });
  t.after(() => stream.close());
  const inbox = new Inbox();
  stream.subscribe({ max_rate: 60, events: ["weather"] }, inbox.put);
  await inbox.until(({ field }) => field.complete);
  const rain = { air_temperature: 6, relative_humidity: 95, wind_speed: 3, rainfall: 6, shortwave: 50 };
  const { seq } = await stream.command("weather", rain);
  const { now } = await session.weather();
  while (told.length === 0) await new Promise((resolve) => setTimeout(resolve, 10));
  const event = told[0] as StreamEvent;
  assert.ok(event.event === "weather" && event.seq === seq, JSON.stringify(event));
  assert.deepEqual(event.now, now);
  await assert.rejects(stream.command("weather", { ...rain, wind_speed: -1 }), { status: 422 });
});

test("a stream that was cut off resumes, and gets what it missed", async (t) => {
  const grid = { width: 64, depth: 64, height: 30 };
  await firn.createSession({ id: "cut", grid, paused: true, initial_snow: [{ depth: 2 }] });
  const session = firn.session("cut");
  const line = await openLine(server.port);
  t.after(() => line.close());
  const states: string[] = [];
  const stream = new Firn(line.url).session("cut").stream({ onState: ({ name }) => states.push(name) });
  t.after(() => stream.close());
  const inbox = new Inbox();
  stream.subscribe({ max_rate: 60 }, inbox.put);
  await inbox.until(({ field }) => field.complete);

  line.cut();
  const { seq } = await session.snowfall({ depth: 0.3, region: { x: 0, z: 0, width: 1, depth: 1 } });
  line.mend();
  const change = await inbox.until((change) => change.recovered !== null);
  assert.equal(change.recovered, true);
  assert.ok(change.seq >= seq);
  assert.equal(change.tiles.length, 1);
  assertClose(change.field, (await session.heights()).heights);
  assert.deepEqual(states.slice(0, 3), ["open", "waiting", "connecting"]);
  assert.equal(stream.state.name, "open");
});

test("a stream ends where its session does, and where there is none", async () => {
  await firn.createSession({ id: "short" });
  const ended = (id: string) =>
    new Promise<StreamState>((resolve) => {
      firn.session(id).stream({
        onState: (state) => {
          if (state.name === "open") firn.session(id).delete();
          if (state.name === "closed") resolve(state);
        },
      });
    });
  await ended("short");
  const state = await ended("nobody");
  assert.equal(state.name === "closed" && state.problem?.status, 404);
});

test("a stream outlives its server", async (t) => {
  const first = await startServer({ args: ["--backend", "cpu", "--demo"] });
  const session = new Firn(first.url).session("demo");
  const states: StreamState[] = [];
  const stream = session.stream({ onState: (state) => states.push(state) });
  t.after(() => stream.close());
  const inbox = new Inbox();
  stream.subscribe({}, inbox.put);
  await inbox.until(({ field }) => field.complete);
  await first.stop("SIGKILL");
  const second = await startServer({ args: ["--backend", "cpu", "--demo"], port: first.port });
  const change = await inbox.until((change) => change.recovered !== null);
  assert.equal(change.field.complete, true);
  assert.ok(states.some((state) => state.name === "waiting"));
  await second.stop();
});
