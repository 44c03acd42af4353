//! Sums over all sessions, and over those of each tenant.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use firn_protocol::MemoryBytes;

use crate::core::tenant::Tenant;
use crate::session::registry::Sessions;

/// Sums over all sessions.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// Sessions that are locked.
    pub locked: u64,
    /// Tiles in which snow moves.
    pub active_tiles: u64,
    /// Tiles.
    pub tiles: u64,
    /// Device memory that their cells take \[bytes\].
    pub device_memory: u64,
    /// Sums over those of each tenant, by its name: the operator's is empty.
    pub tenants: BTreeMap<String, TenantTotals>,
}

/// Sums over the sessions of one tenant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TenantTotals {
    /// How many there are.
    pub sessions: u64,
    /// Device time that they have taken, those that are deleted included.
    pub device_time: Duration,
    /// Memory that they take.
    pub memory: MemoryBytes,
}

impl Sessions {
    /// Sums over all sessions.
    pub fn totals(&self) -> Totals {
        let named = |tenant: Arc<Tenant>| {
            let device_time = tenant.device_time();
            (tenant.name.clone(), TenantTotals { device_time, ..TenantTotals::default() })
        };
        let tenants: BTreeMap<_, _> = self.tenants().all().into_iter().map(named).collect();
        let mut totals = Totals { tenants, ..Totals::default() };
        let theirs = totals.tenants.values().map(|tenant| tenant.device_time).sum();
        let operators = self.vitals().device_time().saturating_sub(theirs);
        let operator = TenantTotals { device_time: operators, ..TenantTotals::default() };
        totals.tenants.insert(String::new(), operator);
        for session in self.names.list(None, None, usize::MAX) {
            totals.locked += u64::from(session.is_locked());
            totals.active_tiles += u64::from(session.mirror().active_tiles);
            totals.tiles += u64::from(session.spec.grid.tiles());
            let (memory, name) = (session.memory(), session.tenant.as_ref().map(|it| &*it.name));
            totals.device_memory += memory.device;
            if let Some(tenant) = totals.tenants.get_mut(name.unwrap_or("")) {
                tenant.sessions += 1;
                tenant.memory += memory;
            }
        }
        totals
    }
}
