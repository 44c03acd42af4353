//! Pictures of the snow, drawn on the graphics device.
//!
//! A picture goes through four rooms. `snow` is what was read of the session; `scene` makes boxes
//! and triangles of it; `painter` draws those with the render pipelines in `shaders/render/`, on the
//! thread of `renderer`; `annotate` writes the legend and the axes on what comes back.

mod annotate;
mod camera;
mod canvas;
mod field;
mod layout;
mod painter;
mod picture;
mod renderer;
mod scale;
mod scene;
mod snow;

pub use camera::{Camera, Projection};
pub use field::Field;
pub use layout::{Area, Layout};
pub use painter::{SHADERS, View as ShaderView};
pub use picture::{Axis, Background, MOST_PIXELS, Picture, SIDES, View};
pub use renderer::{RenderError, Renderer};
pub use scale::{COLOURS, Scale};
pub use scene::{Prism, Vertex};
pub use snow::{Snow, SnowCell};

use crate::threads::Pool;

use camera::Sight;
use canvas::Canvas;
use painter::Shot;
use scene::Scene;

/// Draws a picture; returns a PNG file.
///
/// # Errors
/// [`RenderError`].
pub async fn draw(
    renderer: &Renderer,
    threads: &Pool,
    picture: Picture,
    snow: Snow,
) -> Result<Vec<u8>, RenderError> {
    let shot = threads.run(move || shoot(&picture, &snow)).await;
    let (shot, sight) = shot.ok_or(RenderError::Panicked)?;
    let (scale, bounds) = (shot.scene.scale.clone(), shot.scene.bounds);
    let pixels = renderer.paint(shot).await?;
    let finish = move || {
        let ink = picture.background.ink();
        let mut canvas = Canvas::new(picture.width, picture.height, pixels, ink);
        annotate::legend(&mut canvas, &picture, &scale);
        if Layout::new(&picture).has_axes(&picture) {
            annotate::axes(&mut canvas, &picture, &sight.clip, &bounds);
        }
        canvas.png(picture.background == Background::Transparent)
    };
    Ok(threads.run(finish).await.ok_or(RenderError::Panicked)??)
}

/// What is to be drawn, and how it is seen.
fn shoot(picture: &Picture, snow: &Snow) -> (Shot, Sight) {
    let scene = Scene::new(picture, snow);
    let area = Layout::new(picture).scene;
    let area = [area.x, area.y, area.width, area.height].map(|pixels| pixels as f32);
    let sight = picture.camera().sight(&scene.bounds, (area[2], area[3]));
    let shading = picture.shading && picture.view != View::Section;
    let view = ShaderView {
        clip: sight.clip.to_cols_array(),
        eye: sight.eye.to_array(),
        light: sight.light.to_array(),
        shading: if shading { 1.0 } else { 0.0 },
    };
    let background = picture.background.colour();
    (Shot { size: (picture.width, picture.height), area, view, background, scene }, sight)
}
