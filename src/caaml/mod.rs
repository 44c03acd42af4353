//! A column of alpine snow as a snow profile after CAAML 6.0.3, the field's format for snow pits.
//!
//! Written are the time, the place where it is known, the depth and the water equivalent, and of each cell its place,
//! hardness by hand, wetness, temperature, density and liquid water. Grains have no shape here, so none is told.

mod moment;
mod xml;

use firn_protocol::{AlpineColumn, ColumnView, HandHardness, LayerView};
use firn_snow::weather::Site;

use self::xml::Xml;

/// Media type of a profile.
pub const MEDIA_TYPE: &str = "application/xml";

/// Most bytes of the profile of a column of 255 cells.
pub const MOST_BYTES: u64 = 512 << 10;

/// Bytes of a profile for each cell, about.
const CELL_BYTES: usize = 1200;

const NAMESPACES: [(&str, &str); 2] = [
    ("xmlns:caaml", "http://caaml.org/Schemas/SnowProfileIACS/v6.0.3"),
    ("xmlns:gml", "http://www.opengis.net/gml"),
];

/// Longitude and latitude, in that order.
const COORDINATES: &str = "urn:ogc:def:crs:OGC:1.3:CRS84";

const CENTIMETRES: [(&str, &str); 1] = [("uom", "cm")];

/// Density of water \[kg/m³\].
const WATER_DENSITY: f64 = 1000.0;

/// Parts of the volume that are water from which snow is wet, very wet and soaked; with less it is moist (Fierz et al.
/// 2009).
const WETNESS: [(f64, &str); 3] = [(0.15, "S"), (0.08, "V"), (0.03, "W")];

/// A column to be written.
#[derive(Debug)]
pub struct Profile<'a> {
    /// Name of the session.
    pub session: &'a str,
    /// The column's places along x and z.
    pub place: [u32; 2],
    /// Its cells.
    pub column: &'a ColumnView,
    /// What it has beside them.
    pub alpine: AlpineColumn,
    /// Where and when the snow is.
    pub site: &'a Site,
    /// The simulated time at which the column was so \[s\].
    pub time: f64,
    /// When the profile was asked for, in seconds since 1970-01-01T00:00:00Z.
    pub asked: f64,
}

impl Profile<'_> {
    /// The profile as XML.
    pub fn write(&self) -> String {
        let mut xml = Xml::new(4096 + CELL_BYTES * self.column.layers.len());
        let [x, z] = self.place;
        // An id begins with a letter; a session's name need not.
        let id = format!("firn-{}-{x}-{z}", self.session);
        let attributes = [&NAMESPACES[..], &[("gml:id", &*id)]].concat();
        xml.element("caaml:SnowProfile", &attributes, |xml| {
            self.remark(xml);
            self.time(xml);
            xml.element("caaml:srcRef", &[], |xml| {
                xml.element("caaml:Operation", &[("gml:id", "firn")], |xml| {
                    xml.text("caaml:name", &[], concat!("Firn ", env!("CARGO_PKG_VERSION")));
                });
            });
            self.location(xml, &id);
            xml.element("caaml:snowProfileResultsOf", &[], |xml| {
                let direction = [("dir", "top down")];
                xml.element("caaml:SnowProfileMeasurements", &direction, |xml| self.snow(xml));
            });
        });
        xml.finish()
    }

    fn remark(&self, xml: &mut Xml) {
        let clock = match self.site.start {
            Some(_) => "the site's start and the simulated time since",
            None => "the simulated time, counted from 1970-01-01 because the site has no start",
        };
        let remark = format!("Simulated snow. The time is {clock}: {} s.", self.time);
        xml.element("caaml:metaData", &[], |xml| xml.text("caaml:comment", &[], remark));
    }

    fn time(&self, xml: &mut Xml) {
        let instant = self.site.instant(self.time).unwrap_or(self.time);
        xml.element("caaml:timeRef", &[], |xml| {
            xml.element("caaml:recordTime", &[], |xml| {
                xml.element("caaml:TimeInstant", &[], |xml| {
                    xml.text("caaml:timePosition", &[], moment::written(instant));
                });
            });
            xml.text("caaml:dateTimeReport", &[], moment::written(self.asked.floor()));
        });
    }

    fn location(&self, xml: &mut Xml, id: &str) {
        let [x, z] = self.place;
        let (location, point) = (format!("{id}-location"), format!("{id}-point"));
        xml.element("caaml:locRef", &[("gml:id", &*location)], |xml| {
            xml.text("caaml:name", &[], format_args!("{}, column {x}/{z}", self.session));
            xml.empty("caaml:obsPointSubType");
            let Site { latitude: Some(latitude), longitude: Some(longitude), .. } = *self.site
            else {
                return;
            };
            xml.element("caaml:pointLocation", &[], |xml| {
                let attributes =
                    [("gml:id", &*point), ("srsName", COORDINATES), ("srsDimension", "2")];
                xml.element("gml:Point", &attributes, |xml| {
                    xml.text("gml:pos", &[], format_args!("{longitude} {latitude}"));
                });
            });
        });
    }

    fn snow(&self, xml: &mut Xml) {
        let depth = centimetres(self.column.height);
        xml.text("caaml:profileDepth", &CENTIMETRES, depth);
        xml.element("caaml:snowPackCond", &[], |xml| {
            xml.element("caaml:hS", &[], |xml| {
                xml.element("caaml:Components", &[], |xml| {
                    xml.text("caaml:height", &CENTIMETRES, depth);
                    let water = rounded(self.alpine.snow_water_equivalent, 3);
                    xml.text("caaml:waterEquivalent", &[("uom", "kgm-2")], water);
                });
            });
        });
        if self.column.layers.is_empty() {
            return;
        }
        xml.element("caaml:stratProfile", &[], |xml| {
            xml.empty("caaml:stratMetaData");
            self.layers(xml, |xml, layer| {
                xml.text("caaml:hardness", &[("uom", "")], hand_hardness(layer));
                xml.text("caaml:wetness", &[("uom", "")], wetness(layer));
            });
        });
        xml.element("caaml:tempProfile", &[], |xml| {
            xml.empty("caaml:tempMetaData");
            temperature(xml, 0.0, self.alpine.skin_temperature);
            for layer in self.column.layers.iter().rev() {
                let middle = self.column.height - layer.bottom - layer.thickness / 2.0;
                temperature(xml, middle, layer.temperature);
            }
        });
        xml.element("caaml:densityProfile", &[], |xml| {
            method(xml, "caaml:densityMetaData");
            self.layers(xml, |xml, layer| {
                xml.text("caaml:density", &[("uom", "kgm-3")], rounded(layer.density, 3));
            });
        });
        xml.element("caaml:lwcProfile", &[], |xml| {
            method(xml, "caaml:lwcMetaData");
            self.layers(xml, |xml, layer| {
                let percent = rounded(100.0 * water_content(layer), 3);
                xml.text("caaml:lwc", &[("uom", "% by Vol")], percent);
            });
        });
    }

    /// Writes each cell from the surface down: its place, and more.
    fn layers(&self, xml: &mut Xml, more: impl Fn(&mut Xml, &LayerView)) {
        for layer in self.column.layers.iter().rev() {
            let top = self.column.height - layer.bottom - layer.thickness;
            xml.element("caaml:Layer", &[], |xml| {
                xml.text("caaml:depthTop", &CENTIMETRES, centimetres(top));
                xml.text("caaml:thickness", &CENTIMETRES, centimetres(layer.thickness));
                more(xml, layer);
            });
        }
    }
}

fn method(xml: &mut Xml, name: &str) {
    xml.element(name, &[], |xml| xml.text("caaml:methodOfMeas", &[], "other"));
}

fn temperature(xml: &mut Xml, depth: f64, celsius: f64) {
    xml.element("caaml:Obs", &[], |xml| {
        xml.text("caaml:depth", &CENTIMETRES, centimetres(depth));
        xml.text("caaml:snowTemp", &[("uom", "degC")], rounded(celsius, 3));
    });
}

fn hand_hardness(layer: &LayerView) -> &'static str {
    match layer.hand_hardness {
        None | Some(HandHardness::Fist) => "F",
        Some(HandHardness::FourFingers) => "4F",
        Some(HandHardness::OneFinger) => "1F",
        Some(HandHardness::Pencil) => "P",
        Some(HandHardness::Knife) => "K",
        Some(HandHardness::Ice) => "I",
    }
}

fn wetness(layer: &LayerView) -> &'static str {
    let content = water_content(layer);
    let reached = WETNESS.iter().find(|(from, _)| content >= *from);
    reached.map_or(if content > 0.0 { "M" } else { "D" }, |(_, code)| *code)
}

/// The part of a layer's volume that is liquid water.
fn water_content(layer: &LayerView) -> f64 {
    layer.liquid_water.unwrap_or(0.0) / (WATER_DENSITY * layer.thickness)
}

/// A length in centimetres, to the micrometre.
fn centimetres(metres: f64) -> f64 {
    rounded(100.0 * metres, 4)
}

/// A number to so many places, and never −0.
fn rounded(value: f64, places: i32) -> f64 {
    let steps = 10f64.powi(places);
    (value * steps).round() / steps + 0.0
}

#[cfg(test)]
mod tests;
