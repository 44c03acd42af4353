//! The step that heights are rounded to, and its multiples as decimal numbers.

use crate::session::Invalid;

/// The step that heights are rounded to, as the decimal number that its client wrote.
///
/// Multiples of it are written exactly, so that 4685 steps of 0.001 read 4.685.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantum {
    metres: f64,
    /// The step is `digits` · 10^−`decimals`.
    digits: u64,
    decimals: usize,
}

impl Quantum {
    /// The step that elevations of the ground are rounded to: those within ±20 000 m, farther than ground may
    /// lie, fit 32 bits.
    pub const OF_GROUND: Quantum = Quantum { metres: 1e-4, digits: 1, decimals: 4 };

    /// A step of 0.0001 to 1 m.
    ///
    /// # Errors
    /// Any other.
    pub fn new(metres: f64) -> Result<Quantum, Invalid> {
        if !(1e-4..=1.0).contains(&metres) {
            let detail = format!("{metres} is not within 0.0001 to 1 m");
            return Err(Invalid::new("/quantum", detail));
        }
        let text = metres.to_string();
        let (whole, fraction) = text.split_once('.').unwrap_or((&text, ""));
        let digits = format!("{whole}{fraction}");
        let digits = digits.parse().expect("17 digits are enough for any number");
        Ok(Quantum { metres, digits, decimals: fraction.len() })
    }

    /// The step \[m\].
    pub fn metres(&self) -> f64 {
        self.metres
    }

    /// Number of steps nearest to a height or an elevation \[m\], halves rounded up: ⌊height/quantum + ½⌋.
    pub fn steps(&self, height: f64) -> i64 {
        (height / self.metres + 0.5).floor() as i64
    }

    /// Writes a number of steps in metres.
    pub fn write(&self, steps: i64, out: &mut Vec<u8>) {
        if steps < 0 {
            out.push(b'-');
        }
        let mut left = u128::from(steps.unsigned_abs()) * u128::from(self.digits);
        let mut text = [b'0'; 48];
        let mut start = text.len();
        // A digit before the point is always written.
        while left > 0 || text.len() - start <= self.decimals {
            start -= 1;
            text[start] = b'0'
                + if let Ok(short) = u64::try_from(left) {
                    left = u128::from(short / 10);
                    (short % 10) as u8
                } else {
                    let digit = (left % 10) as u8;
                    left /= 10;
                    digit
                };
        }
        let (whole, fraction) = text[start..].split_at(text.len() - start - self.decimals);
        out.extend_from_slice(whole);
        if let Some(last) = fraction.iter().rposition(|&digit| digit != b'0') {
            out.push(b'.');
            out.extend_from_slice(&fraction[..=last]);
        }
    }
}
