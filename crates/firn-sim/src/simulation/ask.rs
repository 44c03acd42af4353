//! What clients ask, and what they learn of the answers.

use firn::machine::Simulated;
use rand::Rng;

use crate::client::{self, Request};
use crate::model::{Fate, Operation};

use super::{NAMES, Simulation};

/// Requests without an answer at a time.
const MOST_WAITING: usize = 12;

impl Simulation {
    /// Sends a request that waits to be sent, or looks for an answer.
    pub(super) fn poll(&mut self) {
        if !self.waiting.is_empty() {
            let place = self.dice.random_range(0..self.waiting.len());
            self.poll_one(place);
        }
    }

    /// Returns whether it has an answer.
    pub(super) fn poll_one(&mut self, place: usize) -> bool {
        let Some(life) = &self.life else { return false };
        let request = &mut self.waiting[place];
        let Some(model) = self.models.get_mut(&*request.session) else { return false };
        let asked = *request.place.get_or_insert_with(|| model.ask(request.operation.clone()));
        let Some(answer) = request.poll(&life.sessions, model) else { return false };
        if self.tells {
            println!("{} {:?}: {answer:?}", request.session, request.operation);
        }
        let fate = client::fate(&answer);
        let mut request = self.waiting.swap_remove(place);
        request.doubtful |= fate == Fate::Unknown;
        request.forget();
        if let Some((first, _)) = request.first {
            // A repeat that is refused says nothing.
            if answer.as_ref().is_ok_and(|again| *again != first) {
                self.wrong = Some(format!("{first:?} was told first, and then {answer:?}"));
            }
            return true;
        }
        // Who does not know, and may ask again, does.
        if fate != Fate::Done && request.once.is_some() && !self.dice.random_bool(0.1) {
            self.waiting.push(request);
            return false;
        }
        self.report.requests.1 += u64::from(fate == Fate::Done);
        // An earlier answer may have been lost that said something else.
        let fate = if request.doubtful && fate == Fate::Refused { Fate::Unknown } else { fate };
        model.learn(asked, fate, &answer);
        if let (Ok(told), true, true) = (answer, request.once.is_some(), self.dice.random_bool(0.3))
        {
            request.first = Some((told, self.machine.now()));
            self.waiting.push(request);
            return false;
        }
        true
    }

    /// Forgets a request that may have been carried out, or asks again later where it has a key.
    pub(super) fn give_up(&mut self, place: usize) {
        if self.waiting[place].once.is_some() {
            self.waiting[place].lose();
        } else {
            self.waiting.swap_remove(place);
        }
    }

    /// A client has a wish.
    pub(super) fn ask(&mut self) {
        if self.waiting.len() >= MOST_WAITING {
            return;
        }
        let name = NAMES[self.dice.random_range(0..NAMES.len())];
        let object = self.dice.random_range(0..4);
        let missing = self.models[name].found().is_none();
        let beginning = self.dice.random_range(0..=self.models[name].snapshots());
        let kept = self.models[name].found().and_then(|state| state.kept.keys().next().copied());
        let steps = |request: &Request| matches!(request.operation, Operation::Step(_));
        let stepping = self.waiting.iter().any(|it| it.session == name && steps(it));
        let operation = match self.dice.random_range(0..100) {
            0..50 if stepping => Operation::EndStep,
            0..50 if missing => Operation::Create(beginning),
            0..8 => Operation::Create(beginning),
            8..12 => Operation::Delete,
            12..50 => Operation::Snowfall(self.dice.random_range(1..60)),
            50..55 => {
                let (depth, columns) =
                    (self.dice.random_range(0..900), self.dice.random_range(1..9));
                Operation::Clear(depth, columns)
            }
            55..58 => Operation::Stamp(object, self.dice.random_range(1..20)),
            58..62 => Operation::Reissue,
            62..70 => Operation::Air(-self.dice.random_range(1..30)),
            70..78 => Operation::Pause(self.dice.random_bool(0.3)),
            78..80 => Operation::Step(self.dice.random_range(1..200)),
            // Of several frames.
            80..82 => Operation::Step(self.dice.random_range(500..2000)),
            82..90 => Operation::Put(object, self.dice.random_range(1..100)),
            90..92 => Operation::Remove(object),
            92..95 => Operation::Keep(object),
            95 => Operation::Forget(kept.unwrap_or(object)),
            96 => Operation::EndStep,
            97 => Operation::Reset,
            98 => Operation::GoBack(kept.unwrap_or(object)),
            _ if beginning > 0 => Operation::Restore(beginning),
            _ => Operation::Reset,
        };
        // What is sent again and comes late must make no difference to what came meanwhile.
        let repeatable = matches!(operation, Operation::Snowfall(_) | Operation::Clear(..));
        let once = (repeatable && self.dice.random_bool(0.4)).then(|| {
            self.keys += 1;
            client::key(self.keys)
        });
        // Nobody could tell what of them came before a reset, and what after it.
        let mut others = self.waiting.iter().filter(|request| request.session == name);
        if others.any(|request| operation.is_alone() || request.operation.is_alone()) {
            return;
        }
        // Nobody waits any more for what may still be kept.
        if operation.is_alone() && self.models[name].doubts_what_is_kept() {
            return;
        }
        self.report.requests.0 += 1;
        self.waiting.push(Request::new(name, operation, once));
    }
}
