// The stream of a session: a WebSocket that connects again by itself and resumes.

import { DecodeError, decode } from "./height-stream.ts";
import { ProblemError } from "./http.ts";
import { type Change, Subscription, type Watch } from "./subscription.ts";
import type { AckMessage, ErrorMessage, PongMessage } from "./generated.ts";
import type { Problem, Stamp, StreamEvent, Welcome } from "./types.ts";

/** How a stream stands. */
export type StreamState =
  /** Connecting, for the first time or again. */
  | { name: "connecting" }
  /** Connected, and heard of within the last seconds. */
  | { name: "open" }
  /** Not connected; tries again at `retry_at` (milliseconds, as `Date.now()`). */
  | { name: "waiting"; reason: string; retry_at: number }
  /** Ended for good. */
  /** For good. `problem` where the server refused, `code` where it closed the stream: 3500 for a token that no longer holds. */
  | { name: "closed"; reason: string; problem: Problem | null; code: number | null };

/** What to do with what a stream tells. */
export interface StreamOptions {
  onState?: (state: StreamState) => void;
  onWelcome?: (welcome: Welcome) => void;
  /**
   * Called with events and with how watches stand. Where it is there, subscriptions want all events of their region unless their
   * `events` say otherwise.
   */
  onEvent?: (event: StreamEvent) => void;
  /** Something other than a command was refused, such as a subscription. */
  onProblem?: (problem: Problem) => void;
}

/** The connection was lost before an answer came: what was asked for may have happened or not. */
export class DisconnectedError extends Error {
  constructor(reason: string) {
    super(reason);
    this.name = "DisconnectedError";
  }
}

interface Pending {
  resolve: (reply: never) => void;
  reject: (error: Error) => void;
}

/** Waiting time before a connection is tried again [ms]: doubles from the first to the last. */
const FIRST_WAIT = 250;
const LONGEST_WAIT = 5000;
/** After so much silence [ms] a sign of life is asked for, and waited for as long. */
const SILENCE = 5000;
/** Close codes from here on mean that connecting again won't help. */
const FOR_GOOD = 3500;

/** A stream. Made by `Session.stream`. */
export class Stream {
  /** How it stands. */
  state: StreamState = { name: "connecting" };
  private readonly url: URL;
  private readonly diagnose: () => Promise<ProblemError | null>;
  private readonly options: StreamOptions;
  private readonly subscriptions = new Map<number, Subscription>();
  private readonly pending = new Map<number, Pending>();
  private welcome: Welcome | null = null;
  private socket: WebSocket | null = null;
  private nextId = 1;
  private failures = 0;
  /** When something came last, and since when a sign of life is waited for. */
  private heard = 0;
  private asked: number | null = null;
  private retry: ReturnType<typeof setTimeout> | undefined;
  private readonly watchdog: ReturnType<typeof setInterval>;

  constructor(url: URL, diagnose: () => Promise<ProblemError | null>, options: StreamOptions) {
    this.url = url;
    this.diagnose = diagnose;
    this.options = options;
    this.watchdog = setInterval(() => this.checkLife(), SILENCE / 2);
    this.connect();
  }

  /** Watches a region; `onChange` is called once its heights are known, and with everything that changes. */
  subscribe(watch: Watch, onChange: (change: Change) => void): Subscription {
    const id = this.nextId++;
    const wish = { events: this.options.onEvent !== undefined, ...watch };
    const subscription = new Subscription(id, wish, (message) => this.tell(message), onChange);
    this.subscriptions.set(id, subscription);
    if (this.welcome && this.state.name === "open") this.tell(subscription.begin(this.welcome));
    return subscription;
  }

  /** Ends a subscription. */
  unsubscribe(subscription: Subscription): void {
    this.subscriptions.delete(subscription.id);
    subscription.close();
  }

  /**
   * Sends a change, named and filled as in api/asyncapi.yaml: `command("snowfall", { depth: 0.2 })`, or
   * `command("collider.patch", { collider: "sledge", patch: { mass: 80 } })`. Throws a ProblemError where it is refused, and a
   * DisconnectedError where no answer came.
   */
  command<Reply extends Stamp = Stamp>(op: string, fields: object = {}): Promise<Reply> {
    if (this.state.name !== "open") return Promise.reject(new DisconnectedError("the stream is not connected"));
    const id = this.nextId++;
    this.tell({ op, id, ...fields });
    return new Promise((resolve, reject) => this.pending.set(id, { resolve, reject }));
  }

  /** Connects at once where it waits to try again. */
  retryNow(): void {
    if (this.state.name !== "waiting") return;
    clearTimeout(this.retry);
    this.connect();
  }

  /** Ends it. */
  close(): void {
    this.end("closed by this client", null);
  }

  private connect(): void {
    if (this.state.name !== "connecting") this.become({ name: "connecting" });
    const socket = new WebSocket(this.url, ["firn.v1.bin"]);
    socket.binaryType = "arraybuffer";
    socket.onmessage = ({ data }) => this.receive(data);
    socket.onclose = ({ code, reason }) => this.lost(code, reason);
    this.socket = socket;
    this.hear();
  }

  private hear(): void {
    this.heard = Date.now();
    this.asked = null;
  }

  private receive(data: string | ArrayBuffer): void {
    this.hear();
    if (typeof data === "string") this.receiveText(JSON.parse(data));
    else this.receiveHeights(data);
  }

  private receiveHeights(data: ArrayBuffer): void {
    try {
      const message = decode(data);
      this.subscriptions.get(message.id)?.take(message);
    } catch (error) {
      if (!(error instanceof DecodeError)) throw error;
      this.lost(1002, `a message could not be read: ${error.message}`);
    }
  }

  private receiveText(message: Welcome | StreamEvent | AckMessage | ErrorMessage | PongMessage): void {
    switch (message.op) {
      case "welcome":
        this.open(message);
        break;
      case "event":
        this.options.onEvent?.(message);
        break;
      case "ack":
        this.settle(message.id)?.resolve(message as never);
        break;
      case "error":
        this.refused(message.id, message.problem);
        break;
    }
  }

  private refused(id: number | null, problem: Problem): void {
    const asked = id === null ? undefined : this.settle(id);
    if (asked) asked.reject(new ProblemError(problem));
    else this.options.onProblem?.(problem);
  }

  private open(welcome: Welcome): void {
    this.failures = 0;
    this.welcome = welcome;
    this.options.onWelcome?.(welcome);
    this.become({ name: "open" });
    for (const subscription of this.subscriptions.values()) this.tell(subscription.begin(welcome));
  }

  private settle(id: number): Pending | undefined {
    const pending = this.pending.get(id);
    this.pending.delete(id);
    return pending;
  }

  private tell(message: object): void {
    if (this.state.name === "open") this.socket?.send(JSON.stringify(message));
  }

  /** A connection can be dead without saying so: asks for a sign of life, and gives up where none comes. */
  private checkLife(): void {
    if (this.state.name === "waiting") return;
    const now = Date.now();
    if (this.asked !== null && now - this.asked > SILENCE) {
      this.lost(1006, "the server has fallen silent");
    } else if (this.asked === null && now - this.heard > SILENCE) {
      this.asked = now;
      this.tell({ op: "ping" });
    }
  }

  private async lost(code: number, said: string): Promise<void> {
    const wasOpen = this.state.name === "open";
    this.drop(said || `the connection was lost (${code})`);
    if (code === 1000 || code >= FOR_GOOD) {
      this.end(said || "closed by the server", null, code);
      return;
    }
    this.wait(said || (wasOpen ? "the connection was lost" : "the server can't be reached"));
    if (wasOpen) return;
    const refusal = await this.diagnose();
    const forGood = refusal && [401, 403, 404].includes(refusal.status);
    if (forGood && this.socket === null) this.end(refusal.message, refusal.problem);
  }

  private wait(reason: string): void {
    const longest = Math.min(LONGEST_WAIT, FIRST_WAIT * 2 ** this.failures++);
    // Not all clients of a server that was restarted come back at the same moment.
    const wait = longest * (0.5 + 0.5 * Math.random());
    this.retry = setTimeout(() => this.connect(), wait);
    this.become({ name: "waiting", reason, retry_at: Date.now() + wait });
  }

  private end(reason: string, problem: Problem | null, code: number | null = null): void {
    if (this.state.name === "closed") return;
    clearTimeout(this.retry);
    clearInterval(this.watchdog);
    this.drop(reason);
    this.become({ name: "closed", reason, problem, code });
  }

  /** Lets go of the socket; who waits for an answer is told. */
  private drop(reason: string): void {
    const { socket } = this;
    this.socket = null;
    if (socket) {
      socket.onmessage = null;
      socket.onclose = null;
      socket.close();
    }
    for (const { reject } of this.pending.values()) reject(new DisconnectedError(reason));
    this.pending.clear();
  }

  private become(state: StreamState): void {
    this.state = state;
    this.options.onState?.(state);
  }
}
