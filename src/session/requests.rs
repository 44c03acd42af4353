//! What a session can be asked: each request goes to the world's thread and returns with its answer.

use std::sync::atomic::Ordering;

use firn_protocol::{ColumnView, MassView, Physics, SessionSpec, SessionView, Stamp, StepSpec};
use firn_snow::{Column, ColumnRect, ColumnTotals, TILE_COLUMNS};
use tokio::runtime::Handle;
use tokio::sync::{mpsc, oneshot};

use crate::core::device::stopped;
use crate::core::record::Once;
use crate::core::session::{
    Answer, Applied, Beginning, CellBox, Change, Invalid, Place, Receipted, Request, Sampled,
    SessionError, Simulation, gather,
};
use crate::core::snapshot::Snapshot;
use crate::core::{Control, Input};
use crate::machine;
use crate::session::handle::Session;
use crate::session::token::Tokens;

impl Session {
    /// Applies a change in the next frame, and returns when it is durable and the next read sees it.
    ///
    /// # Errors
    /// Those of the change; it is applied whole or not at all.
    pub async fn change(&self, change: Change) -> Result<Applied, SessionError> {
        self.change_once(change, None).await
    }

    /// As [`Session::change`]; where the request was carried out before, its answer, and nothing
    /// changes.
    ///
    /// # Errors
    /// As [`Session::change`].
    pub async fn change_once(
        &self,
        change: Change,
        once: Option<Once>,
    ) -> Result<Applied, SessionError> {
        let change = named(change);
        let bytes = change.bytes();
        let made = once.as_ref().and_then(|once| self.keyed.find(&once.key)?.answer());
        match made {
            Some(applied) => Ok(applied),
            None => {
                self.check_unlocked()?;
                let change = Box::new(change);
                self.ask_durably(bytes, |reply| Request::Change { change, once, reply }).await
            }
        }
    }

    /// Steps a paused session as fast as the machine can. Dropping the future ends it early, at
    /// the tick it has reached.
    ///
    /// # Errors
    /// [`SessionError::Conflict`] where the session runs or is being stepped already,
    /// [`SessionError::Locked`], and [`SessionError::Invalid`].
    pub async fn step(&self, step: StepSpec) -> Result<SessionView, SessionError> {
        self.check_unlocked()?;
        let number = self.steps.fetch_add(1, Ordering::Relaxed);
        let mut end = EndStep { session: self, number, ended: false };
        let stepped = self.ask_durably(0, |reply| Request::Step { number, step, reply }).await;
        end.ended = true;
        stepped.map(|()| self.view())
    }

    /// Ends the step under way at the tick it has reached, and returns when that is durable and visible to
    /// the next read.
    ///
    /// # Errors
    /// [`SessionError::Conflict`] where no step is under way.
    pub async fn end_step(&self) -> Result<(), SessionError> {
        let ended = self.control(|reply| Control::EndStep(None, reply)).await?;
        self.receipts.wait(ended.position).await
    }

    /// Brings the session back to the state it was created in; seqs go on.
    ///
    /// # Errors
    /// [`SessionError::Conflict`] while it is being stepped.
    pub async fn reset(&self) -> Result<SessionView, SessionError> {
        self.check_unlocked()?;
        let saved = match self.origin.clone() {
            None => None,
            Some(bytes) => {
                let limits = self.limits;
                Some(self.decode(move || Ok((Snapshot::decode(&bytes, &limits)?, ()))).await?.0)
            }
        };
        self.reset_to(Beginning::Origin(saved)).await
    }

    /// Makes the session what a snapshot of the same grid holds; name, tokens and seqs go on.
    ///
    /// # Errors
    /// [`SessionError::Invalid`] where the snapshot is damaged or of another grid, and
    /// [`SessionError::Conflict`] while it is being stepped.
    pub async fn reset_to_snapshot(&self, bytes: Vec<u8>) -> Result<SessionView, SessionError> {
        self.check_unlocked()?;
        let (outlet, limits) = (self.outlet.clone(), self.limits);
        let decode = move || {
            let fits = |spec: &SessionSpec| outlet.check_place(spec);
            let (snapshot, ()) = Snapshot::decode_admitted(&bytes, &limits, fits)?;
            Ok((snapshot, bytes))
        };
        let (snapshot, bytes) = self.decode(decode).await?;
        self.reset_to(Beginning::Snapshot(snapshot, bytes)).await
    }

    async fn reset_to(&self, to: Beginning) -> Result<SessionView, SessionError> {
        self.ask_durably(0, |reply| Request::Reset { to, reply }).await?;
        Ok(self.view())
    }

    /// Decodes a snapshot, as soon as there is memory for that.
    async fn decode<T: Send + 'static>(
        &self,
        decode: impl FnOnce() -> Result<(Snapshot, T), SessionError> + Send + 'static,
    ) -> Result<(Box<Snapshot>, T), SessionError> {
        let permit = self.decoding.clone().acquire_owned().await;
        let decoded = blocking(move || {
            let _permit = permit;
            decode()
        });
        let (snapshot, beside) = decoded.await?;
        Ok((Box::new(snapshot), beside))
    }

    /// The material cells of a column.
    ///
    /// # Errors
    /// [`SessionError::NotFound`] where the column is not in the grid.
    pub async fn column(&self, x: u32, z: u32) -> Result<ColumnView, SessionError> {
        let grid = self.spec.grid;
        if x >= grid.width || z >= grid.depth {
            return Err(SessionError::NotFound { kind: "column", id: format!("{x}/{z}") });
        }
        let (tile, column) = grid.locate(x, z);
        let columns = gather::reads(&[tile * TILE_COLUMNS + column], grid.height);
        let alpine = self.spec.physics == Physics::Alpine;
        let totals = alpine.then_some(ColumnRect { x0: x, z0: z, x1: x + 1, z1: z + 1 });
        let request = |reply| Request::Gather { columns, totals, surface: None, reply };
        Ok(gather::column_view(&self.ask(request).await?, &grid))
    }

    /// Columns of a rectangle in the grid, summed up, and when they were so.
    ///
    /// # Errors
    /// [`SessionError::Conflict`] where the snow is not alpine.
    pub async fn column_totals(
        &self,
        columns: ColumnRect,
    ) -> Result<(Stamp, Vec<ColumnTotals>), SessionError> {
        if self.spec.physics != Physics::Alpine {
            return Err(SessionError::feels_no_weather());
        }
        let totals = Some(columns);
        let request = |reply| Request::Gather { columns: Vec::new(), totals, surface: None, reply };
        let gathered = self.ask(request).await?;
        Ok((gathered.stamp, gathered.totals))
    }

    /// The mass ledger, with the mass present summed over all cells.
    ///
    /// # Errors
    /// [`SessionError::Unavailable`].
    pub async fn mass(&self) -> Result<MassView, SessionError> {
        self.ask(|reply| Request::Mass { reply }).await
    }

    /// All columns, tile by tile, of one tick.
    ///
    /// # Errors
    /// [`SessionError::Unavailable`].
    pub async fn columns(&self) -> Result<Vec<Column>, SessionError> {
        let all: Vec<u32> = (0..self.spec.grid.tiles() * TILE_COLUMNS).collect();
        Ok(self.gather(&all).await?.columns)
    }

    /// Cells of the fixed grid.
    ///
    /// # Errors
    /// [`SessionError::Invalid`] where they are more than [`gather::MOST_SAMPLES`].
    pub async fn sample_grid(&self, wanted: CellBox) -> Result<Sampled, SessionError> {
        let cells = wanted.cells();
        if cells > gather::MOST_SAMPLES {
            let detail = format!("{cells} cells; at most {} at a time", gather::MOST_SAMPLES);
            return Err(SessionError::Invalid(vec![Invalid { pointer: String::new(), detail }]));
        }
        self.ask(|reply| Request::Sample { wanted, reply }).await
    }

    /// Gives it other tokens. When this returns that is durable, the old ones have stopped working,
    /// and streams that were opened with them end.
    ///
    /// # Errors
    /// [`SessionError::StorageFailed`], and [`SessionError::Internal`] where there are no random
    /// numbers; the old ones go on working then.
    pub async fn reissue_tokens(&self) -> Result<Tokens, SessionError> {
        self.check_unlocked()?;
        let tokens = Tokens::generate()
            .map_err(|e| SessionError::Internal(format!("no random numbers for tokens: {e}")))?;
        let hashes = tokens.hashes();
        self.control(|reply| Control::Tokens(hashes, reply)).await?;
        Ok(tokens)
    }

    /// The whole session, of one tick.
    ///
    /// # Errors
    /// [`SessionError::Unavailable`].
    pub async fn snapshot(&self) -> Result<Snapshot, SessionError> {
        self.ask(|reply| Request::Snapshot { reply }).await
    }

    /// Runs a closure on the world's thread with the session's simulation, for diagnosis.
    ///
    /// # Errors
    /// [`SessionError::Internal`] where the closure panics; the session goes back to what is durable
    /// of it then.
    pub async fn inspect<T: Send + 'static>(
        &self,
        look: impl FnOnce(&Simulation) -> T + Send + 'static,
    ) -> Result<T, SessionError> {
        let (send, receive) = oneshot::channel();
        let look = Box::new(move |simulation: &Simulation| {
            let _ = send.send(look(simulation));
        });
        self.ask(|reply| Request::Inspect { look, reply }).await?;
        receive.await.map_err(|_| stopped())
    }

    /// All cells of some columns, each as tile · 64 + column.
    async fn gather(&self, columns: &[u32]) -> Result<gather::Gathered, SessionError> {
        let bytes = std::mem::size_of_val(columns);
        let columns = gather::reads(columns, self.spec.grid.height);
        self.ask_with(bytes, |reply| Request::Gather {
            columns,
            totals: None,
            surface: None,
            reply,
        })
        .await
    }

    async fn ask<T>(&self, request: impl FnOnce(Answer<T>) -> Request) -> Result<T, SessionError> {
        self.ask_with(0, request).await
    }

    /// Asks with something that takes so many bytes while it waits.
    async fn ask_with<T>(
        &self,
        bytes: usize,
        request: impl FnOnce(Answer<T>) -> Request,
    ) -> Result<T, SessionError> {
        let place = self.waiting.enter(bytes)?;
        self.ask_in(place, request).await
    }

    /// Asks for what counts when it is durable, with something that takes so many bytes until then.
    async fn ask_durably<T>(
        &self,
        bytes: usize,
        request: impl FnOnce(Answer<Receipted<T>>) -> Request,
    ) -> Result<T, SessionError> {
        let place = self.waiting.enter(bytes)?;
        let Receipted { answer, position } = self.ask_in(place.clone(), request).await?;
        let durable = self.receipts.wait(position).await;
        drop(place);
        durable.map(|()| answer)
    }

    pub(super) async fn ask_in<T>(
        &self,
        place: Place,
        request: impl FnOnce(Answer<T>) -> Request,
    ) -> Result<T, SessionError> {
        let input = |reply| Input::Request { key: self.key, request: request(reply) };
        ask(&self.world, Some(place), input).await
    }

    /// Has something done that does not wait for what is asked of the session.
    pub(crate) async fn control<T>(
        &self,
        control: impl FnOnce(Answer<T>) -> Control,
    ) -> Result<T, SessionError> {
        let input = |reply| Input::Control { key: self.key, control: control(reply) };
        ask(&self.world, None, input).await
    }
}

/// Ends a step where its client goes before it has ended.
struct EndStep<'s> {
    session: &'s Session,
    number: u64,
    ended: bool,
}

impl Drop for EndStep<'_> {
    fn drop(&mut self) {
        if !self.ended {
            let (nobody, _) = Answer::new(None);
            let (key, control) = (self.session.key, Control::EndStep(Some(self.number), nobody));
            let sent = self.session.world.try_send(Input::Control { key, control });
            // Where the queue is full it is told as soon as there is room.
            if let Err(mpsc::error::TrySendError::Full(input)) = sent
                && let Ok(runtime) = Handle::try_current()
            {
                let world = self.session.world.clone();
                runtime.spawn(async move { world.send(input).await });
            }
        }
    }
}

/// Asks the world and waits for its answer, in a place among those that wait for a session.
pub(crate) async fn ask<T>(
    world: &mpsc::Sender<Input>,
    place: Option<Place>,
    input: impl FnOnce(Answer<T>) -> Input,
) -> Result<T, SessionError> {
    let (answer, receive) = Answer::new(place);
    world.send(input(answer)).await.map_err(|_| stopped())?;
    receive.await.unwrap_or_else(|_| {
        if world.is_closed() {
            return Err(stopped());
        }
        Err(SessionError::Internal(
            "handling the request failed; the session goes back to what is stored: read it before \
             the request is sent again"
                .to_owned(),
        ))
    })
}

/// A change, in which an object that had no name has one.
fn named(mut change: Change) -> Change {
    if let Change::CreateCollider(spec) | Change::PutCollider(spec) = &mut change {
        spec.id.get_or_insert_with(|| machine::ulid().to_string());
    }
    change
}

/// Does work that takes a while off the threads that serve requests.
pub(crate) async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, SessionError> + Send + 'static,
) -> Result<T, SessionError> {
    let (send, receive) = oneshot::channel();
    // Sending fails if the client has gone, and then no answer is needed.
    let work = Box::new(move || drop(send.send(work())));
    machine::aside(work, |work| drop(tokio::task::spawn_blocking(work)));
    let failed = |_| SessionError::Internal("reading or making a snapshot failed".to_owned());
    receive.await.map_err(failed)?
}
