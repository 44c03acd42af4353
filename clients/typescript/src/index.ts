// Client of Firn, the snowpack server, for browsers and Node: REST, and the height stream with resuming and binary messages.

export { Firn } from "./firn.ts";
export { HeightField } from "./height-field.ts";
export { DecodeError, decode, GROUND_STEPS_PER_METRE, type GroundTile, type HeightMessage, type Tile } from "./height-stream.ts";
export { type Access, ProblemError, type Request, send } from "./http.ts";
export { Session } from "./session.ts";
export { DisconnectedError, Stream, type StreamOptions, type StreamState } from "./stream.ts";
export { type Change, Subscription, type Watch } from "./subscription.ts";
export type * from "./types.ts";
