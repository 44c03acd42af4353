// The surface of a snowpack above a level that is the same for all of its columns.

// Elevation of a column's surface above the lowest ground, in cells.
fn level(job: ShadeJob, session: Session, at: vec2<u32>) -> f32 {
    let place = column_index(session, at.x, at.y);
    let floor = ground[place];
    let quanta = f32(floor.fraction) + f32(heights[place]) - f32(job.lowest_fraction);
    return f32(floor.cells - job.lowest_cells) + quanta / f32(CELL);
}

// The job that a workgroup belongs to: the first that ends behind it, by the workgroups that sweep or those that shade.
fn shade_job_of(index: u32, sweeps: bool) -> u32 {
    var low = work.first;
    var high = work.first + work.cycles - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if select(shade_jobs[middle].shade_end, shade_jobs[middle].sweep_end, sweeps) > index {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

// The first workgroup of a job.
fn first_group_of(job: u32, sweeps: bool) -> u32 {
    if job == work.first {
        return 0u;
    }
    return select(shade_jobs[job - 1u].shade_end, shade_jobs[job - 1u].sweep_end, sweeps);
}
