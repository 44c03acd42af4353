// The tables that all kernels read. firn-engine has the same structs in gpu/layout.rs; a test compares
// them.

// Columns of a tile; cells of a tile stand at (row + slot) * 64 + column of its page.
const TILE_COLUMNS: u32 = 64u;
const TILE_SIDE: u32 = 8u;
// Thickness quanta in a full cell.
const CELL: u32 = 1u << 24u;
// One mass quantum [kg/m2].
const MASS_QUANTUM: f32 = 1.0 / 262144.0;
// [m/s2]
const GRAVITY: f32 = 9.81;
// Depth over which contact is soft, in thickness quanta.
const CONTACT_DEPTH: u32 = 838861u;
// A tile without a session; as a fraction, no elevation; a footprint without lifts.
const NONE: u32 = 0xffffffffu;

// Bits of a tile's state.
const AWAKE: u32 = 1u;   // a cell changed in the last cycle, or was disturbed since
const DIRTY: u32 = 2u;   // a height changed since the last publication

// Bit of Tile.shape: an object's footprint covers a column of it.
const LOADED: u32 = 1u << 31u;

// Bits of Run.flags.
const WAKE: u32 = 1u;
const PUBLISH: u32 = 2u;
const EDITED: u32 = 4u;  // contacts have been evaluated for the first cycle, after edits
const ALWAYS_AWAKE: u32 = 8u;
const PARTED: u32 = 16u;  // a part of the cycles is done, on tiles that the host lists

// Bits of Pass.flags.
const AFTER_EDITS: u32 = 1u;    // nothing may be skipped
const BACKWARDS: u32 = 2u;      // a list of tiles is gone through from its end
const UNDER_OBJECTS: u32 = 4u;  // the listed tiles are those under objects, after the first cycle
const LISTED: u32 = 8u;         // the host has listed just the tiles that the kernel is for
const STEPPED: u32 = 16u;       // it is one of the steps of a cycle in which objects move

// Session.hardness_law of alpine snow.
const ALPINE: u32 = 3u;

// An elevation: whole cells above level 0, rounded down, and quanta above those.
struct Elevation {
    cells: i32,
    fraction: u32,
}

// A snowpack's constants.
struct Session {
    first_tile: u32,
    tiles_x: u32,
    width: u32,
    depth: u32,
    height: u32,
    hardness_law: u32,
    load_distribution: u32,
    stiffness_exponent: f32,
    // Density of one mass quantum in one thickness quantum [kg/m3].
    density: f32,
    // Thickness quanta of one mass quantum at the largest density.
    densest: f32,
    // Length of one thickness quantum [m].
    metres: f32,
    // Gold's hardness at 20 kg/m3 and -3 degrees C [Pa].
    gold: f32,
}

// What a snowpack does in this frame.
struct Run {
    cycles: u32,
    flags: u32,
    // Cycle length over the reference cell size [s/m].
    rate: f32,
    // Its row in the table of sums.
    tally: u32,
    // Thickness quanta by which a load presses a cell in a cycle at the most; 0 where snow creeps under it.
    press: u32,
}

// Where a tile is.
struct Tile {
    session: u32,
    page: u32,
    row: u32,
    // Columns along x that the snowpack has of it, those along z in the next byte, and LOADED.
    shape: u32,
}

// Sums of one frame over a snowpack.
struct Tally {
    last_change: atomic<u32>,
    active_tiles: atomic<u32>,
    mass_low: atomic<u32>,
    mass_high: atomic<u32>,
}

// A footprint of an object in this frame.
struct Collider {
    session: u32,
    // Its row in the table of contacts.
    contact: u32,
    // First row of columns, and its spans in the table of spans.
    z0: u32,
    first_span: u32,
    rows: u32,
    columns: u32,
    // Lowest and highest end of the spans.
    x0: u32,
    x1: u32,
    // Area of the footprint [m2] and weight [N].
    area: f32,
    weight: f32,
    // Not 0 where the depth it has sunk is counted from this evaluation.
    placed: u32,
    // Not 0 where a cycle follows this evaluation.
    runs: u32,
    // Footprints of the object, whose rows follow each other; 0 but in the first of them.
    footprints: u32,
    // Columns that are beyond the grid.
    overhang: u32,
    // First of the lifts over its columns; NONE where it is flat.
    first_lift: u32,
}

// How an object touches the snow.
struct Contact {
    bottom: Elevation,
    reference: Elevation,
    support_low: u32,
    support_high: u32,
    area: f32,
    pressure: f32,
    // Width b over which the load spreads [m].
    width: f32,
    // Not 0 where bottom and support were those of the last cycle before, when they were evaluated.
    resting: u32,
    // Those of the last cycle; NONE for the bottom where there was none since it was placed.
    last_bottom: Elevation,
    last_support_low: u32,
    last_support_high: u32,
}

// A tile and the objects that may stand on it, ascending by their ids.
struct LoadJob {
    tile: u32,
    first_load: u32,
    loads: u32,
    padding: u32,
}

// A tile and the deposits and clearings that touch it: some of the table of lists, in order of
// arrival.
struct EditJob {
    tile: u32,
    first_operation: u32,
    operations: u32,
    // Columns, bit by bit, on which no snow falls because of objects, and those on which objects stand.
    sheltered_low: u32,
    sheltered_high: u32,
    stood_on_low: u32,
    stood_on_high: u32,
    padding: u32,
}

// Snow that falls on columns, or is cleared from them.
struct Operation {
    // x0, z0, and behind the last x1, z1.
    columns: vec4<u32>,
    // Mass quanta that fall; depth in thickness quanta, of what falls, or of what is left standing;
    // mass quanta of a full cell; the bits of the temperature [degrees C]. In one piece, because each
    // part by itself would cost as much to read.
    snow: vec4<u32>,
    kind: u32,
    // Its row in the table of results.
    result: u32,
    padding: vec2<u32>,
}

// A load that presses columns at once.
struct Stamp {
    // x0, z0, and behind the last x1, z1.
    columns: vec4<u32>,
    // First of the shares that it covers of them, row by row.
    first_share: u32,
    // Its row in the table of results.
    result: u32,
    // Pressure [Pa], and width over which it spreads [m].
    pressure: f32,
    width: f32,
}

// Mass quanta that an operation refused or cleared, or the largest dent of a stamp.
struct OperationResult {
    low: atomic<u32>,
    high: atomic<u32>,
}

// Which tiles of 64 neighbours are packed for publication, and where the first of them is.
struct PackedGroup {
    changed_low: u32,
    changed_high: u32,
    awake_low: u32,
    awake_high: u32,
    first: u32,
}

// Columns that are read, all of them equally deep.
struct ColumnJob {
    // Where the first of the columns stands in the table of lists.
    first_column: u32,
    columns: u32,
    // Cells of each that are read at the most, counted from the top.
    cells: u32,
    // Where the first of these cells is put.
    first: u32,
}

// A cell of a column that is read. Its mass is 0 where the column has no more.
struct ColumnCell {
    mass: u32,
    thickness: u32,
    temperature: f32,
    stress: f32,
}

// A box of the fixed grid that is asked for.
struct SampleJob {
    session: u32,
    // First of its samples: x fastest, then y, then z.
    first: u32,
    x0: u32,
    y0: u32,
    z0: u32,
    width: u32,
    height: u32,
    depth: u32,
    // Cycle length over the reference cell size [s/m].
    rate: f32,
    // What cells along y are counted from; NONE as its fraction for each column's ground.
    floor: Elevation,
}

// A cell of the fixed grid, or sums over a part of one.
struct Sample {
    content: u32,
    fill: f32,
    mass: f32,
    density: f32,
    temperature: f32,
    hardness: f32,
    stiffness: f32,
    stress: f32,
    load_stress: f32,
    indent: f32,
    liquid_water: f32,
}

// Bits of WeatherStep.flags.
const ABOVE_GROUND: u32 = 1u;  // heights of the instruments are above ground rather than above the snow
const SNOWS: u32 = 2u;         // snow falls, whether any of it is due or not

// The weather in one step, the same for all columns of a snowpack.
struct WeatherStep {
    seconds: f32,
    // [degrees C]
    air: f32,
    // Specific humidity.
    humidity: f32,
    // [kg/m3]
    air_density: f32,
    // [Pa]
    pressure: f32,
    // [m/s]
    wind: f32,
    // On level ground, and from the sky [W/m2].
    shortwave: f32,
    longwave: f32,
    // Albedo that cold snow and wet snow tend to, and how much of the way is left after the step.
    aged: vec2<f32>,
    young: vec2<f32>,
    // [m]
    temperature_height: f32,
    wind_height: f32,
    flags: u32,
    // Snow that is due: mass and thickness in quanta, and temperature [degrees C].
    snow: u32,
    snow_thickness: u32,
    snow_temperature: f32,
    // Mass quanta.
    rain: u32,
    padding: u32,
}

// Steps of weather of one snowpack, on some of its tiles that follow each other.
struct WeatherJob {
    // Workgroups of this job and of those before it, and end of its tiles.
    end: u32,
    end_tile: u32,
    first_step: u32,
    steps: u32,
    // Its row in the table of exchanges.
    exchange: u32,
    first_shelter: u32,
    shelters: u32,
    // Where the parts of the short wave on its columns begin; NONE where all have the same.
    first_shine: u32,
    // What a column begins with: temperatures of the skin and of the soil, from the top down [degrees C].
    skin: f32,
    soil_0: f32,
    soil_1: f32,
    soil_2: f32,
    soil_3: f32,
    padding: u32,
}

// A tile with columns, bit by bit, on which no snow falls because of objects.
struct Shelter {
    tile: u32,
    low: u32,
    high: u32,
    padding: u32,
}

// Mass quanta that were refused, deposited, sublimated and that ran off: low and high words.
struct ExchangeResult {
    sums: array<atomic<u32>, 8>,
}

// Bits of ShadeJob.flags.
const ALONG_X: u32 = 1u;      // the grid is swept along x rather than z
const SWEEPS_BACK: u32 = 2u;  // from its far end

// Where light falls on a snowpack in a step.
struct ShadeJob {
    // Workgroups that sweep for this job and those before it, and those that shade.
    sweep_end: u32,
    shade_end: u32,
    session: u32,
    // Where the parts of the short wave on its columns begin.
    first_shine: u32,
    flags: u32,
    // Sideways shift of the lines in a column, times 2^16; their first; and by how much shadow sinks in a column [cells].
    shift: i32,
    first_line: i32,
    sinks: f32,
    // Direction to the sun, and the part of the light that comes from all over the sky.
    east: f32,
    up: f32,
    north: f32,
    diffuse: f32,
    // The lowest ground.
    lowest_cells: i32,
    lowest_fraction: u32,
}

// A column of alpine snow, summed up, and what it has beside its cells, as it is stored.
struct ColumnTotals {
    mass: u32,
    water: u32,
    surface: array<u32, 8>,
}

// What one dispatch works on.
struct Pass {
    // First entry of its list, and how many there are.
    first: u32,
    count: u32,
    // First cycle that is run, and how many are run at the most.
    cycle: u32,
    cycles: u32,
    // The page whose cells are bound.
    page: u32,
    flags: u32,
    // Where the length of a list of tiles stands.
    length: u32,
    // What Run has under the same names, for one of the steps of a cycle in which objects move.
    rate: f32,
    press: u32,
}

// Index of a workgroup in a dispatch of two dimensions.
fn flat_index(group: vec3<u32>, groups: vec3<u32>) -> u32 {
    return group.y * groups.x + group.x;
}

// Column (x, z) as an index into the tables of columns.
fn column_index(session: Session, x: u32, z: u32) -> u32 {
    let tile = session.first_tile + (z / TILE_SIDE) * session.tiles_x + x / TILE_SIDE;
    return tile * TILE_COLUMNS + (z % TILE_SIDE) * TILE_SIDE + x % TILE_SIDE;
}

// Coordinates of a column of a tile.
fn column_position(session: Session, tile: u32, column: u32) -> vec2<u32> {
    let index = tile - session.first_tile;
    let corner = vec2(index % session.tiles_x, index / session.tiles_x) * TILE_SIDE;
    return corner + vec2(column % TILE_SIDE, column / TILE_SIDE);
}
