// Starts the real server for a test.

import { type ChildProcess, spawn } from "node:child_process";
import { once } from "node:events";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";

const built = new URL("../../../target/debug/firn", import.meta.url);

/** A running server. */
export interface Server {
  url: string;
  port: number;
  process: ChildProcess;
  /** Ends it, by SIGTERM or as it is told, and waits until it is gone. */
  stop(signal?: NodeJS.Signals): Promise<void>;
}

/**
 * Starts the server that FIRN_BIN names, or the one that `cargo build` makes, on a free port or on `port`, with `env` beside
 * this process's environment. Its working directory is a folder of its own, removed with it.
 */
export async function startServer(options: { args?: string[]; port?: number; env?: Record<string, string> } = {}): Promise<Server> {
  const program = process.env["FIRN_BIN"] ?? fileURLToPath(built);
  const folder = mkdtempSync(join(tmpdir(), "firn-test-"));
  const listen = ["--listen", `127.0.0.1:${options.port ?? 0}`];
  const child = spawn(program, ["serve", ...listen, ...(options.args ?? [])], {
    cwd: folder,
    env: { ...process.env, RUST_LOG: "info", NODEVICE_SELECT: "1", ...options.env },
    stdio: ["ignore", "ignore", "pipe"],
  });
  // A test that fails badly leaves no server behind.
  process.once("exit", () => child.kill("SIGKILL"));
  const gone = once(child, "exit").finally(() => rmSync(folder, { recursive: true, force: true }));
  const url = await Promise.race([listening(child), gone.then(() => "")]);
  if (url === "") throw new Error(`${program} ended before it listened; build it with cargo build, or set FIRN_BIN`);
  const stop = async (signal: NodeJS.Signals = "SIGTERM") => {
    child.kill(signal);
    await gone;
  };
  return { url, port: Number(new URL(url).port), process: child, stop };
}

/** The address that the server's log tells. What follows is read and dropped, so that its pipe never fills. */
async function listening(child: ChildProcess): Promise<string> {
  if (!child.stderr) throw new Error("the server's log is not read");
  const lines = createInterface({ input: child.stderr });
  return new Promise((resolve) => {
    lines.on("line", (line) => {
      const found = /listening on (http:\/\/[\d.:]+)/.exec(line);
      if (found?.[1]) resolve(found[1]);
    });
  });
}
