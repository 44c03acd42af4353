// From values to places on paper.

/** A linear scale. */
export interface Scale {
  (value: number): number;
  /** Round values to write on the axis. */
  ticks: number[];
}

/** Spreads values from `low` to `high` over places from `from` to `to`, with about `count` round values. */
export function scale(low: number, high: number, from: number, to: number, count: number): Scale {
  const span = high - low || 1;
  const place = (value: number) => from + ((value - low) / span) * (to - from);
  return Object.assign(place, { ticks: ticks(Math.min(low, low + span), Math.max(low, low + span), count) });
}

/** Multiples of 1, 2 or 5 times a power of ten. */
function ticks(low: number, high: number, count: number): number[] {
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = ([1, 2, 5, 10].find((factor) => factor * power >= rough * 0.999) ?? 10) * power;
  const first = Math.ceil(low / step - 1e-9);
  const last = Math.floor(high / step + 1e-9);
  return Array.from({ length: last - first + 1 }, (_, i) => (first + i) * step);
}
