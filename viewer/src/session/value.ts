// A value that tells when it changes.

/** A value that can be watched. */
export class Value<T> {
  private current: T;
  private readonly watchers: ((value: T) => void)[] = [];

  constructor(value: T) {
    this.current = value;
  }

  get(): T {
    return this.current;
  }

  set(value: T): void {
    if (Object.is(value, this.current)) return;
    this.current = value;
    for (const watcher of this.watchers) watcher(value);
  }

  /** Calls `watcher` with each value from now on, beginning with the present one. */
  watch(watcher: (value: T) => void): void {
    this.watchers.push(watcher);
    watcher(this.current);
  }
}
