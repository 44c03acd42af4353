// Triangles: the surface of the snow, and round objects.

struct Vertex {
    @location(0) position: vec3f,
    // Place in the colour map, from 0 to 1.
    @location(1) value: f32,
    @location(2) normal: vec3f,
    // Replaces the mapped colour where its alpha is not 0.
    @location(3) paint: vec4f,
}

struct Point {
    @builtin(position) clip: vec4f,
    @location(0) value: f32,
    @location(1) @interpolate(flat) paint: vec4f,
    @location(2) normal: vec3f,
}

@vertex
fn mesh_vertex(vertex: Vertex) -> Point {
    return Point(
        view.clip * vec4f(vertex.position, 1.0), vertex.value, vertex.paint, vertex.normal
    );
}

@fragment
fn mesh_fragment(point: Point) -> @location(0) vec4f {
    return vec4f(lit(colour(point.value, point.paint), normalize(point.normal)), 1.0);
}
