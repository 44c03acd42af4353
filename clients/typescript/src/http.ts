// Requests over HTTP, and what goes wrong with them.

import type { Problem } from "./types.ts";

/** The server refused a request. `problem` says what was wrong, field by field. */
export class ProblemError extends Error {
  readonly problem: Problem;

  constructor(problem: Problem) {
    const fields = problem.errors.map(({ pointer, detail }) => `${pointer}: ${detail}`);
    super([...new Set([problem.detail, ...fields])].join("\n"));
    this.name = "ProblemError";
    this.problem = problem;
  }

  /** HTTP status, also of what a stream refused. */
  get status(): number {
    return this.problem.status;
  }
}

/** Where the server is, and who asks. */
export interface Access {
  /** Where the server is, as in `http://127.0.0.1:8080`. */
  url: string;
  /** An API key or a session's token; none for an open server. */
  token?: string | undefined;
  /** Instead of the platform's `fetch`. */
  fetch?: typeof fetch | undefined;
}

/** What may be said beside a path. */
export interface Request {
  method?: "GET" | "POST" | "PUT" | "PATCH" | "DELETE";
  query?: object;
  /** Sent as JSON; bytes as they are. */
  body?: unknown;
  accept?: string;
  contentType?: string;
  signal?: AbortSignal | undefined;
  /** Makes repeating a POST safe: the server does it once. */
  idempotencyKey?: string | undefined;
}

/** Sends a request; throws a ProblemError where the server refuses it. */
export async function send(access: Access, path: string, request: Request = {}): Promise<Response> {
  const url = new URL(path, access.url);
  for (const [name, value] of Object.entries(request.query ?? {})) {
    if (value !== undefined) url.searchParams.set(name, String(value));
  }
  const headers = new Headers({ accept: request.accept ?? "application/json" });
  if (access.token) headers.set("authorization", `Bearer ${access.token}`);
  if (request.idempotencyKey) headers.set("idempotency-key", request.idempotencyKey);
  const init: RequestInit = { method: request.method ?? "GET", headers };
  if (request.signal) init.signal = request.signal;
  if (request.body !== undefined) {
    headers.set("content-type", request.contentType ?? "application/json");
    init.body = request.contentType ? (request.body as BodyInit) : JSON.stringify(request.body);
  }
  const response = await (access.fetch ?? fetch)(url, init);
  if (!response.ok) throw new ProblemError(await problemOf(response));
  return response;
}

/** Sends a request that is answered with JSON. */
export async function ask<T>(access: Access, path: string, request?: Request): Promise<T> {
  const response = await send(access, path, request);
  return (await response.json()) as T;
}

async function problemOf(response: Response): Promise<Problem> {
  const said = await response.json().catch(() => ({}));
  const title = `HTTP ${response.status} ${response.statusText}`.trim();
  const plain = { type: "about:blank", title, status: response.status, detail: title, errors: [] };
  return { ...plain, ...said };
}
