// How much of the short wave on level ground falls on each column of the snowpacks that shade, by the tilt of its
// surface, and whether it sees the sun: a thread for each column. The twin of firn-snow/alpine/shade.rs.

var<immediate> work: Pass;
@group(0) @binding(0) var<storage, read> sessions: array<Session>;
@group(0) @binding(1) var<storage, read> heights: array<u32>;
@group(0) @binding(2) var<storage, read> ground: array<Elevation>;
@group(0) @binding(3) var<storage, read> shade_jobs: array<ShadeJob>;
// 1 where the column sees the sun, 0 where not; then the part of the short wave.
@group(0) @binding(4) var<storage, read_write> shine: array<f32>;

// Largest part of the direct light on level ground that falls on a slope.
const MOST_DIRECT: f32 = 20.0;

// Rise of the surface from one column to another, by so many columns.
fn rise(job: ShadeJob, session: Session, low: vec2<u32>, high: vec2<u32>) -> f32 {
    let columns = max(high.x - low.x + high.y - low.y, 1u);
    return (level(job, session, high) - level(job, session, low)) / f32(columns);
}

@compute @workgroup_size(64)
fn shade(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let workgroup = flat_index(group, groups);
    if workgroup >= work.count {
        return;
    }
    let number = shade_job_of(workgroup, false);
    let job = shade_jobs[number];
    let session = sessions[job.session];
    let index = (workgroup - first_group_of(number, false)) * 64u + thread;
    if index >= session.width * session.depth {
        return;
    }
    let at = vec2(index % session.width, index / session.width);
    let size = vec2(session.width, session.depth);
    let before = at - min(at, vec2(1u));
    let after = min(at + 1u, size - 1u);
    let rise_x = rise(job, session, vec2(before.x, at.y), vec2(after.x, at.y));
    let rise_z = rise(job, session, vec2(at.x, before.y), vec2(at.x, after.y));
    let flat = 1.0 / sqrt(1.0 + rise_x * rise_x + rise_z * rise_z);
    let sky = 0.5 * (1.0 + flat);
    var direct = 0.0;
    if job.diffuse < 1.0 && shine[job.first_shine + index] > 0.0 {
        let facing = (job.up - rise_x * job.east - rise_z * job.north) * flat / job.up;
        direct = clamp(facing, 0.0, MOST_DIRECT);
    }
    // Exactly 1 on level open ground.
    shine[job.first_shine + index] = 1.0 + (1.0 - job.diffuse) * (direct - 1.0) + job.diffuse * (sky - 1.0);
}
