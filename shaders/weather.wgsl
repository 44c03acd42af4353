// Steps of weather on tiles of alpine snow: a workgroup for each tile, a thread for each column. The twin of
// firn-snow/alpine/step.rs.

var<immediate> work: Pass;
@group(0) @binding(0) var<storage, read> sessions: array<Session>;
@group(0) @binding(1) var<storage, read> tiles: array<Tile>;
@group(0) @binding(2) var<storage, read_write> states: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read_write> heights: array<u32>;
@group(0) @binding(4) var<storage, read_write> filled: array<u32>;
@group(0) @binding(5) var<storage, read> weather_jobs: array<WeatherJob>;
@group(0) @binding(6) var<storage, read> weather_steps: array<WeatherStep>;
// Tiles with columns that objects shelter.
@group(0) @binding(7) var<storage, read> shelters: array<Shelter>;
@group(0) @binding(8) var<storage, read_write> exchanges: array<ExchangeResult>;
// Part of the short wave on level ground that falls on each column of the snowpacks that shade.
@group(0) @binding(9) var<storage, read> shine: array<f32>;
@group(0) @binding(10) var<storage, read_write> mass: array<u32>;
@group(0) @binding(11) var<storage, read_write> thickness: array<u32>;
@group(0) @binding(12) var<storage, read_write> temperature: array<u32>;
// Stress between steps, which nothing needs in them.
@group(0) @binding(13) var<storage, read_write> stress: array<u32>;

var<workgroup> sums: array<atomic<u32>, 8>;
var<workgroup> any_changed: atomic<u32>;

// Lets the surface age; returns the albedo that is seen.
fn age(surface: ptr<function, Surface>, column: Column, cells: u32, weather: WeatherStep, depth: f32) -> f32 {
    if cells == 0u {
        (*surface).albedo = FRESH_ALBEDO;
        return GROUND_ALBEDO;
    }
    let warm = (*surface).skin >= -0.01 || water_in(load_cell(column, cells - 1u)) > 0u;
    let limit = select(weather.aged.x, weather.aged.y, warm);
    let young = select(weather.young.x, weather.young.y, warm);
    (*surface).albedo = limit + ((*surface).albedo - limit) * young;
    return GROUND_ALBEDO + ((*surface).albedo - GROUND_ALBEDO) * (1.0 - exp(-depth / 0.02));
}

// What is left of a column after the way down.
struct Descended {
    cells: u32,
    height: u32,
    // Some cells may be joined.
    joinable: bool,
}

// From the skin down: vapour, melting, water, settling.
fn descend(
    column: Column,
    cells: u32,
    surface: ptr<function, Surface>,
    stack: Stack,
    balance: Balance,
    weather: WeatherStep,
    metres: f32,
    exchange: ptr<function, Exchange>,
) -> Descended {
    let melting = balance.skin >= 0.0;
    let vapour = balance.vapour * weather.seconds;
    let leaves = quanta_of(vapour);
    let comes = quanta_of(-vapour);
    let hoar = select(comes, 0u, melting);
    (*exchange).deposited = comes;
    var descent = Descent(metres, weather.seconds, leaves, melting, balance.melt * weather.seconds,
        weather.rain + comes - hoar, 0u);
    let frost = lay_hoar(column, cells, hoar, metres, balance.skin);
    let free = column.slots - cells;
    var above = balance.skin;
    var upper = Cell(0u, 0u, 0u);
    var gone = 0u;
    var joinable = frost.mass > 0u;
    var height = frost.thickness;
    // Each cell is on its way while the one above it is worked on.
    var next = load_cell(column, cells - 1u);
    var next_element = kept_eliminated(column, cells - 1u);
    for (var rank = 0u; rank < cells; rank++) {
        let slot = cells - 1u - rank;
        let cell = next;
        let element = next_element;
        if slot > 0u {
            next = load_cell(column, slot - 1u);
            next_element = kept_eliminated(column, slot - 1u);
        }
        above = element.free + element.bound * above;
        let water = water_in(cell);
        var layer = Layer(cell.mass - water, water, cell.thickness, above);
        pass_through(&descent, &layer);
        let after = Cell(layer.ice + layer.water, layer.thickness, heat_word(layer.celsius, layer.water));
        let i = slot_of(column, slot);
        if after.mass != cell.mass {
            mass[i] = after.mass;
        }
        thickness[i] = after.thickness;
        temperature[i] = after.word;
        if after.mass == 0u {
            gone++;
            continue;
        }
        joinable = joinable || rank > 2u && upper.mass > 0u && joins(after, upper, free, metres);
        upper = after;
        height += after.thickness;
    }
    (*exchange).sublimated = leaves - descent.vapour;
    (*exchange).runoff += descent.water;
    let before = (*surface).soil[0];
    for (var layer = 0u; layer < 4u; layer++) {
        above = stack.soil[layer].free + stack.soil[layer].bound * above;
        (*surface).soil[layer] = above;
    }
    // What has found no snow left to melt warms the ground, to no more than the air or than it was.
    let capacity_of_ground = capacity_of_soil(0u, before);
    let room = capacity_of_ground * max(max(weather.air, before) - (*surface).soil[0], 0.0);
    (*surface).soil[0] += min(descent.energy, room) / capacity_of_ground;
    var count = cells;
    if gone > 0u {
        count = close_gaps(column, cells);
    }
    if frost.mass > 0u {
        store_cell(column, count, frost);
        count++;
    }
    return Descended(count, height, joinable || gone > 0u);
}

// Moves cells down to where others are gone.
fn close_gaps(column: Column, cells: u32) -> u32 {
    var kept = 0u;
    for (var slot = 0u; slot < cells; slot++) {
        let cell = load_cell(column, slot);
        if cell.mass > 0u {
            store_cell(column, kept, cell);
            kept++;
        }
    }
    return kept;
}

fn height_of(column: Column, cells: u32) -> u32 {
    var height = 0u;
    for (var slot = 0u; slot < cells; slot++) {
        height += thickness[slot_of(column, slot)];
    }
    return height;
}

// A column's cells, and the thickness of all of them together.
struct Stock {
    cells: u32,
    height: u32,
}

// A step of a column; returns what there is of it then.
fn step(
    column: Column,
    before: Stock,
    surface: ptr<function, Surface>,
    weather: WeatherStep,
    metres: f32,
    shining: f32,
    sheltered: bool,
    exchange: ptr<function, Exchange>,
) -> Stock {
    var cells = before.cells;
    var height = before.height;
    if weather.snow > 0u && !sheltered {
        cells = snow_falls(column, cells, weather, exchange);
        height = height_of(column, cells);
    }
    let depth = f32(height) * metres;
    let albedo = age(surface, column, cells, weather, depth);
    let shortwave = (1.0 - albedo) * (weather.shortwave * shining);
    let snow = cells > 0u;
    let rain_heat = select(0.0, WATER_HEAT * max(weather.air, 0.0) * kilograms(weather.rain) / weather.seconds, snow);
    let stack = eliminate(column, cells, (*surface).soil, metres, rain_heat, weather.seconds);
    let turbulence = turbulence_over(weather, snow, depth);
    let skin = Skin(snow, shortwave, 1.0 / stack.half, stack.top, turbulence);
    let balance = solve(skin, weather, (*surface).skin);
    (*surface).skin = balance.skin;
    if !snow {
        var above = balance.skin;
        for (var layer = 0u; layer < 4u; layer++) {
            above = stack.soil[layer].free + stack.soil[layer].bound * above;
            (*surface).soil[layer] = above;
        }
        (*exchange).runoff = weather.rain;
        return Stock(0u, 0u);
    }
    let descended = descend(column, cells, surface, stack, balance, weather, metres, exchange);
    let snows = (weather.flags & SNOWS) != 0u;
    var count = join_top(column, descended.cells, snows);
    if descended.joinable {
        count = join_inner(column, count, metres);
    }
    while column.slots - count < TOO_FEW {
        let joined = join_least(column, count, metres);
        if joined == count {
            break;
        }
        count = joined;
    }
    if is_last_scrap(column, count, snows) {
        (*exchange).runoff += mass[slot_of(column, 0u)];
        count = 0u;
        height = 0u;
    } else {
        height = descended.height;
    }
    // What was filled and is not any more is empty, as readers expect.
    for (var slot = count; slot < max(cells, descended.cells); slot++) {
        mass[slot_of(column, slot)] = 0u;
    }
    return Stock(count, height);
}

// Adds to a sum of 64 bits in the workgroup.
fn add(sum: u32, quanta: u32) {
    if quanta > 0u {
        let before = atomicAdd(&sums[2u * sum], quanta);
        if before + quanta < before {
            atomicAdd(&sums[2u * sum + 1u], 1u);
        }
    }
}

// The job that a workgroup belongs to: the first that ends behind it.
fn job_of(index: u32) -> u32 {
    var low = work.first;
    var high = work.first + work.cycles - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if weather_jobs[middle].end > index {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

// Whether objects shelter a column of a tile.
fn is_sheltered(job: WeatherJob, tile: u32, column: u32) -> bool {
    for (var i = job.first_shelter; i < job.first_shelter + job.shelters; i++) {
        if shelters[i].tile == tile {
            let half = select(shelters[i].high, shelters[i].low, column < 32u);
            return (half >> (column % 32u) & 1u) == 1u;
        }
    }
    return false;
}

@compute @workgroup_size(64)
fn weather(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let index = flat_index(group, groups);
    if index >= work.count {
        return;
    }
    let job = weather_jobs[job_of(index)];
    let tile = job.end_tile - (job.end - index);
    let row = tiles[tile];
    if row.page != work.page {
        return;
    }
    let session = sessions[row.session];
    let place = tile * TILE_COLUMNS + thread;
    let inside = thread % TILE_SIDE < (row.shape & 0xffu) && thread / TILE_SIDE < ((row.shape >> 8u) & 0xffu);
    if inside {
        let column = Column(row.row * TILE_COLUMNS + thread, session.height);
        var surface = load_surface(column, job);
        var stock = Stock(filled[place], heights[place]);
        let sheltered = is_sheltered(job, tile, thread);
        var shining = 1.0;
        if job.first_shine != NONE {
            let position = column_position(session, tile, thread);
            shining = shine[job.first_shine + position.y * session.width + position.x];
        }
        for (var i = 0u; i < job.steps; i++) {
            var exchange = Exchange(0u, 0u, 0u, 0u);
            let weather = weather_steps[job.first_step + i];
            stock = step(column, stock, &surface, weather, session.metres, shining, sheltered, &exchange);
            let low = surface.runoff.x + exchange.runoff;
            surface.runoff = vec2(low, surface.runoff.y + select(0u, 1u, low < exchange.runoff));
            add(0u, exchange.refused);
            add(1u, exchange.deposited);
            add(2u, exchange.sublimated);
            add(3u, exchange.runoff);
        }
        store_surface(column, surface);
        if stock.height != heights[place] {
            heights[place] = stock.height;
            atomicStore(&any_changed, 1u);
        }
        filled[place] = stock.cells;
    }
    workgroupBarrier();
    if thread < 4u {
        let low = atomicLoad(&sums[2u * thread]);
        let high = atomicLoad(&sums[2u * thread + 1u]);
        let before = atomicAdd(&exchanges[job.exchange].sums[2u * thread], low);
        let carry = select(0u, 1u, before + low < before);
        if high + carry > 0u {
            atomicAdd(&exchanges[job.exchange].sums[2u * thread + 1u], high + carry);
        }
    }
    if thread == 0u {
        if atomicLoad(&any_changed) != 0u {
            atomicOr(&states[tile], DIRTY);
        }
        // Under objects the snow has settled or grown soft; elsewhere no cycle changes it.
        if (row.shape & LOADED) != 0u {
            atomicOr(&states[tile], AWAKE);
        }
    }
}
