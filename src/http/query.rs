//! Query parameters, read by name: every one that is wrong is reported, by its name.

use std::fmt::Display;
use std::str::FromStr;

use axum::extract::Query;
use axum::http::Uri;

use crate::problem::{FieldError, Problem};
use crate::quote::{quote, shorten};

/// The parameters of one request that have not been taken yet.
#[derive(Debug)]
pub struct Params {
    left: Vec<(String, String)>,
    known: Vec<&'static str>,
    errors: Vec<FieldError>,
}

impl Params {
    /// The parameters of a URI.
    ///
    /// # Errors
    /// 400 where the query is not valid UTF-8 once decoded.
    pub fn new(uri: &Uri) -> Result<Params, Problem> {
        let Query(left) = Query::try_from_uri(uri)
            .map_err(|_| Problem::malformed("the query is not valid UTF-8 text once decoded"))?;
        Ok(Params { left, known: Vec::new(), errors: Vec::new() })
    }

    /// Notes a parameter as wrong.
    pub fn reject(&mut self, name: &str, detail: impl Into<String>) {
        let pointer = shorten(name.to_owned());
        self.errors.push(FieldError { pointer, detail: detail.into() });
    }

    /// Takes a parameter's text.
    pub fn text(&mut self, name: &'static str) -> Option<String> {
        self.known.push(name);
        let at = self.left.iter().position(|(key, _)| key == name)?;
        let (_, value) = self.left.remove(at);
        if self.left.iter().any(|(key, _)| key == name) {
            self.left.retain(|(key, _)| key != name);
            self.reject(name, "is given more than once");
        }
        Some(value)
    }

    fn parsed<T: FromStr>(&mut self, name: &'static str, expected: impl Display) -> Option<T> {
        let text = self.text(name)?;
        let value = text.parse().ok();
        if value.is_none() {
            self.reject(name, format!("expected {expected}, found {}", quote(&text)));
        }
        value
    }

    /// Takes a whole number within a range.
    pub fn whole(&mut self, name: &'static str, lowest: u32, highest: u32) -> Option<u32> {
        let expected = format!("a whole number from {lowest} to {highest}");
        let value = self.parsed(name, &expected)?;
        if !(lowest..=highest).contains(&value) {
            self.reject(name, format!("expected {expected}, found {value}"));
            return None;
        }
        Some(value)
    }

    /// Takes a whole number within a range that must be there.
    pub fn required_whole(&mut self, name: &'static str, lowest: u32, highest: u32) -> Option<u32> {
        if self.is_missing(name, "a whole number") {
            return None;
        }
        self.whole(name, lowest, highest)
    }

    /// Takes a number within a range.
    pub fn number<T: FromStr + PartialOrd + Display>(
        &mut self,
        name: &'static str,
        lowest: T,
        highest: T,
    ) -> Option<T> {
        let expected = format!("a number from {lowest} to {highest}");
        let value = self.parsed(name, &expected)?;
        if !(lowest..=highest).contains(&value) {
            self.reject(name, format!("expected {expected}, found {value}"));
            return None;
        }
        Some(value)
    }

    /// Takes one of some names.
    pub fn choice<T: Copy>(&mut self, name: &'static str, known: &[(&str, T)]) -> Option<T> {
        let text = self.text(name)?;
        let found = known.iter().find(|(known, _)| *known == text).map(|(_, value)| *value);
        if found.is_none() {
            let known: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
            let known = known.join(", ");
            self.reject(name, format!("expected {known}, found {}", quote(&text)));
        }
        found
    }

    /// Takes a finite number that must be there.
    pub fn required_number(&mut self, name: &'static str) -> Option<f64> {
        if self.is_missing(name, "a number") {
            return None;
        }
        let value: f64 = self.parsed(name, "a number")?;
        if !value.is_finite() {
            self.reject(name, format!("expected a finite number, found {value}"));
            return None;
        }
        Some(value)
    }

    fn is_missing(&mut self, name: &'static str, expected: &str) -> bool {
        let missing = !self.left.iter().any(|(key, _)| key == name);
        if missing {
            self.known.push(name);
            self.reject(name, format!("the parameter is missing; {expected} was expected"));
        }
        missing
    }

    /// Takes `true` or `false`.
    pub fn flag(&mut self, name: &'static str) -> Option<bool> {
        self.parsed(name, "'true' or 'false'")
    }

    /// Reports everything that was wrong, and what is left over.
    ///
    /// # Errors
    /// 422 naming each parameter.
    pub fn finish(mut self) -> Result<(), Problem> {
        for (name, _) in std::mem::take(&mut self.left) {
            let known = self.known.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>();
            let detail = format!("unknown parameter; known are {}", known.join(", "));
            self.reject(&name, detail);
        }
        if self.errors.is_empty() { Ok(()) } else { Err(Problem::invalid(self.errors)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn params(query: &str) -> Params {
        Params::new(&format!("/x?{query}").parse().unwrap()).unwrap()
    }

    fn named(params: Params) -> Vec<String> {
        let problem = params.finish().unwrap_err();
        assert_eq!(problem.status, 422);
        problem.errors.iter().map(|error| error.pointer.clone()).collect()
    }

    #[test]
    fn known_parameters_are_read() {
        let mut params = params("width=4&surface=true&x=1.5e0&zoom=2&axis=z");
        assert_eq!(params.number("zoom", 0.1, 10.0), Some(2.0));
        assert_eq!(params.choice("axis", &[("x", 0), ("z", 1)]), Some(1));
        assert_eq!(params.whole("width", 1, 10), Some(4));
        assert_eq!(params.whole("depth", 1, 10), None);
        assert_eq!(params.flag("surface"), Some(true));
        assert_eq!(params.required_number("x"), Some(1.5));
        assert_eq!(params.finish(), Ok(()));
    }

    #[test]
    fn everything_wrong_is_named() {
        let mut params = params("width=11&depth=-1&surface=yes&x=nan&stray=1&twice=1&twice=2");
        assert_eq!(params.whole("width", 1, 10), None);
        assert_eq!(params.whole("depth", 1, 10), None);
        assert_eq!(params.flag("surface"), None);
        assert_eq!(params.required_number("x"), None);
        assert_eq!(params.required_number("z"), None);
        params.text("twice");
        assert_eq!(named(params), ["width", "depth", "surface", "x", "z", "twice", "stray"]);
        let mut params = self::params("zoom=nan&yaw=400&axis=y");
        assert_eq!(params.number("zoom", 0.1, 10.0), None);
        assert_eq!(params.number("yaw", -360.0, 360.0), None);
        assert_eq!(params.choice("axis", &[("x", 0), ("z", 1)]), None);
        assert_eq!(params.required_whole("column_x", 0, 9), None);
        assert_eq!(named(params), ["zoom", "yaw", "axis", "column_x"]);
    }
}
