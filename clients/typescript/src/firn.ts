// A server and its sessions.

import { type Access, ask } from "./http.ts";
import { Session } from "./session.ts";
import type { CreatedSession, PageQuery, Readiness, SessionPage, SessionSpec, SessionView } from "./types.ts";

/** A Firn server. Its calls throw a ProblemError where the server refuses them. */
export class Firn {
  readonly access: Access;

  /** `url` as in `http://127.0.0.1:8080`; a `token` where the server asks for one. */
  constructor(url: string, options: Omit<Access, "url"> = {}) {
    this.access = { url, ...options };
  }

  /** A session by its name; asks the server nothing. */
  session(id: string): Session {
    return new Session(this.access, id);
  }

  /** Creates a session. The answer's tokens are told once. */
  createSession(spec: SessionSpec = {}): Promise<CreatedSession> {
    return ask(this.access, "/v1/sessions", { method: "POST", body: spec });
  }

  /** Restores a snapshot as a new session, under the name `id` where there is one. */
  restoreSession(snapshot: Uint8Array | ArrayBuffer, id?: string): Promise<CreatedSession> {
    const contentType = "application/vnd.firn.snapshot";
    return ask(this.access, "/v1/sessions", { method: "POST", query: { id }, body: snapshot, contentType });
  }

  /** A page of the sessions. */
  listSessions(query: PageQuery = {}): Promise<SessionPage> {
    return ask(this.access, "/v1/sessions", { query });
  }

  /** Every session, page by page. */
  async *sessions(): AsyncGenerator<SessionView> {
    let query: { cursor?: string } = {};
    for (;;) {
      const page = await this.listSessions(query);
      yield* page.items;
      if (page.next_cursor === null) return;
      query = { cursor: page.next_cursor };
    }
  }

  /** What the server runs on and how much it holds. */
  readiness(): Promise<Readiness> {
    return ask(this.access, "/readyz");
  }
}
