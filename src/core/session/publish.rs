//! What came of a frame: the mirror brought up to date, requests answered, streams told.

use std::sync::{Arc, PoisonError};
use std::time::Duration;

use firn_engine::frame::{Stamp as Print, WorkOutcome};
use firn_engine::parallel;
use firn_engine::published::TileColumns;
use firn_protocol::{
    AirTemperatureReply, BatchReply, ClearingReply, ColliderReply, ColliderView, Event, PrintView,
    SnowfallReply, Stamp, StampReply, WeatherNow,
};
use firn_snow::{Contact, Elevation, Grid, TILE_COLUMNS};

use crate::core::record::{Done, Taken};
use crate::core::session::{
    Applied, Collider, Counted, Gather, Gathered, Happening, Mirror, Orders, Outlet, Receipted,
    Reply, Sampled, SessionState, Simulation, StepJob, Surface, Told,
};
use crate::core::snapshot::Snapshot;

/// Says that a session has published a state.
#[derive(Clone, Copy, Debug)]
pub struct Publication {
    /// How many the server had published of this session, with this one. Seq does not tell: it may
    /// pass over numbers.
    pub number: u64,
    /// Time of the state.
    pub tick: u64,
}

impl Simulation {
    /// Takes in the outcome of the frame in flight; `tiles` are those of it that changed. `stored` is the time by
    /// the store's clock.
    pub(crate) fn conclude<'a>(
        &mut self,
        outcome: WorkOutcome,
        tiles: impl Iterator<Item = (u32, &'a TileColumns)>,
        stored: Duration,
    ) {
        let Some(outcome) = self.portions.take_in(outcome) else { return };
        if self.flight.publish {
            self.portions.awake(outcome.active_tiles);
        }
        self.enter_ledger(&outcome.edits);
        self.state.ledger.exchange(&outcome.exchanged);
        let was_settled = self.is_settled();
        self.conclude_run(outcome.last_change);
        if self.replay.is_some() {
            if self.flight.publish {
                self.recall(&outcome, tiles);
            }
            self.deposit_falling();
            return;
        }
        let settles = self.is_settled() && !was_settled;
        if self.flight.publish {
            let orders = std::mem::take(&mut self.flight.orders);
            let weather = self.new_weather();
            let (stamp, changed) = self.publish(&orders, &outcome, tiles);
            let settled = settles.then_some(Event::Settled { stamp });
            let reset = orders.reset.then_some(Event::Reset { stamp });
            let step_ended = orders.step_told;
            let mut told = self.answer(orders, outcome, stamp, stored);
            let weather = weather.map(|now| Event::Weather { stamp, now });
            told.extend(reset.into_iter().chain(weather).chain(settled).map(Happening::from));
            self.tell(told);
            // Streams hear of events before heights, so that they tell both in one turn.
            if changed {
                self.announce(stamp);
            }
            self.tell_progress(step_ended, stamp, stored);
        } else {
            let stamp = Stamp { tick: self.state.clock.tick(), seq: self.session.mirror().seq };
            if settles {
                self.tell(vec![Event::Settled { stamp }.into()]);
            }
            self.tell_progress(false, stamp, stored);
        }
        self.deposit_falling();
    }

    /// Enters what the frame's edits refused and cleared.
    fn enter_ledger(&mut self, edits: &[u64]) {
        let state = &mut self.state;
        let tick = self.flight.clock_before.map_or(state.clock.tick(), |clock| clock.tick());
        for counted in &self.flight.orders.counted {
            match counted {
                Counted::Refused(edit) => state.ledger.refused += u128::from(edits[*edit]),
                Counted::Cleared(edit) => state.ledger.cleared += u128::from(edits[*edit]),
                Counted::Returned { edit, id, snow } => {
                    state.give_back(id, snow, edits[*edit].into(), tick);
                }
            }
        }
    }

    /// What holds of weather that was told since the last publication.
    fn new_weather(&self) -> Option<WeatherNow> {
        let alpine = self.state.alpine.as_ref()?;
        let mirror = self.session.mirror();
        let known = mirror.alpine.as_ref().map(|known| &known.weather);
        let is_known = known
            .is_some_and(|known| Arc::ptr_eq(known, &alpine.weather) || *known == alpine.weather);
        (!is_known).then(|| alpine.now(self.state.clock.sim_time()))
    }

    /// Brings the mirror up to date. Returns when, and whether anything has changed.
    fn publish<'a>(
        &mut self,
        orders: &Orders,
        outcome: &WorkOutcome,
        tiles: impl Iterator<Item = (u32, &'a TileColumns)>,
    ) -> (Stamp, bool) {
        let mut tiles = tiles.peekable();
        let session = self.session.clone();
        self.take_contacts(&outcome.contacts);
        let colliders = collider_views(&self.state);
        let mut mirror = session.mirror.write().unwrap_or_else(PoisonError::into_inner);
        let colliders_changed = *mirror.colliders != *colliders;
        let asked = orders.replies.iter().any(|reply| matches!(reply, Reply::Change { .. }));
        let changed = tiles.peek().is_some() || colliders_changed || orders.changed || asked;
        let seq = if changed { self.log.seq_in(self.flight.round) } else { mirror.seq };
        let brought_back = std::mem::take(&mut self.brought_back);
        for (tile, heights) in tiles {
            // All tiles of a session that was brought back are told: most are as they were.
            if !(brought_back && mirror.shows(tile, heights)) {
                mirror.update(tile, heights, seq);
            }
        }
        if colliders_changed {
            mirror.colliders = colliders;
            mirror.colliders_version = seq;
        }
        mirror.lie_on(self.ground(), seq);
        self.write_clock(&mut mirror);
        mirror.active_tiles = self.active_tiles(outcome);
        mirror.seq = seq;
        drop(mirror);
        self.unpublished = false;
        (Stamp { tick: self.state.clock.tick(), seq }, changed)
    }

    /// Wakes who waits for a publication.
    fn announce(&self, stamp: Stamp) {
        self.session.published.send_modify(|publication| {
            *publication = Publication { number: publication.number + 1, tick: stamp.tick };
        });
    }

    /// Makes the mirror what it was when what is restored was saved.
    fn recall<'a>(
        &mut self,
        outcome: &WorkOutcome,
        tiles: impl Iterator<Item = (u32, &'a TileColumns)>,
    ) {
        self.take_contacts(&outcome.contacts);
        let session = self.session.clone();
        let mut mirror = session.mirror.write().unwrap_or_else(PoisonError::into_inner);
        tiles.for_each(|(tile, heights)| mirror.recall(tile, heights));
        mirror.colliders = collider_views(&self.state);
        mirror.colliders_version = mirror.seq;
        let seq = mirror.seq;
        mirror.lie_on(self.ground(), seq);
        mirror.active_tiles = self.active_tiles(outcome);
        self.write_clock(&mut mirror);
    }

    /// Tiles in which something may move.
    fn active_tiles(&self, outcome: &WorkOutcome) -> u32 {
        if self.state.lies_alone() { 0 } else { outcome.active_tiles }
    }

    /// Everything of the mirror that costs nothing to copy.
    fn write_clock(&self, mirror: &mut Mirror) {
        mirror.clock = self.state.clock;
        mirror.resting_since = self.passes().then_some(self.frame);
        mirror.resting_ticks = self.state.ticks_without_weather();
        mirror.settled = self.is_settled();
        mirror.mass_quanta = self.state.ledger.present();
        mirror.settings = self.state.settings_now();
        mirror.alpine = self.state.alpine.clone();
        mirror.material = self.state.material;
        mirror.progress = self.step.as_ref().map(StepJob::progress);
    }

    /// Takes in how objects touch the snow. On snow that has settled all of them rest: cycles that
    /// would find that are not carried out any more.
    fn take_contacts(&mut self, contacts: &[(Arc<str>, Contact)]) {
        for (id, contact) in contacts {
            if let Some(collider) = self.state.colliders.get_mut(id) {
                let resting = contact.resting || self.settled;
                collider.contact = Contact { resting, ..*contact };
            }
        }
    }

    /// Answers everybody who waited for this frame. Returns what streams are told of it.
    fn answer(
        &mut self,
        orders: Orders,
        outcome: WorkOutcome,
        stamp: Stamp,
        stored: Duration,
    ) -> Vec<Happening> {
        let mut happened = Vec::new();
        for reply in orders.replies {
            // A failed send means that nobody waits any more, which is theirs to decide.
            match reply {
                Reply::Created(answer) | Reply::Done(answer) => {
                    let position = self.log.receipt();
                    answer.give(Ok(Receipted { answer: (), position }));
                }
                Reply::Change { told, edit, once, answer } => {
                    let found = outcome.edits.get(..=edit).unwrap_or_default();
                    let applied = self.applied(&told, found, stamp);
                    happened.extend(self.happening(&told, &applied, stamp));
                    if let Some(once) = once {
                        self.log.answered(Done::applied(&once, &applied, stored));
                    }
                    let position = self.log.receipt();
                    answer.give(Ok(Receipted { answer: applied, position }));
                }
            }
        }
        for answer in orders.tallies {
            let grid = &self.session.spec.grid;
            let present = u128::from(outcome.mass) + self.state.gathered();
            answer.give(Ok(self.state.ledger.view(stamp, present, grid, self.state.physics())));
        }
        for ((_, answer), cells) in orders.samples.into_iter().zip(outcome.samples) {
            answer.give(Ok(Sampled { stamp, cells }));
        }
        let mut columns = outcome.columns.into_iter();
        let mut totals = outcome.totals.into_iter();
        for Gather { columns: wanted, totals: summed, surface, reply } in orders.gathers {
            let read = columns.by_ref().take(wanted.len()).flatten().collect();
            let gathered = self.session.gathered(Some(stamp), read, surface.as_deref());
            let totals = summed.and_then(|_| totals.next()).unwrap_or_default();
            reply.give(Ok(Gathered { totals, ..gathered }));
        }
        let all = Arc::new(outcome.gathered);
        if orders.checkpoint {
            let snapshot = self.snapshot(stamp, all.clone());
            let versions = self.session.mirror().versions().to_vec();
            self.log.taken = Some(Box::new(Taken { snapshot, seq: stamp.seq, versions }));
        }
        for answer in orders.snapshots {
            answer.give(Ok(self.snapshot(stamp, all.clone())));
        }
        happened
    }

    /// What streams are told of a change, where it is one of the weather or of the settings.
    fn happening(&self, told: &Told, applied: &Applied, stamp: Stamp) -> Option<Happening> {
        match (told, applied) {
            (Told::Snowfall { columns, .. }, Applied::Snowfall(reply)) => {
                let SnowfallReply { fallen_mass, refused_mass, .. } = *reply;
                let event = Event::Snowfall { stamp, fallen_mass, refused_mass };
                Some(Happening { event, columns: Some(*columns) })
            }
            (Told::Clearing { columns, .. }, Applied::Clearing(reply)) => {
                let event = Event::Clearing { stamp, cleared_mass: reply.cleared_mass };
                Some(Happening { event, columns: Some(*columns) })
            }
            (Told::AirTemperature | Told::Settings, _) => {
                Some(Event::Settings { stamp, settings: self.state.settings_now() }.into())
            }
            (Told::Ground, _) => {
                let (lowest, highest) = (self.ground().lowest(), self.ground().highest());
                Some(Event::Terrain { stamp, lowest, highest }.into())
            }
            _ => None,
        }
    }

    /// What is answered to a change; the device `found` something of each edit up to its last.
    fn applied(&self, told: &Told, found: &[u64], stamp: Stamp) -> Applied {
        let grid = &self.session.spec.grid;
        let last = found.last().copied().unwrap_or_default();
        match told {
            Told::Snowfall { fallen, refused, .. } => Applied::Snowfall(SnowfallReply {
                stamp,
                fallen_mass: grid.kilograms(*fallen),
                refused_mass: grid.kilograms(refused + u128::from(last)),
            }),
            Told::Clearing { edits, .. } => {
                let cleared = found.iter().rev().take(*edits).map(|mass| u128::from(*mass)).sum();
                Applied::Clearing(ClearingReply { stamp, cleared_mass: grid.kilograms(cleared) })
            }
            Told::AirTemperature => Applied::AirTemperature(AirTemperatureReply {
                stamp,
                celsius: self.state.settings_now().air_temperature,
            }),
            Told::Collider { id, created } => {
                let mirror = self.session.mirror();
                let place = mirror.colliders.binary_search_by(|view| (*view.id).cmp(id));
                match place {
                    Ok(i) => {
                        let collider = mirror.colliders[i].clone();
                        Applied::Collider {
                            reply: ColliderReply { stamp, collider },
                            created: *created,
                        }
                    }
                    // Removed again before the frame: there is nothing left to describe.
                    Err(_) => Applied::Stamp(stamp),
                }
            }
            Told::Stamps(prints) => {
                let mirror = self.session.mirror();
                let surface = Surface::new(&mirror);
                let dents = found.get(found.len().saturating_sub(prints.len())..);
                let prints = prints.iter().zip(dents.unwrap_or_default());
                let view = |(print, dent): (&Arc<Print>, &u64)| PrintView {
                    depth: grid.metres(*dent),
                    bottom: surface.lowest(&print.coverage),
                };
                let stamps = parallel::each(prints.collect(), view);
                Applied::Stamps(StampReply { stamp, stamps })
            }
            Told::Batch(results) => {
                Applied::Batch(BatchReply { stamp, results: results.clone().map(|it| *it) })
            }
            Told::Settings | Told::Weather | Told::Ground | Told::Stamp => Applied::Stamp(stamp),
        }
    }

    /// Tells streams what has happened in the frame.
    pub(super) fn tell(&self, happened: Vec<Happening>) {
        if !happened.is_empty() {
            // Fails where nobody listens.
            let _ = self.session.events.send(happened.into());
        }
    }
}

impl Outlet {
    /// Makes the mirror what it was when something was saved, where no device does that.
    pub(crate) fn show_saved(&self, saved: &Snapshot) {
        let state = saved.description.state(saved.ground_beside(&self.ground));
        let mut mirror = self.mirror.write().unwrap_or_else(PoisonError::into_inner);
        for (tile, cells) in (0..).zip(saved.tiles.iter()) {
            let height = |column| cells.column(column).map(|cell| cell.thickness).sum();
            let columns: Vec<u32> = (0..TILE_COLUMNS).map(height).collect();
            if let Ok(heights) = columns.try_into() {
                mirror.recall(tile, &heights);
            }
        }
        mirror.colliders = collider_views(&state);
        mirror.colliders_version = mirror.seq;
        let seq = mirror.seq;
        mirror.lie_on(state.ground.as_ref().unwrap_or(&self.ground), seq);
        mirror.clock = state.clock;
        mirror.settled = (saved.description.settled || state.lies_alone())
            && state.settings.snowfall_rate == 0.0;
        mirror.mass_quanta = state.ledger.present();
        mirror.settings = state.settings_now();
        mirror.alpine = state.alpine.clone();
        mirror.material = state.material;
    }
}

fn collider_views(state: &SessionState) -> Arc<[ColliderView]> {
    state.colliders.iter().map(|(id, collider)| view(id, collider, &state.grid)).collect()
}

fn view(id: &str, collider: &Collider, grid: &Grid) -> ColliderView {
    let contact = &collider.contact;
    ColliderView {
        id: id.to_owned(),
        body: collider.body.told(),
        bottom: contact.bottom.metres(grid),
        sink_depth: Elevation(contact.reference - contact.bottom).metres(grid),
        contact_area: if collider.body.airborne { 0.0 } else { f64::from(contact.area) },
        pressure: f64::from(contact.pressure),
        burden: grid.kilograms(collider.carried.mass()),
        resting: contact.resting,
    }
}
