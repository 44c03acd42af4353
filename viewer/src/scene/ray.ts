// Where a ray meets the snow or a body. Plain numbers, no graphics.

/** A ray: where it begins, and a direction of length 1. */
export interface Ray {
  origin: readonly [number, number, number];
  direction: readonly [number, number, number];
}

/** The distance at which a ray enters a box, or null. */
export function meetBox({ origin, direction }: Ray, low: readonly number[], high: readonly number[]): number | null {
  let [near, far] = [0, Number.POSITIVE_INFINITY];
  for (const axis of [0, 1, 2] as const) {
    const inverse = 1 / direction[axis];
    const a = ((low[axis] as number) - origin[axis]) * inverse;
    const b = ((high[axis] as number) - origin[axis]) * inverse;
    near = Math.max(near, Math.min(a, b));
    far = Math.min(far, Math.max(a, b));
  }
  return near <= far ? near : null;
}

/**
 * The distance at which a ray meets a surface of heights over a rectangle, or null. Goes along it in steps of `step` [m], then
 * halves the last one.
 */
export function meetSurface(
  ray: Ray,
  box: { low: readonly number[]; high: readonly number[] },
  heightAt: (x: number, z: number) => number,
  step: number,
): number | null {
  const enters = meetBox(ray, box.low, box.high);
  if (enters === null) return null;
  const [ox, oy, oz] = ray.origin;
  const [dx, dy, dz] = ray.direction;
  const [x0, , z0] = box.low as readonly [number, number, number];
  const [x1, , z1] = box.high as readonly [number, number, number];
  const isBelow = (at: number) => oy + at * dy <= heightAt(ox + at * dx, oz + at * dz);
  const isOver = (x: number, z: number) => x >= x0 - step && x <= x1 + step && z >= z0 - step && z <= z1 + step;
  for (let at = enters; isOver(ox + at * dx, oz + at * dz) && oy + at * dy > -step; at += step) {
    if (!isBelow(at)) continue;
    let [above, below] = [Math.max(0, at - step), at];
    for (let i = 0; i < 16; i++) {
      const middle = (above + below) / 2;
      if (isBelow(middle)) below = middle;
      else above = middle;
    }
    return below;
  }
  return null;
}
