//! How much of the short wave on level ground falls on each column: its surface is tilted, and terrain or snow may
//! stand between it and the sun.

use std::ops::Range;

use super::weather_step::WeatherStep;

/// Largest part of the direct light on level ground that falls on a slope: where the sun is low, slopes see far more.
const MOST_DIRECT: f32 = 20.0;

/// The surface of a snowpack, as light falls on it.
#[derive(Debug)]
pub struct Relief {
    /// Columns along x and z.
    pub size: [u32; 2],
    /// Elevation of each column's surface in cells, row by row.
    pub elevations: Vec<f32>,
}

/// How the grid is swept away from the sun, line by line. All lines go along x or z, whichever is nearer to the sun's
/// direction, and shift sideways on their way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// Lines go along x rather than z.
    pub along_x: bool,
    /// They begin at the far end.
    pub backwards: bool,
    /// Sideways shift in a column, times 2¹⁶.
    pub shift: i32,
    /// Cells by which shadow sinks in a column.
    pub sinks: f32,
}

impl Sweep {
    /// That of a sun in some direction: east, up, north.
    pub fn new(sun: [f32; 3]) -> Sweep {
        let [east, up, north] = sun;
        let along_x = east.abs() > north.abs();
        let (main, side) = if along_x { (east, north) } else { (north, east) };
        // Where the sun is overhead, there is no shadow to speak of.
        let level = main.abs().max(1e-6);
        Sweep {
            along_x,
            // Light travels away from the sun.
            backwards: main > 0.0,
            shift: (-side / level * 65_536.0) as i32,
            sinks: up / level,
        }
    }

    /// Sideways shift of a line after so many columns, rounded.
    fn shifted(&self, step: u32) -> i32 {
        (step as i32 * self.shift + 0x8000) >> 16
    }

    /// The lines that meet a grid of so many columns along x and z.
    pub fn lines(&self, [width, depth]: [u32; 2]) -> Range<i32> {
        let (length, breadth) = if self.along_x { (width, depth) } else { (depth, width) };
        let most = self.shifted(length - 1).abs();
        -most..breadth as i32 + most
    }
}

impl Relief {
    /// What falls on each column of the short wave on level ground, as a part of it.
    pub fn shine(&self, weather: &WeatherStep) -> Vec<f32> {
        let lit = self.lit(weather);
        let [width, depth] = self.size;
        let columns = (0..depth).flat_map(|z| (0..width).map(move |x| (x, z)));
        columns.zip(lit).map(|((x, z), lit)| self.shine_on(x, z, lit, weather)).collect()
    }

    fn at(&self, x: u32, z: u32) -> f32 {
        self.elevations[z as usize * self.size[0] as usize + x as usize]
    }

    /// Rise of the surface towards larger x and z at a column.
    fn gradient(&self, x: u32, z: u32) -> [f32; 2] {
        let around = |at: u32, end: u32| (at.saturating_sub(1), (at + 1).min(end - 1));
        let rise = |low: f32, high: f32, cells: u32| (high - low) / cells.max(1) as f32;
        let (x0, x1) = around(x, self.size[0]);
        let (z0, z1) = around(z, self.size[1]);
        [
            rise(self.at(x0, z), self.at(x1, z), x1 - x0),
            rise(self.at(x, z0), self.at(x, z1), z1 - z0),
        ]
    }

    fn shine_on(&self, x: u32, z: u32, lit: bool, weather: &WeatherStep) -> f32 {
        let [rise_x, rise_z] = self.gradient(x, z);
        let flat = 1.0 / (1.0 + rise_x * rise_x + rise_z * rise_z).sqrt();
        let sky = 0.5 * (1.0 + flat);
        let [east, up, north] = weather.sun;
        let direct = match lit && weather.diffuse < 1.0 {
            true => ((up - rise_x * east - rise_z * north) * flat / up).clamp(0.0, MOST_DIRECT),
            false => 0.0,
        };
        // Exactly 1 on level open ground.
        1.0 + (1.0 - weather.diffuse) * (direct - 1.0) + weather.diffuse * (sky - 1.0)
    }

    /// Columns that see the sun.
    fn lit(&self, weather: &WeatherStep) -> Vec<bool> {
        let [width, depth] = self.size;
        let mut lit = vec![weather.diffuse < 1.0; width as usize * depth as usize];
        if weather.diffuse >= 1.0 {
            return lit;
        }
        let sweep = Sweep::new(weather.sun);
        let (length, breadth) = if sweep.along_x { (width, depth) } else { (depth, width) };
        for line in sweep.lines(self.size) {
            let mut shadow = f32::MIN;
            for step in 0..length {
                let side = line + sweep.shifted(step);
                shadow -= sweep.sinks;
                if side < 0 || side >= breadth as i32 {
                    continue;
                }
                let along = if sweep.backwards { length - 1 - step } else { step };
                let (x, z) =
                    if sweep.along_x { (along, side as u32) } else { (side as u32, along) };
                let index = z as usize * width as usize + x as usize;
                lit[index] = shadow <= self.elevations[index];
                shadow = shadow.max(self.elevations[index]);
            }
        }
        lit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weather(azimuth: f32, elevation: f32, diffuse: f32) -> WeatherStep {
        let (azimuth, elevation) = (azimuth.to_radians(), elevation.to_radians());
        let flat = elevation.cos();
        let sun = [flat * azimuth.sin(), elevation.sin(), flat * azimuth.cos()];
        WeatherStep { sun, diffuse, ..WeatherStep::default() }
    }

    fn relief(width: u32, depth: u32, of: impl Fn(u32, u32) -> f32) -> Relief {
        let columns = (0..depth).flat_map(|z| (0..width).map(move |x| (x, z)));
        Relief { size: [width, depth], elevations: columns.map(|(x, z)| of(x, z)).collect() }
    }

    #[test]
    fn level_open_ground_has_exactly_what_is_given() {
        let level = relief(13, 7, |_, _| 3.3);
        for azimuth in [0.0, 33.0, 90.0, 181.0, 275.0] {
            for (elevation, diffuse) in [(2.0, 0.137), (30.0, 0.3), (60.0, 1.0)] {
                let shine = level.shine(&weather(azimuth, elevation, diffuse));
                assert!(shine.iter().all(|&part| part == 1.0), "{azimuth} {elevation}");
            }
        }
    }

    #[test]
    fn a_slope_that_faces_the_sun_has_more_than_one_that_does_not() {
        // Rises by half a cell a column towards north: it faces south.
        let south = relief(9, 9, |_, z| 0.5 * z as f32);
        let lit = south.shine(&weather(180.0, 45.0, 0.0));
        // cos(45° − 26.6°) / sin 45°.
        assert!((lit[40] - 1.3416).abs() < 1e-3, "{}", lit[40]);
        let turned = south.shine(&weather(0.0, 45.0, 0.0));
        assert!((turned[40] - 0.4472).abs() < 1e-3, "{}", turned[40]);
        assert_eq!(south.shine(&weather(0.0, 20.0, 0.0))[40], 0.0);
    }

    #[test]
    fn a_wall_throws_a_shadow_as_long_as_the_sun_is_low() {
        for (azimuth, step) in [(0.0, (0, -1)), (90.0, (-1, 0)), (180.0, (0, 1)), (270.0, (1, 0))] {
            let wall = relief(41, 41, |x, z| if (x, z) == (20, 20) { 10.0 } else { 0.0 });
            let lit = wall.lit(&weather(azimuth, 45.0, 0.0));
            let dark = (1..20).take_while(|i| {
                let (x, z) = (20 + i * step.0, 20 + i * step.1);
                !lit[(z * 41 + x) as usize]
            });
            assert_eq!(
                dark.count(),
                9,
                "{azimuth}: it ends where the tenth column touches the light"
            );
            assert_eq!(lit.iter().filter(|lit| !**lit).count(), 9);
        }
    }

    #[test]
    fn a_shadow_falls_aslant_too() {
        let wall = relief(41, 41, |x, z| if (x, z) == (20, 20) { 10.0 } else { 0.0 });
        let lit = wall.lit(&weather(225.0, 30.0, 0.0));
        assert!(!lit[23 * 41 + 23] && lit[17 * 41 + 17] && lit[20 * 41 + 24]);
    }
}
