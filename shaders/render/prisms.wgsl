// Boxes with sides along the axes, an instance each: cells of the grid, ground, objects.

struct Prism {
    @location(0) low: vec3f,
    // Place in the colour map, from 0 to 1.
    @location(1) value: f32,
    @location(2) high: vec3f,
    // Replaces the mapped colour where its alpha is 1.
    @location(3) paint: vec4f,
    // Faces that can be seen, a bit each: those towards lower x, higher x, lower y and so on.
    @location(4) faces: u32,
}

struct Point {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) value: f32,
    @location(1) @interpolate(flat) paint: vec4f,
    @location(2) @interpolate(flat) normal: vec3f,
    // Place on the face and the face's extent [m].
    @location(3) place: vec2f,
    @location(4) @interpolate(flat) extent: vec2f,
}

const CORNERS = array(
    vec2f(0.0, 0.0), vec2f(1.0, 0.0), vec2f(0.0, 1.0),
    vec2f(0.0, 1.0), vec2f(1.0, 0.0), vec2f(1.0, 1.0),
);

// How much darker outlines are.
const OUTLINE: f32 = 0.3;
// Faces smaller than this many pixels have no outlines.
const SMALLEST: f32 = 3.0;
// Faces of this many pixels more have all of them.
const FADE: f32 = 6.0;

// Three faces of each box can be seen at most, the one of each axis on the side of the eye.
@vertex
fn prism_vertex(@builtin(vertex_index) index: u32, prism: Prism) -> Point {
    let axis = index / 6u;
    let across = (axis + 1u) % 3u;
    let along = (axis + 2u) % 3u;
    let extent = prism.high - prism.low;
    let towards = view.eye.xyz - view.eye.w * (prism.low + 0.5 * extent);
    let side = u32(towards[axis] > 0.0);
    let corner = CORNERS[index % 6u];
    if (prism.faces >> (2u * axis + side) & 1u) == 0u {
        // All corners in one place: nothing is drawn.
        return Point();
    }

    var part = vec3f(0.0);
    part[axis] = f32(side);
    part[across] = corner.x;
    part[along] = corner.y;
    var normal = vec3f(0.0);
    normal[axis] = sign(part[axis] - 0.5);

    var point: Point;
    point.clip = view.clip * vec4f(mix(prism.low, prism.high, part), 1.0);
    point.value = prism.value;
    point.paint = prism.paint;
    point.normal = normal;
    point.extent = vec2f(extent[across], extent[along]);
    point.place = corner * point.extent;
    return point;
}

@fragment
fn prism_fragment(point: Point) -> @location(0) vec4f {
    let pixel = max(fwidth(point.place), vec2f(1e-9));
    let pixels = min(point.extent.x / pixel.x, point.extent.y / pixel.y);
    let edge = min(point.place, point.extent - point.place) / pixel;
    let line = 1.0 - smoothstep(0.0, 1.0, min(edge.x, edge.y));
    let strength = view.shading * OUTLINE * saturate((pixels - SMALLEST) / FADE);
    let outlined = colour(point.value, point.paint) * (1.0 - strength * line);
    return vec4f(lit(outlined, point.normal), 1.0);
}
