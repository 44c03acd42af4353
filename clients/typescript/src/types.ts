// What the server is sent and what it answers, named as on the wire. SI units and °C.
//
// The shapes are generated from the published contract; this gives them the names that the client uses.

import type { GetCellsQuery, SampleFields, Stamp } from "./generated.ts";

export type {
  AlpineColumn,
  BatchOutcome,
  BatchReply,
  BatchResult,
  BatchResults,
  CellsView as Cells,
  CheckpointView as Checkpoint,
  CheckpointList,
  Clearing,
  ClearingReply,
  ColliderView as Collider,
  ColliderBatch,
  ColliderPage,
  ColliderPatch,
  ColliderSpec,
  ColumnView as Column,
  ColumnRegion,
  CreatedSession,
  DepthWatch,
  EventKind,
  EventsWanted,
  Part as Footprint,
  PartSpec as FootprintSpec,
  Grid,
  GridSpec,
  HandHardness,
  GetHeightsQuery as HeightsQuery,
  GetTerrainQuery as TerrainQuery,
  LayerView as Layer,
  MassView as MassLedger,
  Material,
  MaterialSpec,
  Load,
  MemoryBytes,
  OnError,
  ListSessionsQuery as PageQuery,
  Physics,
  Position,
  Preset,
  Pressing,
  PrintView as Print,
  ProbeView as Probe,
  Probe as ProbeSpec,
  Problem,
  Readiness,
  Region,
  SampleBatch,
  SampleField,
  SampleFields,
  Page_SessionView as SessionPage,
  SessionSpec,
  SessionView,
  Settings,
  SettingsPatch,
  Shape,
  Site,
  SnowLayer,
  Snowfall,
  SnowfallReply,
  Stamp,
  StampReply,
  StampSpec,
  StepSpec,
  EventMessage as StreamEvent,
  Summary,
  Terrain,
  TokensReply as Tokens,
  UsageView as Usage,
  WatchEvent,
  WeakLayerView as WeakLayer,
  Weather,
  WeatherInput,
  WeatherInputSpec,
  WeatherNow,
  WeatherView,
  WelcomeMessage as Welcome,
} from "./generated.ts";

/** Which cells of the fixed grid to read. */
export interface CellsQuery extends Omit<GetCellsQuery, "fields"> {
  /** Names of fields. */
  fields?: string[];
}

/** Heights of a region, row by row: index = z · width + x. */
export interface Heights extends Stamp {
  heights: Float32Array;
}

/** The snow at points. Of the fields that were asked for a value for each point, `null` for the others. */
export interface Samples extends Stamp {
  fields: SampleFields;
}
