// Objects that move and carry snow, over REST and the stream, against the real server.

import assert from "node:assert/strict";
import { after, test } from "node:test";

import { type Collider, type ColliderSpec, Firn, type Session, type Stamp } from "../src/index.ts";
import { startServer } from "./server.ts";

const server = await startServer({ args: ["--backend", "cpu"] });
const firn = new Firn(server.url);

after(() => server.stop());

const ski: ColliderSpec = {
  id: "ski",
  mass: 60,
  shape: { type: "box", width: 0.2, depth: 0.2 },
  position: { x: 0.55, z: 1 },
};

/** 6 m × 2 m of snow that gives way at once, at 20 ticks a second. */
async function soft(id: string): Promise<Session> {
  await firn.createSession({
    id,
    grid: { width: 60, depth: 20, height: 20, cell_size: 0.1 },
    preset: "game",
    pressing: 0,
    paused: true,
    tick_rate: 20,
    initial_snow: [{ depth: 1 }],
  });
  return firn.session(id);
}

function isAt({ position }: Collider, x: number, z: number): boolean {
  return Math.abs(position.x - x) < 1e-6 && Math.abs(position.z - z) < 1e-6;
}

function assertAt(collider: Collider, x: number, z: number): void {
  assert.ok(isAt(collider, x, z), JSON.stringify(collider));
}

/** How deep the row of columns at z = 1 m is pressed. */
async function dents(session: Session): Promise<number[]> {
  const { heights } = await session.heights();
  return [...heights.subarray(600, 660)].map((height) => (heights[0] as number) - height);
}

test("an object moves with its velocity and turns", async () => {
  const session = await soft("velocity");
  const put = await session.putCollider({ ...ski, velocity: { x: 2, z: 0 }, turn_rate: 90 });
  assertAt(put, 0.55, 1);
  assert.deepEqual([put.velocity, put.turn_rate], [{ x: 2, z: 0 }, 90]);
  await session.step({ ticks: 20 });
  const moved = await session.collider("ski");
  assertAt(moved, 2.55, 1);
  assert.ok(Math.abs(moved.heading - 90) < 1e-6 && !moved.resting);
  const stopped = await session.patchCollider("ski", { velocity: { x: 0, z: 0 }, turn_rate: 0 });
  assert.deepEqual([stopped.velocity, stopped.turn_rate], [undefined, undefined]);
  await assert.rejects(session.patchCollider("ski", { velocity: { x: 80, z: 80 } }), /velocity/);
});

test("an object follows a path, then its velocity", async () => {
  const session = await soft("path");
  const path: [number, number][] = [[1.55, 1], [1.55, 1.5]];
  const put = await session.putCollider({ ...ski, path, over: 1.5 });
  assert.ok(Math.abs((put.speed ?? 0) - 1) < 1e-9);
  await session.step({ ticks: 25 });
  const underway = await session.collider("ski");
  assertAt(underway, 1.55, 1.25);
  assert.deepEqual(underway.path, [[1.55, 1.5]]);
  await session.patchCollider("ski", { path: [[1.55, 0.25]], over: 1, velocity: { x: 1, z: 0 } });
  await session.step({ ticks: 30 });
  const there = await session.collider("ski");
  assertAt(there, 2.05, 0.25);
  assert.deepEqual([there.path, there.speed], [undefined, undefined]);
});

test("a sweep leaves a track and a lift leaves none", async () => {
  const session = await soft("sweep");
  await session.putCollider(ski);
  const swept = await session.patchCollider("ski", { position: { x: 2.55, z: 1 }, heading: 90, sweep: true });
  assertAt(swept, 0.55, 1);
  assert.deepEqual([swept.path, swept.turn_to], [[[2.55, 1]], 90]);
  await session.step({ ticks: 1 });
  const there = await session.collider("ski");
  assertAt(there, 2.55, 1);
  assert.equal(there.heading, 90);
  await session.patchCollider("ski", { position: { x: 4.55, z: 1 } });
  await session.step({ ticks: 1 });
  const pressed = await dents(session);
  assert.ok(pressed.slice(6, 26).every((dent) => dent > 0.05), String(pressed));
  assert.ok(pressed.slice(28, 43).every((dent) => dent < 0.01), String(pressed));
  await assert.rejects(session.patchCollider("ski", { sweep: true }), { status: 422 });
});

test("snow lies on objects, and clearings spare what is under them", async () => {
  const session = await soft("burden");
  const shape = { type: "box", width: 1, depth: 1 } as const;
  await session.putCollider({ id: "roof", mass: 50, shape, position: { x: 1, z: 1 } });
  await session.putCollider({ id: "fence", mass: 50, shape, position: { x: 4, z: 1 }, shelters: false });
  await session.snowfall({ depth: 0.3, density: 60 });
  const roof = await session.collider("roof");
  const fence = await session.collider("fence");
  assert.ok(Math.abs(roof.burden - 18) < 0.02);
  assert.deepEqual([fence.shelters, fence.burden], [false, 0]);
  assert.ok(Math.abs(roof.pressure * roof.contact_area - 9.81 * (50 + roof.burden)) < 0.01);
  const mass = await session.mass();
  assert.deepEqual([mass.carried, mass.imbalance_quanta], [roof.burden, 0]);
  await session.clear({ depth: 0 });
  const { heights } = await session.heights();
  assert.ok((heights[610] as number) > 0.1 && heights[625] === 0);
  await session.patchCollider("roof", { position: { x: 2.5, z: 1 } });
  assert.ok((await session.collider("roof")).burden < 0.01);
  assert.equal((await session.mass()).imbalance_quanta, 0);
});

test("an object is patched over the stream", async (t) => {
  const session = await soft("streamed");
  await session.putCollider(ski);
  const objects: Collider[] = [];
  let told = () => {};
  const stream = session.stream({ onState: () => told() });
  t.after(() => stream.close());
  stream.subscribe({ colliders: true, max_rate: 60 }, ({ colliders }) => {
    objects.push(...(colliders ?? []));
    told();
  });
  const until = async (wanted: () => boolean) => {
    while (!wanted()) {
      await new Promise<void>((resolve) => {
        told = resolve;
      });
    }
  };
  await until(() => objects.length > 0);
  type Reply = Stamp & { collider: Collider };
  const patch = { velocity: { x: 1, z: 0 }, path: [[1.05, 1]], over: 0.5 };
  const ack = await stream.command<Reply>("collider.patch", { collider: "ski", patch });
  assert.deepEqual([ack.collider.path, ack.collider.velocity], [[[1.05, 1]], { x: 1, z: 0 }]);
  await session.step({ ticks: 20 });
  await until(() => isAt(objects.at(-1) as Collider, 1.55, 1));
  const sweep = { position: { x: 3.05, z: 1 }, sweep: true };
  await stream.command("collider.patch", { collider: "ski", patch: sweep });
  await session.step({ ticks: 1 });
  await until(() => isAt(objects.at(-1) as Collider, 3.05, 1));
  assert.ok((await dents(session)).slice(7, 30).every((dent) => dent > 0.05));
  const refused = stream.command("collider.patch", { collider: "ski", patch: { sweep: true } });
  await assert.rejects(refused, (error: { problem: { errors: { pointer: string }[] } }) => {
    assert.equal(error.problem.errors[0]?.pointer, "/patch/sweep");
    return true;
  });
});
