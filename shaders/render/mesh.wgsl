// Triangles: the surface of the snow, and round objects.

struct Vertex {
    @location(0) position: vec3f,
    // Place in the colour map, from 0 to 1.
    @location(1) value: f32,
    @location(2) normal: vec3f,
    // Replaces the mapped colour where its alpha is 1.
    @location(3) paint: vec4f,
}

struct Point {
    @builtin(position) clip: vec4f,
    @location(0) value: f32,
    @location(1) paint: vec4f,
    @location(2) normal: vec3f,
    @location(3) position: vec3f,
}

// A triangle that leans further from its corners' normals than this (cosine) is a wall with sharp edges.
const CREASE: f32 = 0.85;

@vertex
fn mesh_vertex(vertex: Vertex) -> Point {
    return Point(
        view.clip * vec4f(vertex.position, 1.0), vertex.value, vertex.paint, vertex.normal, vertex.position
    );
}

@fragment
fn mesh_fragment(point: Point) -> @location(0) vec4f {
    let smooth_normal = normalize(point.normal);
    let across = normalize(cross(dpdx(point.position), dpdy(point.position)));
    // Whatever is seen faces the eye.
    let towards = view.eye.xyz - view.eye.w * point.position;
    let flat_normal = select(-across, across, dot(across, towards) > 0.0);
    let normal = select(flat_normal, smooth_normal, dot(flat_normal, smooth_normal) > CREASE);
    return vec4f(lit(colour(point.value, point.paint), normal), 1.0);
}
