// The least and the greatest of many numbers.

/** The least and the greatest; 0 and 0 where there is none. */
export function extremes(numbers: Float32Array | null): [number, number] {
  if (!numbers || numbers.length === 0) return [0, 0];
  let [low, high] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];
  for (const number of numbers) {
    low = Math.min(low, number);
    high = Math.max(high, number);
  }
  return [low, high];
}
