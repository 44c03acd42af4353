//! The legend, and the axes of a section.

use embedded_graphics::text::Alignment;
use glam::{Mat4, Vec3};

use super::Picture;
use super::camera::Bounds;
use super::canvas::{Canvas, font};
use super::layout::{Area, Layout};
use super::scale::{self, Scale};

/// Length of a tick in pixels.
const TICK: u32 = 5;

/// Draws the colours with their values, and above them what they show.
pub fn legend(canvas: &mut Canvas, picture: &Picture, scale: &Scale) {
    let Some(bar) = Layout::new(picture).legend else { return };
    let character = font(picture.width, picture.height).character_size;
    let line = character.height as i32;
    let (left, top) = (bar.x as i32, bar.y as i32);
    canvas.write(scale.field.name(), (left, top - 2 * line), Alignment::Left);
    let unit = format!("[{}]", scale.field.unit());
    canvas.write(&unit, (left, top - line), Alignment::Left);
    let value = |row: f32| scale.to + (scale.from - scale.to) * row / bar.height as f32;
    for row in 0..bar.height {
        let colour = scale.colour(value(row as f32 + 0.5));
        canvas.fill((left, top + row as i32), (bar.width, 1), Some(colour));
    }
    let right = left + bar.width as i32;
    for (value, text) in scale.ticks(bar.height / (2 * character.height)) {
        let part = (scale.to - value) / (scale.to - scale.from);
        let y = top + (part * (bar.height - 1) as f32).round() as i32;
        canvas.fill((right, y), (TICK, 1), None);
        canvas.write(&text, (right + TICK as i32 + line / 4, y), Alignment::Left);
    }
}

/// Draws metres along the lower and the left edge of what is shown.
pub fn axes(canvas: &mut Canvas, picture: &Picture, clip: &Mat4, bounds: &Bounds) {
    let Layout { scene, .. } = Layout::new(picture);
    let character = font(picture.width, picture.height).character_size;
    let (width, line) = (character.width, character.height as i32);
    let pixel = |point: Vec3| in_pixels(clip, &scene, point);
    let low = Vec3::new(bounds.low.x, 0.0, bounds.low.z);
    let ((left, bottom), (right, top)) = (pixel(low), pixel(bounds.high));
    let base = pixel(bounds.low).1;

    canvas.fill((left - 2, top), (1, (bottom - top).unsigned_abs() + 1), None);
    let most = (bottom - top).unsigned_abs() / (2 * character.height);
    for (value, text) in scale::ticks(0.0, bounds.high.y, most.clamp(1, 10)) {
        let (_, y) = pixel(low.with_y(value));
        canvas.fill((left - 2 - TICK as i32, y), (TICK, 1), None);
        canvas.write(&text, (left - 4 - TICK as i32, y), Alignment::Right);
    }
    canvas.write("y [m]", (left - 4 - TICK as i32, top - line), Alignment::Right);
    canvas.fill((left, base + 2), ((right - left).unsigned_abs() + 1, 1), None);
    let most = (right - left).unsigned_abs() / (7 * width);
    let runs = |point: Vec3| match picture.along {
        super::Axis::X => point.x,
        super::Axis::Z => point.z,
    };
    for (value, text) in scale::ticks(runs(bounds.low), runs(bounds.high), most.clamp(1, 10)) {
        let (x, _) = pixel(Vec3::new(value, 0.0, value));
        canvas.fill((x, base + 3), (1, TICK), None);
        canvas.write(&text, (x, base + 3 + TICK as i32 + line / 2 + 2), Alignment::Center);
    }
    let title = format!("{} [m]", picture.along.name());
    let below = base + 3 + TICK as i32 + 3 * line / 2 + 4;
    canvas.write(&title, ((left + right) / 2, below), Alignment::Center);
}

fn in_pixels(clip: &Mat4, area: &Area, point: Vec3) -> (i32, i32) {
    let place = clip.project_point3(point);
    let x = area.x as f32 + (place.x + 1.0) / 2.0 * area.width as f32;
    let y = area.y as f32 + (1.0 - place.y) / 2.0 * area.height as f32;
    (x.round() as i32, y.round() as i32)
}
