"""What the server is sent and what it answers, as on the wire. SI units and °C.

The shapes are generated from the published contract; this gives them the names that the client uses.
"""

from . import generated

Ack = generated.AckMessage
BatchOutcome = generated.BatchOutcome
BatchReply = generated.BatchReply
BatchResult = generated.BatchResult
BatchResults = generated.BatchResults
Box = generated.ShapeBox
Capsule = generated.ShapeCapsule
Checkpoint = generated.CheckpointView
ClearingReply = generated.ClearingReply
Collider = generated.ColliderView
ColliderPatch = generated.ColliderPatch
ColliderSpec = generated.ColliderSpec
Column = generated.ColumnView
ColumnRegion = generated.ColumnRegion
DepthWatch = generated.DepthWatch
Disk = generated.ShapeDisk
Event = generated.EventMessage
EventKind = generated.EventKind
Footprint = generated.Part
FootprintSpec = generated.PartSpec
Grid = generated.Grid
GridSpec = generated.GridSpec
HandHardness = generated.HandHardness
HeightsQuery = generated.GetHeightsQuery
Layer = generated.LayerView
Load = generated.Load
MassLedger = generated.MassView
Material = generated.Material
MaterialSpec = generated.MaterialSpec
MemoryBytes = generated.MemoryBytes
OnError = generated.OnError
Physics = generated.Physics
Polygon = generated.ShapePolygon
Position = generated.Position
Preset = generated.Preset
Print = generated.PrintView
Probe = generated.ProbeView
ProbeSpec = generated.Probe
Quantity = generated.Quantity
Readiness = generated.Readiness
Region = generated.Region
RenderQuery = generated.GetRenderQuery
SampleField = generated.SampleField
SessionSpec = generated.SessionSpec
SessionView = generated.SessionView
Settings = generated.Settings
SettingsPatch = generated.SettingsPatch
Shape = generated.Shape
Site = generated.Site
SiteSpec = generated.SiteSpec
SnowLayer = generated.SnowLayer
SnowfallReply = generated.SnowfallReply
Stamp = generated.Stamp
StampedCollider = generated.ColliderReply
StampSpec = generated.StampSpec
Step = generated.StepSpec
Summary = generated.Summary
SunPosition = generated.SunPosition
Terrain = generated.Terrain
TerrainQuery = generated.GetTerrainQuery
Usage = generated.UsageView
WatchEvent = generated.WatchEvent
WeakLayer = generated.WeakLayerView
Weather = generated.Weather
WeatherNow = generated.WeatherNow
WeatherRow = generated.WeatherRow
WeatherSeries = generated.WeatherSeriesSpec
WeatherView = generated.WeatherView
Welcome = generated.WelcomeMessage
Wheel = generated.ShapeWheel
