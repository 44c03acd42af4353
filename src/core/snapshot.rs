//! A whole snowpack in one piece: saved, checked and restored bit for bit. `api/snapshot.md`
//! describes the bytes.

mod body;
mod description;

use std::io::{BufWriter, Write};
use std::sync::Arc;

use firn_engine::frame::{Contents, Edit, TileCells};
use firn_engine::reserve::ask_for;
use firn_protocol::{SessionSpec, Stamp, Terrain};
use firn_snow::alpine::Surface;
use firn_snow::{Cell, Material};

use self::body::Body;
use self::description::{Description, SavedAlpine, SavedCollider};

use crate::core::session::{
    Check, Ground, Invalid, Limits, Reach, SessionError, SessionState, Simulation,
};

/// Media type of a snapshot.
pub const MEDIA_TYPE: &str = "application/vnd.firn.snapshot";

const MAGIC: &[u8; 8] = b"FIRNSNOW";
/// The version that is written; earlier ones are read too.
const VERSION: u32 = 2;
/// Magic, version, four bytes that are 0, and the digest.
const HEAD: usize = 48;
/// Most bytes of the description, which is JSON.
const LONGEST_DESCRIPTION: u64 = 256 << 20;
/// Most numbers in it beside the elevations of the ground: those of objects, layers and settings.
const MOST_OTHERS: u64 = 1 << 20;
/// What a number takes while it is read: lists double as they grow.
const BYTES_PER_NUMBER: u64 = 3 * size_of::<f64>() as u64;
const COMPRESSION_LEVEL: i32 = 3;
/// Bytes of the body that are hashed or compressed at a time.
const WRITTEN_AT_ONCE: usize = 64 * 1024;

/// A snowpack as it was after some tick, with its configuration and its objects.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// When it was taken.
    pub stamp: Stamp,
    pub(crate) description: Description,
    /// The ground, where it is no longer that of the description.
    pub(crate) ground: Option<Ground>,
    pub(crate) tiles: Arc<Vec<TileCells>>,
}

impl Snapshot {
    /// Hash of everything in it: equal digests, equal snowpacks.
    ///
    /// # Errors
    /// [`SessionError::Internal`].
    pub fn digest(&self) -> Result<String, SessionError> {
        Ok(self.hash()?.to_hex().to_string())
    }

    fn hash(&self) -> Result<blake3::Hash, SessionError> {
        let mut hasher = blake3::Hasher::new();
        self.write_body(BufWriter::with_capacity(WRITTEN_AT_ONCE, &mut hasher))?;
        Ok(hasher.finalize())
    }

    /// Checks that its mass is that of its ledger. Every reader checks that too.
    ///
    /// # Errors
    /// [`SessionError::Invalid`].
    pub(crate) fn check_mass(&self) -> Result<(), SessionError> {
        self.description.check_mass(&self.tiles)
    }

    /// The snapshot as bytes.
    ///
    /// # Errors
    /// [`SessionError::Internal`].
    pub fn encode(&self) -> Result<Vec<u8>, SessionError> {
        let mut bytes = Vec::with_capacity(HEAD);
        bytes.extend(MAGIC);
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend([0; 4]);
        // The digest stands in front, so the body is gone through twice: that takes no memory.
        bytes.extend(self.hash()?.as_bytes());
        let mut encoder = zstd::Encoder::new(bytes, COMPRESSION_LEVEL).map_err(internal)?;
        self.write_body(BufWriter::with_capacity(WRITTEN_AT_ONCE, &mut encoder))?;
        encoder.finish().map_err(internal)
    }

    /// Writes description and cells, not compressed.
    fn write_body(&self, mut body: impl Write) -> Result<(), SessionError> {
        let terrain = self.spec().terrain.as_ref().map(|terrain| &terrain.heights);
        let ground = self.ground.as_ref().map(Ground::heights);
        let described = Description {
            spec: SessionSpec { terrain: None, ..self.spec().clone() },
            terrain: terrain.is_some(),
            ground: ground.is_some(),
            ..self.description.clone()
        };
        let description = serde_json::to_vec(&described).map_err(internal)?;
        body.write_all(&(description.len() as u64).to_le_bytes()).map_err(internal)?;
        body.write_all(&description).map_err(internal)?;
        for height in terrain.into_iter().chain(ground).flat_map(|heights| heights.iter()) {
            body.write_all(&height.to_le_bytes()).map_err(internal)?;
        }
        let columns = || {
            let columns = columns(&self.description.spec);
            columns.map(|(tile, column)| self.tiles[tile].column(column))
        };
        for column in columns() {
            body.write_all(&[column.count() as u8]).map_err(internal)?;
        }
        // Plane by plane, column by column: what is alike lies together.
        let planes: [fn(&Cell) -> [u8; 4]; 4] = [
            |cell| cell.mass.to_le_bytes(),
            |cell| cell.thickness.to_le_bytes(),
            |cell| cell.temperature.to_le_bytes(),
            |cell| cell.stress.to_le_bytes(),
        ];
        for plane in planes {
            for cell in columns().flatten() {
                body.write_all(&plane(&cell)).map_err(internal)?;
            }
        }
        // Nothing where the snow has no surfaces.
        for (tile, column) in self::columns(&self.description.spec) {
            if let Some(surface) = self.tiles[tile].surfaces.get(column as usize) {
                body.write_all(&surface_bytes(surface)).map_err(internal)?;
            }
        }
        body.flush().map_err(internal)
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
    pub(crate) fn decode_admitted<T>(
        bytes: &[u8],
        limits: &Limits,
        admit: impl FnOnce(&SessionSpec) -> Result<T, SessionError>,
    ) -> Result<(Snapshot, T), SessionError> {
        let (head, mut reader, mut description) = describe(bytes, limits)?;
        description.check(limits)?;
        let admitted = admit(&description.spec)?;
        let ground = read_ground(&mut reader, &mut description)?;
        let tiles = reader.tiles(&description.spec)?;
        reader.finish(&head[16..])?;
        description.check_mass(&tiles)?;
        let stamp = Stamp { tick: description.clock.tick(), seq: 0 };
        Ok((Snapshot { stamp, description, ground, tiles: Arc::new(tiles) }, admitted))
    }

    /// The host's half of what some bytes hold; its cells are not read.
    ///
    /// # Errors
    /// As [`Snapshot::decode`].
    pub(crate) fn state(bytes: &[u8]) -> Result<SessionState, SessionError> {
        let (_, mut reader, mut description) = describe(bytes, &Limits::NONE)?;
        description.check(&Limits::NONE)?;
        let ground = read_ground(&mut reader, &mut description)?;
        Ok(description.state(ground))
    }

    /// Simulated time at which it was taken \[s\].
    pub(crate) fn sim_time(&self) -> f64 {
        self.description.clock.sim_time()
    }

    /// What it was created with.
    pub fn spec(&self) -> &SessionSpec {
        &self.description.spec
    }

    /// The ground that it lies on, where that is another than the one a session was `created` with.
    pub(crate) fn ground_beside(&self, created: &Ground) -> Option<Ground> {
        if self.ground.is_some() {
            return self.ground.clone();
        }
        let SessionSpec { grid, terrain, .. } = self.spec();
        let own = Ground::of(terrain.as_ref());
        let level = || Ground::new(vec![0.0; grid.columns() as usize].into());
        (own != *created).then(|| if own.is_level() { level() } else { own })
    }

    /// What its objects take in the device's tables.
    pub(crate) fn object_rows(&self) -> u64 {
        let grid = &self.description.spec.grid;
        let reach = |saved: &SavedCollider| Reach::new(&saved.body, grid);
        self.description.colliders.iter().map(|saved| reach(saved).words()).sum()
    }

    /// What a backend restores.
    pub(crate) fn contents(&self) -> Contents {
        let grid = &self.description.spec.grid;
        let colliders = self.description.colliders.iter().filter_map(|saved| {
            let placement = saved.collider(grid)?.placement;
            Some((Arc::from(saved.id.as_str()), placement, saved.contact))
        });
        Contents { tiles: self.tiles.clone(), colliders: colliders.collect() }
    }
}

/// Reads what stands before the cells: the head, and the description.
fn describe<'b>(
    bytes: &'b [u8],
    limits: &Limits,
) -> Result<(&'b [u8], Body<'b>, Description), SessionError> {
    let (head, compressed) =
        bytes.split_at_checked(HEAD).ok_or_else(|| refused("it is cut short"))?;
    if head[..8] != *MAGIC {
        return Err(refused("it does not begin as a snapshot does"));
    }
    let version = u32::from_le_bytes([head[8], head[9], head[10], head[11]]);
    if !(1..=VERSION).contains(&version) || head[12..16] != [0; 4] {
        return Err(refused(&format!(
            "it has version {version} of the format; this server reads versions up to {VERSION}"
        )));
    }
    let mut reader = Body::open(compressed)?;
    let length = u64::from_le_bytes(reader.array()?);
    if length > LONGEST_DESCRIPTION {
        return Err(refused("its description is too long"));
    }
    let description = reader.bytes(length)?;
    // Each number of a list has a comma: none of them is made that no limit allows.
    let numbers = description.iter().filter(|&&byte| byte == b',').count() as u64;
    if numbers > limits.columns_per_session.saturating_add(MOST_OTHERS) {
        return Err(refused("its description has more numbers than a session may have columns"));
    }
    ask_for(numbers * BYTES_PER_NUMBER).map_err(|error| {
        SessionError::NoMemory(format!("there is no memory for the description: {error}"))
    })?;
    let mut description: Description = serde_json::from_slice(&description)
        .map_err(|error| refused(&format!("its description can't be read: {error}")))?;
    if version == 1 {
        description.bring_up_to_date();
    }
    Ok((head, reader, description))
}

/// Reads the terrain of a description, and the ground as it is now where that is another.
fn read_ground(
    reader: &mut Body<'_>,
    description: &mut Description,
) -> Result<Option<Ground>, SessionError> {
    let grid = description.spec.grid;
    let mut read = || {
        let bytes = reader.bytes(8 * grid.columns())?;
        let heights = bytes.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes));
        let heights: Arc<[f64]> = heights.collect();
        let mut check = Check::default();
        Ground::check(&mut check, "", &heights, &grid);
        check.finish().map(|()| heights)
    };
    if description.terrain {
        description.spec.terrain = Some(Terrain { heights: read()? });
    }
    description.ground.then(|| read().map(Ground::new)).transpose()
}

impl Simulation {
    /// The session as it is now.
    pub(crate) fn snapshot(&self, stamp: Stamp, tiles: Arc<Vec<TileCells>>) -> Snapshot {
        let colliders = self.state.colliders.iter().map(|(id, collider)| SavedCollider {
            id: id.to_string(),
            body: collider.body.clone(),
            contact: collider.contact,
            carried: collider.carried.clone(),
        });
        // A reset may have brought another material along.
        let stiffness_exponent = self.session.spec.material.stiffness_exponent;
        let material = Material { stiffness_exponent, ..self.state.material };
        let description = Description {
            spec: SessionSpec { id: None, material, ..self.session.spec.clone() },
            terrain: self.session.spec.terrain.is_some(),
            ground: self.state.ground.is_some(),
            settings: self.state.settings,
            material: self.state.material,
            clock: self.state.clock,
            falling: self.state.falling,
            ledger: self.state.ledger,
            settled: self.settled,
            last_cycle: self.last_dt,
            alpine: self.state.alpine.as_ref().map(|it| SavedAlpine::new(it, &self.session.spec)),
            colliders: colliders.collect(),
        };
        Snapshot { stamp, description, ground: self.state.ground.clone(), tiles }
    }

    /// Makes the session what was saved, in the next frame.
    pub(crate) fn restore(&mut self, snapshot: &Snapshot) {
        let saved = &snapshot.description;
        let ground = snapshot.ground_beside(&self.session.ground);
        let lay_elsewhere = self.state.ground.is_some() || ground.is_some();
        self.state = saved.state(ground);
        if lay_elsewhere {
            let ground = self.ground().heights().clone();
            self.next.edits.push(Edit::SetGround(ground));
        }
        self.settled = saved.settled;
        self.last_dt = saved.last_cycle;
        let words = self.state.colliders.values().map(|collider| collider.reach.words());
        self.object_rows.take(words.sum());
        self.next.edits.push(Edit::SetMaterial(saved.material));
        self.next.edits.push(Edit::Restore(Arc::new(snapshot.contents())));
        self.next.changed = true;
        self.portions.disturb(self.state.grid.tiles().into());
    }
}

/// What a column of alpine snow has beside its cells, as it is written: albedo, skin, four layers of soil, and the
/// runoff in two words.
fn surface_bytes(surface: &Surface) -> [u8; 32] {
    let Surface { albedo, skin, soil, runoff } = *surface;
    let mut bytes = [0; 32];
    let numbers = [albedo, skin].into_iter().chain(soil);
    for (word, number) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(numbers) {
        *word = number.to_le_bytes();
    }
    bytes[24..].copy_from_slice(&runoff.to_le_bytes());
    bytes
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

fn internal(error: impl std::fmt::Display) -> SessionError {
    SessionError::Internal(format!("the snapshot could not be made: {error}"))
}
