// Numbers for people.

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
