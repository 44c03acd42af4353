// How a scene is seen; `src/render/painter.rs` has the same.
struct View {
    clip: mat4x4f,
    // Where it is seen from; a direction, with w = 0, where nothing gets smaller with distance.
    eye: vec4f,
    // Direction to the light.
    light: vec3f,
    // From 0 (everything has its own colour) to 1 (sides are shaded, cells have outlines).
    shading: f32,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var colours: texture_2d<f32>;

// The brightness of faces that the light does not reach, beside that of level ones.
const AMBIENT: f32 = 0.62;

// The colour of a value from 0 to 1, unless paint covers it. Between what is painted and what is not the value counts.
fn colour(value: f32, paint: vec4f) -> vec3f {
    let last = f32(textureDimensions(colours).x - 1u);
    let mapped = textureLoad(colours, vec2u(u32(clamp(value, 0.0, 1.0) * last + 0.5), 0u), 0).rgb;
    return select(mapped, paint.rgb, paint.a > 0.99);
}

// Level faces keep their colour, so that it can be found in the legend.
fn lit(colour: vec3f, normal: vec3f) -> vec3f {
    let brightness = mix(AMBIENT, 1.0, max(dot(normal, view.light), 0.0) / view.light.y);
    return colour * mix(1.0, min(brightness, 1.0), view.shading);
}
