// How loads spread with depth; the twin of firn-snow/column.rs.

const TWO_TO_ONE: u32 = 0u;
const UNIFORM: u32 = 1u;

// Part of a surface stress at a depth [m] under a load of a width [m].
fn spread(distribution: u32, depth: f32, width: f32, top: bool) -> f32 {
    if distribution == TWO_TO_ONE {
        let ratio = width / (width + depth);
        return ratio * ratio;
    }
    return select(0.0, 1.0, distribution == UNIFORM || top);
}
