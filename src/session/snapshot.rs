//! A whole snowpack in one piece: saved, checked and restored bit for bit. `api/snapshot.md`
//! describes the bytes.

use std::io::Read;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::engine::frame::{Contents, Edit, Placement, TileCells};
use crate::snow::{CELL, Contact, Footprint, Material, Position, Shape, TILE_COLUMNS};

use super::clock::Clock;
use super::error::{Check, Invalid, SessionError};
use super::falling::Falling;
use super::gather::Ledger;
use super::simulation::{Collider, Simulation};
use super::spec::{Limits, SessionSpec};
use super::view::{Settings, Stamp};

/// Media type of a snapshot.
pub const MEDIA_TYPE: &str = "application/vnd.firn.snapshot";

const MAGIC: &[u8; 8] = b"FIRNSNOW";
const VERSION: u32 = 1;
/// Magic, version, four bytes that are 0, and the digest.
const HEAD: usize = 48;
/// Most bytes of the description, which is JSON.
const LONGEST_DESCRIPTION: u64 = 256 << 20;
const COMPRESSION_LEVEL: i32 = 3;

/// A snowpack as it was after some tick, with its configuration and its objects.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// When it was taken.
    pub stamp: Stamp,
    pub(super) description: Description,
    pub(super) tiles: Arc<Vec<TileCells>>,
}

/// Everything but the cells.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Description {
    pub spec: SessionSpec,
    pub settings: Settings,
    pub material: Material,
    pub clock: Clock,
    pub falling: Falling,
    pub ledger: Ledger,
    pub settled: bool,
    pub last_cycle: Option<f64>,
    pub colliders: Vec<SavedCollider>,
}

/// An object and how it touched the snow.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SavedCollider {
    pub id: String,
    pub mass: f64,
    pub shape: Shape,
    pub position: Position,
    pub contact: Contact,
}

impl Snapshot {
    /// Hash of everything in it: equal digests, equal snowpacks.
    ///
    /// # Errors
    /// [`SessionError::Internal`].
    pub fn digest(&self) -> Result<String, SessionError> {
        Ok(blake3::hash(&self.body()?).to_hex().to_string())
    }

    /// The snapshot as bytes.
    ///
    /// # Errors
    /// [`SessionError::Internal`].
    pub fn encode(&self) -> Result<Vec<u8>, SessionError> {
        let body = self.body()?;
        let mut bytes = Vec::with_capacity(HEAD);
        bytes.extend(MAGIC);
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend([0; 4]);
        bytes.extend(blake3::hash(&body).as_bytes());
        bytes.extend(zstd::encode_all(&body[..], COMPRESSION_LEVEL).map_err(internal)?);
        Ok(bytes)
    }

    /// Description and cells, not compressed.
    fn body(&self) -> Result<Vec<u8>, SessionError> {
        let description = serde_json::to_vec(&self.description).map_err(internal)?;
        let mut body = Vec::new();
        body.extend((description.len() as u64).to_le_bytes());
        body.extend(description);
        // Plane by plane, column by column: what is alike lies together.
        let mut planes: [Vec<u8>; 4] = Default::default();
        for (tile, column) in columns(&self.description.spec) {
            let mut count = 0u8;
            for cell in self.tiles[tile].column(column) {
                count += 1;
                planes[0].extend(cell.mass.to_le_bytes());
                planes[1].extend(cell.thickness.to_le_bytes());
                planes[2].extend(cell.temperature.to_le_bytes());
                planes[3].extend(cell.stress.to_le_bytes());
            }
            body.push(count);
        }
        planes.into_iter().for_each(|plane| body.extend(plane));
        Ok(body)
    }

    /// Reads a snapshot, and checks every part of it.
    ///
    /// # Errors
    /// [`SessionError::Invalid`] where it is damaged, cut short, not a snapshot, of a later
    /// version, or of a snowpack that this server doesn't hold.
    pub fn decode(bytes: &[u8], limits: &Limits) -> Result<Snapshot, SessionError> {
        Snapshot::decode_admitted(bytes, limits, |_| Ok(())).map(|(snapshot, ())| snapshot)
    }

    /// As [`Snapshot::decode`], but asks whether there is room before it reads any cells: a small
    /// file can hold a lot of snow.
    ///
    /// # Errors
    /// Those of `admit` beside the others.
    pub(super) fn decode_admitted<T>(
        bytes: &[u8],
        limits: &Limits,
        admit: impl FnOnce(&SessionSpec) -> Result<T, SessionError>,
    ) -> Result<(Snapshot, T), SessionError> {
        let (head, compressed) =
            bytes.split_at_checked(HEAD).ok_or_else(|| refused("it is cut short"))?;
        if head[..8] != *MAGIC {
            return Err(refused("it does not begin as a snapshot does"));
        }
        let version = u32::from_le_bytes([head[8], head[9], head[10], head[11]]);
        if version != VERSION || head[12..16] != [0; 4] {
            return Err(refused(&format!(
                "it has version {version} of the format; this server reads version {VERSION}"
            )));
        }
        let mut reader = Body::open(compressed)?;
        let length = u64::from_le_bytes(reader.array()?);
        if length > LONGEST_DESCRIPTION {
            return Err(refused("its description is too long"));
        }
        let description = reader.bytes(length)?;
        let description: Description = serde_json::from_slice(&description)
            .map_err(|error| refused(&format!("its description can't be read: {error}")))?;
        description.check(limits)?;
        let admitted = admit(&description.spec)?;
        let tiles = reader.tiles(&description.spec)?;
        reader.finish(&head[16..])?;
        description.check_mass(&tiles)?;
        let stamp = Stamp { tick: description.clock.tick(), seq: 0 };
        Ok((Snapshot { stamp, description, tiles: Arc::new(tiles) }, admitted))
    }

    /// What it was created with.
    pub fn spec(&self) -> &SessionSpec {
        &self.description.spec
    }

    /// What a backend restores.
    pub(super) fn contents(&self) -> Contents {
        let grid = &self.description.spec.grid;
        let colliders = self.description.colliders.iter().filter_map(|saved| {
            let footprint = Footprint::new(grid, &saved.shape, saved.position)?;
            let placement = Arc::new(Placement { mass: saved.mass, footprint });
            Some((Arc::from(saved.id.as_str()), placement, saved.contact))
        });
        Contents { tiles: self.tiles.clone(), colliders: colliders.collect() }
    }
}

impl Simulation {
    /// The session as it is now.
    pub(super) fn snapshot(&self, stamp: Stamp, tiles: Arc<Vec<TileCells>>) -> Snapshot {
        let colliders = self.colliders.iter().map(|(id, collider)| SavedCollider {
            id: id.to_string(),
            mass: collider.mass,
            shape: collider.shape,
            position: collider.position,
            contact: collider.contact,
        });
        let description = Description {
            spec: SessionSpec { id: None, ..self.session.spec.clone() },
            settings: self.settings,
            material: self.material,
            clock: self.clock,
            falling: self.falling,
            ledger: self.ledger,
            settled: self.settled,
            last_cycle: self.last_dt,
            colliders: colliders.collect(),
        };
        Snapshot { stamp, description, tiles }
    }

    /// Makes the session what was saved, in the next frame.
    pub(super) fn restore(&mut self, snapshot: &Snapshot) {
        let saved = &snapshot.description;
        self.settings = saved.settings;
        self.material = saved.material;
        self.clock = saved.clock;
        self.falling = saved.falling;
        self.ledger = saved.ledger;
        self.settled = saved.settled;
        self.last_dt = saved.last_cycle;
        self.colliders = saved
            .colliders
            .iter()
            .map(|saved| {
                let SavedCollider { mass, shape, position, contact, .. } = *saved;
                (Arc::from(saved.id.as_str()), Collider { mass, shape, position, contact })
            })
            .collect();
        self.next.edits.push(Edit::SetMaterial(saved.material));
        self.next.edits.push(Edit::Restore(Arc::new(snapshot.contents())));
        self.next.changed = true;
    }
}

impl Description {
    fn check(&self, limits: &Limits) -> Result<(), SessionError> {
        self.spec.check(limits)?;
        let mut check = Check::default();
        check.settings(&self.settings);
        check.range("/material/stiffness_exponent", self.material.stiffness_exponent, 3.0, 6.0, "");
        let fixed =
            Material { stiffness_exponent: self.spec.material.stiffness_exponent, ..self.material };
        let clock_fits = self.clock.is_sound(self.settings.tick_rate, self.settings.time_scale);
        let ledger = &self.ledger;
        let out = ledger.refused.checked_add(ledger.cleared);
        for (pointer, sound) in [
            ("/spec/id", self.spec.id.is_none()),
            ("/material", fixed == self.spec.material),
            ("/clock", clock_fits),
            ("/falling", self.falling.is_sound(self.clock.tick(), &self.spec)),
            // Not more than falls in a million years of the heaviest snowfalls.
            ("/ledger", out.is_some_and(|out| out <= ledger.fallen) && ledger.fallen < 1 << 120),
            ("/last_cycle", self.last_cycle.is_none_or(|dt| (0.0..=1.0).contains(&dt))),
            ("/colliders", self.colliders.len() <= limits.colliders_per_session),
        ] {
            if !sound {
                check.reject(pointer, "is not what a server would have saved");
            }
        }
        for (i, saved) in self.colliders.iter().enumerate() {
            let at = format!("/colliders/{i}");
            let SavedCollider { mass, shape, position, contact, .. } = *saved;
            let object = Collider { mass, shape, position, contact };
            object.check(&mut check, &at, &saved.id, &self.spec.grid);
            let ordered = i == 0 || self.colliders[i - 1].id < saved.id;
            let positive = |number: f32| number > 0.0 && number.is_finite();
            if !(ordered && positive(contact.area) && positive(contact.pressure)) {
                check.reject(at, "is not what a server would have saved");
            }
        }
        check.finish()
    }

    fn check_mass(&self, tiles: &[TileCells]) -> Result<(), SessionError> {
        let mass: u64 = tiles.iter().flat_map(|tile| &tile.mass).map(|&mass| u64::from(mass)).sum();
        if u128::from(mass) == self.ledger.present() {
            return Ok(());
        }
        Err(refused("the mass of its cells is not that of its ledger"))
    }
}

/// Reads the body of a snapshot, hashing it on the way.
struct Body<'a> {
    reader: zstd::Decoder<'static, std::io::BufReader<&'a [u8]>>,
    hasher: blake3::Hasher,
}

impl<'a> Body<'a> {
    fn open(compressed: &'a [u8]) -> Result<Body<'a>, SessionError> {
        let reader = zstd::Decoder::new(compressed).map_err(unreadable)?;
        Ok(Body { reader, hasher: blake3::Hasher::new() })
    }

    /// The next bytes. Memory grows with what is really there, not with what is announced.
    fn bytes(&mut self, length: u64) -> Result<Vec<u8>, SessionError> {
        let mut bytes = Vec::new();
        self.reader.by_ref().take(length).read_to_end(&mut bytes).map_err(unreadable)?;
        if (bytes.len() as u64) < length {
            return Err(refused("it is cut short"));
        }
        self.hasher.update(&bytes);
        Ok(bytes)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], SessionError> {
        let bytes = self.bytes(N as u64)?;
        bytes.try_into().map_err(|_| refused("it is cut short"))
    }

    fn words(&mut self, count: u64) -> Result<Vec<u32>, SessionError> {
        let bytes = self.bytes(count * 4)?;
        let word = |b: &[u8]| u32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        Ok(bytes.chunks_exact(4).map(word).collect())
    }

    /// The cells of all tiles.
    fn tiles(&mut self, spec: &SessionSpec) -> Result<Vec<TileCells>, SessionError> {
        let grid = &spec.grid;
        let counts = self.bytes(grid.columns())?;
        if counts.iter().any(|&count| u32::from(count) > grid.height) {
            return Err(refused("a column has more cells than slots"));
        }
        let total = counts.iter().map(|&count| u64::from(count)).sum();
        let (mass, thickness) = (self.words(total)?, self.words(total)?);
        let (temperature, stress) = (self.words(total)?, self.words(total)?);
        let celsius = -40.0..=0.0;
        // A thousandth, and two quanta, for what is rounded.
        let densest = grid.cell_size * spec.material.max_density / 64.0 * 1.001;
        let light = |(&mass, &d): (&u32, &u32)| f64::from(mass) <= f64::from(d) * densest + 2.0;
        let sound = mass.iter().all(|&mass| mass > 0)
            && mass.iter().zip(&thickness).all(light)
            && thickness.iter().all(|&d| (1..=CELL).contains(&d))
            && temperature.iter().all(|&t| celsius.contains(&f32::from_bits(t)))
            && stress.iter().all(|&s| f32::from_bits(s).is_finite());
        if !sound {
            return Err(refused("a cell is not what a server would have saved"));
        }
        // No more slots than are filled: a small file makes no large memory.
        let mut tops = vec![0; grid.tiles() as usize];
        for ((tile, _), &count) in columns(spec).zip(&counts) {
            tops[tile] = count.max(tops[tile]);
        }
        let mut tiles: Vec<TileCells> =
            tops.into_iter().map(|top| TileCells::empty(top.into())).collect();
        let mut next = 0;
        for ((tile, column), count) in columns(spec).zip(counts) {
            let tile = &mut tiles[tile];
            for slot in 0..usize::from(count) {
                let to = slot * TILE_COLUMNS as usize + column as usize;
                tile.mass[to] = mass[next];
                tile.thickness[to] = thickness[next];
                tile.temperature[to] = f32::from_bits(temperature[next]);
                tile.stress[to] = f32::from_bits(stress[next]);
                next += 1;
            }
        }
        Ok(tiles)
    }

    /// Makes sure that nothing is left over, and that everything is as it was saved.
    fn finish(mut self, digest: &[u8]) -> Result<(), SessionError> {
        let mut rest = [0];
        if self.reader.read(&mut rest).map_err(unreadable)? > 0 {
            return Err(refused("something follows its end"));
        }
        if self.hasher.finalize().as_bytes() != digest {
            return Err(refused("it is damaged: its digest is another"));
        }
        Ok(())
    }
}

/// Tile and column of each column of a grid, row by row.
fn columns(spec: &SessionSpec) -> impl Iterator<Item = (usize, u32)> + '_ {
    let grid = &spec.grid;
    (0..grid.depth).flat_map(move |z| {
        (0..grid.width).map(move |x| {
            let (tile, column) = grid.locate(x, z);
            (tile as usize, column)
        })
    })
}

fn refused(why: &str) -> SessionError {
    let detail = format!("the snapshot can't be restored: {why}");
    SessionError::Invalid(vec![Invalid { pointer: String::new(), detail }])
}

fn unreadable(error: std::io::Error) -> SessionError {
    refused(&format!("it is damaged: {error}"))
}

fn internal(error: impl std::fmt::Display) -> SessionError {
    SessionError::Internal(format!("the snapshot could not be made: {error}"))
}
