//! Memory that all clients together may take for something, counted in bytes.

use std::sync::Arc;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// What a permit of the semaphore stands for \[bytes\]: it counts no further than 32 bits.
const UNIT: u64 = 1024;

/// Bytes that there are, and who waits for some. Clones are handles to the same.
#[derive(Clone, Debug)]
pub struct Budget {
    most: u32,
    free: Arc<Semaphore>,
}

/// Bytes that somebody has, until this is dropped.
#[derive(Debug)]
pub struct Reservation {
    budget: Budget,
    permit: OwnedSemaphorePermit,
}

impl Budget {
    /// A number of bytes, all of them free.
    pub fn new(bytes: u64) -> Budget {
        let most = units(bytes).min(Semaphore::MAX_PERMITS as u64) as u32;
        Budget { most, free: Arc::new(Semaphore::new(most as usize)) }
    }

    /// Bytes that are taken.
    pub fn held(&self) -> u64 {
        (u64::from(self.most) - self.free.available_permits() as u64) * UNIT
    }

    /// Takes bytes as soon as they are free, those first who have waited longest. Who wants more than
    /// there are gets them all: what is larger than the budget is there by itself.
    pub async fn reserve(&self, bytes: u64) -> Reservation {
        let free = self.free.clone();
        let permit = free.acquire_many_owned(self.permits(bytes)).await;
        let permit = permit.expect("a budget's semaphore is never closed");
        Reservation { budget: self.clone(), permit }
    }

    /// Takes bytes where they are free and nobody waits for them.
    pub fn try_reserve(&self, bytes: u64) -> Option<Reservation> {
        let permit = self.free.clone().try_acquire_many_owned(self.permits(bytes)).ok()?;
        Some(Reservation { budget: self.clone(), permit })
    }

    fn permits(&self, bytes: u64) -> u32 {
        units(bytes).min(self.most.into()) as u32
    }
}

impl Reservation {
    /// Takes more bytes, or gives some back, so that it is this many. Returns whether they were free;
    /// where not, nothing has changed.
    pub fn resize(&mut self, bytes: u64) -> bool {
        let (wanted, held) = (self.budget.permits(bytes) as usize, self.permit.num_permits());
        if wanted <= held {
            drop(self.permit.split(held - wanted));
            return true;
        }
        let more = self.budget.free.clone().try_acquire_many_owned((wanted - held) as u32);
        more.map(|more| self.permit.merge(more)).is_ok()
    }
}

fn units(bytes: u64) -> u64 {
    bytes.div_ceil(UNIT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn what_is_given_back_others_may_take() {
        let budget = Budget::new(10 * UNIT);
        let mut first = budget.reserve(6 * UNIT).await;
        assert!(budget.try_reserve(5 * UNIT).is_none());
        let second = budget.try_reserve(4 * UNIT - 1).expect("it is rounded up to what is left");
        assert_eq!(budget.held(), 10 * UNIT);
        assert!(!first.resize(7 * UNIT));
        assert!(first.resize(2 * UNIT));
        assert_eq!(budget.held(), 6 * UNIT);
        drop(second);
        assert!(first.resize(10 * UNIT));
        drop(first);
        assert_eq!(budget.held(), 0);
    }

    #[tokio::test]
    async fn what_is_larger_than_all_is_there_by_itself() {
        let budget = Budget::new(4 * UNIT);
        let small = budget.reserve(UNIT).await;
        let waiting = tokio::spawn({
            let budget = budget.clone();
            async move { budget.reserve(u64::MAX).await }
        });
        tokio::task::yield_now().await;
        assert!(budget.try_reserve(UNIT).is_none(), "it would be overtaken for ever");
        drop(small);
        let large = waiting.await.unwrap();
        assert_eq!(budget.held(), 4 * UNIT);
        drop(large);
        assert_eq!(budget.held(), 0);
    }
}
