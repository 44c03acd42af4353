//! Snow that falls on alpine snow.

use super::weather_step::WeatherStep;
use super::wet::part;
use crate::column::{Cell, mixed};
use crate::grid::CELL;

/// Difference in density at which snow tops up the cell below, as a part of the new snow's.
const ALIKE: f32 = 0.4;

/// Lets the snow fall that is due; returns the mass that found no slot.
pub(super) fn fall(cells: &mut Vec<Cell>, weather: &WeatherStep, slots: u32) -> u32 {
    let (mut mass, mut thickness) = (weather.snow, weather.snow_thickness);
    if let Some(top) = cells.last_mut().filter(|top| tops_up(top, weather)) {
        let celsius = mixed(top.temperature, top.mass, weather.snow_temperature, mass);
        top.mass += mass;
        top.thickness += thickness;
        top.set_heat(celsius, 0);
        return 0;
    }
    while thickness > 0 && (cells.len() as u32) < slots {
        let piece = thickness.min(CELL);
        let share = part(mass, piece as f32 / thickness as f32).min(mass);
        let mut cell = Cell { mass: share, thickness: piece, ..Cell::default() };
        cell.set_heat(weather.snow_temperature, 0);
        cells.push(cell);
        mass -= share;
        thickness -= piece;
    }
    mass
}

/// Whether the snow that is due goes into the topmost cell: it is dry, much as dense, and has room for all of it.
fn tops_up(top: &Cell, weather: &WeatherStep) -> bool {
    let fresh = weather.snow as f32 / weather.snow_thickness as f32;
    let present = top.mass as f32 / top.thickness as f32;
    top.water() == 0
        && top.thickness + weather.snow_thickness <= CELL
        && (present - fresh).abs() <= ALIKE * fresh
}
