// Which columns of a snowpack see the sun: it is swept away from the sun along x or z, a thread for each line. The twin
// of Relief::lit in firn-snow/alpine/shade.rs.

var<immediate> work: Pass;
@group(0) @binding(0) var<storage, read> sessions: array<Session>;
@group(0) @binding(1) var<storage, read> heights: array<u32>;
@group(0) @binding(2) var<storage, read> ground: array<Elevation>;
@group(0) @binding(3) var<storage, read> shade_jobs: array<ShadeJob>;
// 1 where the column sees the sun, 0 where not.
@group(0) @binding(4) var<storage, read_write> shine: array<f32>;

@compute @workgroup_size(64)
fn sweep(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let workgroup = flat_index(group, groups);
    if workgroup >= work.count {
        return;
    }
    let number = shade_job_of(workgroup, true);
    let job = shade_jobs[number];
    let session = sessions[job.session];
    let index = (workgroup - first_group_of(number, true)) * 64u + thread;
    let along_x = (job.flags & ALONG_X) != 0u;
    let length = select(session.depth, session.width, along_x);
    let breadth = i32(select(session.width, session.depth, along_x));
    let line = job.first_line + i32(index);
    var shadow = -1e30;
    for (var step = 0u; step < length; step++) {
        let side = line + ((i32(step) * job.shift + 0x8000) >> 16u);
        shadow -= job.sinks;
        if side < 0 || side >= breadth {
            continue;
        }
        let along = select(step, length - 1u - step, (job.flags & SWEEPS_BACK) != 0u);
        let at = select(vec2(u32(side), along), vec2(along, u32(side)), along_x);
        let surface = level(job, session, at);
        shine[job.first_shine + at.y * session.width + at.x] = select(0.0, 1.0, shadow <= surface);
        shadow = max(shadow, surface);
    }
}
