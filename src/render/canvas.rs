//! A picture on the host: writing is put on it, and it is written down.

use std::convert::Infallible;

use embedded_graphics::Pixel;
use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{OriginDimensions, Point, Size};
use embedded_graphics::mono_font::iso_8859_1::{
    FONT_5X8, FONT_6X12, FONT_7X13, FONT_9X15, FONT_10X20,
};
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::{Rgb888, RgbColor};
use embedded_graphics::primitives::Rectangle;
use embedded_graphics::text::{Alignment, Baseline, Text, TextStyleBuilder};

/// Height in pixels from which a picture is written on with a font.
const FONTS: [(u32, &MonoFont<'static>); 5] =
    [(1000, &FONT_10X20), (560, &FONT_9X15), (400, &FONT_7X13), (260, &FONT_6X12), (0, &FONT_5X8)];

/// The font for pictures of a size.
pub fn font(width: u32, height: u32) -> &'static MonoFont<'static> {
    let small = height.min(width * 3 / 4);
    let fits = FONTS.iter().find(|(from, _)| small >= *from);
    fits.map_or(&FONT_5X8, |(_, font)| font)
}

/// Pixels with red, green, blue and alpha, row by row.
pub struct Canvas {
    width: u32,
    height: u32,
    pixels: Vec<u8>,
    ink: Rgb888,
}

impl Canvas {
    /// On pixels that were drawn already; writing is done in `ink`.
    pub fn new(width: u32, height: u32, pixels: Vec<u8>, ink: [u8; 3]) -> Canvas {
        let [r, g, b] = ink;
        Canvas { width, height, pixels, ink: Rgb888::new(r, g, b) }
    }

    /// Writes a line; `place` is its middle in height, and its left end, middle or right end.
    pub fn write(&mut self, text: &str, place: (i32, i32), alignment: Alignment) {
        let font = font(self.width, self.height);
        let style = MonoTextStyle::new(font, self.ink);
        let layout = TextStyleBuilder::new().alignment(alignment).baseline(Baseline::Middle);
        let text = Text::with_text_style(text, Point::new(place.0, place.1), style, layout.build());
        draw(embedded_graphics::Drawable::draw(&text, self));
    }

    /// Fills a rectangle with a colour, or with ink.
    pub fn fill(
        &mut self,
        (x, y): (i32, i32),
        (width, height): (u32, u32),
        colour: Option<[u8; 3]>,
    ) {
        let colour = colour.map_or(self.ink, |[r, g, b]| Rgb888::new(r, g, b));
        let area = Rectangle::new(Point::new(x, y), Size::new(width, height));
        draw(self.fill_solid(&area, colour));
    }

    /// As a PNG file, with transparency where it is asked for.
    ///
    /// # Errors
    /// Those of the encoder; none is known.
    pub fn png(mut self, transparent: bool) -> Result<Vec<u8>, png::EncodingError> {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, self.width, self.height);
        encoder.set_color(if transparent { png::ColorType::Rgba } else { png::ColorType::Rgb });
        // Few colours with sharp edges: what filters do for photographs makes these larger.
        encoder.set_filter(png::Filter::NoFilter);
        encoder.set_deflate_compression(png::DeflateCompression::Level(4));
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let mut writer = encoder.write_header()?;
        if transparent {
            self.divide_by_alpha();
        } else {
            self.pixels = self.pixels.chunks(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
        }
        writer.write_image_data(&self.pixels)?;
        writer.finish()?;
        Ok(file)
    }

    /// Edges were averaged with a background of nothing; PNG wants colours without it.
    fn divide_by_alpha(&mut self) {
        for pixel in self.pixels.chunks_exact_mut(4) {
            if let (alpha @ 1..=254, colour) = (u16::from(pixel[3]), &mut pixel[..3]) {
                colour.iter_mut().for_each(|part| {
                    *part = ((u16::from(*part) * 255 + alpha / 2) / alpha).min(255) as u8;
                });
            }
        }
    }
}

/// Drawing into memory can't fail.
fn draw<T>(drawn: Result<T, Infallible>) {
    match drawn {
        Ok(_) => {}
        Err(never) => match never {},
    }
}

impl OriginDimensions for Canvas {
    fn size(&self) -> Size {
        Size::new(self.width, self.height)
    }
}

impl DrawTarget for Canvas {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(
        &mut self,
        pixels: I,
    ) -> Result<(), Infallible> {
        for Pixel(Point { x, y }, colour) in pixels {
            let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y)) else { continue };
            if x < self.width && y < self.height {
                let first = (y as usize * self.width as usize + x as usize) * 4;
                let pixel = [colour.r(), colour.g(), colour.b(), 255];
                self.pixels[first..first + 4].copy_from_slice(&pixel);
            }
        }
        Ok(())
    }
}
