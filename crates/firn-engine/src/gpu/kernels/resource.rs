//! The buffers that kernels bind.

/// A buffer that kernels bind, named as in their source.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Resource {
    /// Constants of each snowpack.
    Sessions,
    /// What each snowpack does in this frame.
    Runs,
    /// Sums over each snowpack in this frame.
    Tallies,
    /// Where each tile is.
    Tiles,
    /// Flags of each tile.
    States,
    /// Height of each column.
    Heights,
    /// Slots filled in each column.
    Filled,
    /// Ground elevation of each column.
    Ground,
    /// Where each page's part of the list of due tiles begins.
    PageStarts,
    /// Due tiles, page by page, and behind them the lists written by the host.
    Due,
    /// Objects of this frame.
    Colliders,
    /// Spans of columns under the objects.
    Spans,
    /// How high undersides that are not flat are over those columns.
    Lifts,
    /// How each object touches the snow.
    Contacts,
    /// Tiles whose stress is to be evaluated.
    LoadJobs,
    /// Objects on those tiles.
    Loads,
    /// Tiles on which snow falls or is cleared.
    EditJobs,
    /// What falls or is cleared.
    Operations,
    /// Which of it touches each of those tiles.
    OperationLists,
    /// Loads that press columns at once.
    Stamps,
    /// How much of each column they cover.
    Shares,
    /// What was refused or cleared, or how deep the dents are.
    OperationResults,
    /// Snowpacks that take steps of weather, and on which tiles.
    WeatherJobs,
    /// Those steps.
    WeatherSteps,
    /// Tiles with columns on which no snow falls because of objects.
    Shelters,
    /// What is exchanged with the weather.
    Exchanges,
    /// Snowpacks on each column of which another part of the short wave falls.
    ShadeJobs,
    /// Those parts.
    Shine,
    /// Columns that are summed up.
    ColumnTotals,
    /// Columns that are to be read, all of them equally deep.
    ColumnJobs,
    /// Which columns those are.
    ColumnLists,
    /// Cells of the columns that are read.
    ColumnCells,
    /// Boxes of the fixed grid that are asked for.
    SampleJobs,
    /// Cells of the fixed grid.
    Samples,
    /// Number of tiles packed for publication.
    PackedCount,
    /// Which tiles are packed, 64 at a time.
    PackedGroups,
    /// Heights of the tiles packed for publication.
    Packed,
    /// Mass of each cell of a page.
    Mass,
    /// Thickness of each cell of a page.
    Thickness,
    /// Temperature of each cell of a page.
    Temperature,
    /// Stress of each cell of a page.
    Stress,
}
