//! One session: its state, what it is asked, what it does in a frame and what comes back.

pub(crate) mod answer;
pub(crate) mod apply;
pub(crate) mod change;
pub(crate) mod charge;
pub(crate) mod clock;
pub(crate) mod command;
pub(crate) mod decide;
pub(crate) mod error;
pub(crate) mod falling;
pub(crate) mod gather;
pub(crate) mod inbox;
pub(crate) mod mirror;
pub(crate) mod orders;
pub(crate) mod outlet;
pub(crate) mod portion;
pub(crate) mod publish;
pub(crate) mod reach;
pub(crate) mod receipt;
pub(crate) mod simulation;
pub(crate) mod spec;
pub(crate) mod state;
pub(crate) mod step;
pub(crate) mod token;
pub(crate) mod turn;
pub(crate) mod weak;
