//! A study's table as text.

use std::fmt::{self, Display, Formatter};

use super::study::Study;

const HEAD: [&str; 4] = ["", "thesis", "oracle", "Firn"];

impl Display for Study {
    /// The title, and a line for each quantity.
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        let mut lines = vec![HEAD.map(str::to_owned)];
        lines.extend(self.rows.iter().map(super::Row::cells));
        let widths: Vec<usize> = (0..HEAD.len())
            .map(|i| lines.iter().map(|line| line[i].chars().count()).max().unwrap_or(0))
            .collect();
        writeln!(out, "{}", self.title)?;
        for line in &lines {
            let [quantity, numbers @ ..] = line;
            write!(out, "  {quantity:<width$}", width = widths[0])?;
            for (text, &width) in numbers.iter().zip(&widths[1..]) {
                write!(out, "  {text:>width$}")?;
            }
            writeln!(out)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Expected, Row};
    use super::*;

    #[test]
    fn numbers_stand_below_each_other() {
        let study = Study {
            name: "x".to_owned(),
            title: "Title".to_owned(),
            profiles: Vec::new(),
            histories: Vec::new(),
            thesis_height: None,
            oracle_heights: Vec::new(),
            rows: vec![
                Row::new("height [m]", 3, 4.6851).thesis("4.8").expect(Expected::height(4.685)),
                Row::new("coldest [°C]", 1, -15.0).expect(Expected::AtMost(-14.9)),
            ],
        };
        let expected = "\
Title
                thesis   oracle   Firn
  height [m]       4.8    4.685  4.685
  coldest [°C]       –  ≤ −14.9  −15.0
";
        assert_eq!(study.to_string(), expected);
    }
}
