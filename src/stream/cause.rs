//! Why a stream ends, and what its client is told.

use axum::extract::ws::CloseFrame;
use tungstenite::Error as WsError;

/// Why a stream ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Cause {
    /// The client closed it.
    Done,
    /// The connection broke.
    Broken,
    /// The client did not keep to the WebSocket protocol.
    Malformed,
    /// A message of the client was too big.
    TooBig,
    /// Nothing was heard from the client for too long.
    Silent,
    /// A message could not be written for too long.
    TooSlow,
    /// The client sent more commands than it may.
    TooManyCommands,
    /// The server is stopping.
    Draining,
    /// The client's token is none of the session's, or no longer.
    BadToken,
    /// There is no such session.
    UnknownSession,
    /// The session was deleted.
    Deleted,
}

impl Cause {
    /// Every cause.
    pub const ALL: [Cause; 11] = [
        Cause::Done,
        Cause::Broken,
        Cause::Malformed,
        Cause::TooBig,
        Cause::Silent,
        Cause::TooSlow,
        Cause::TooManyCommands,
        Cause::Draining,
        Cause::BadToken,
        Cause::UnknownSession,
        Cause::Deleted,
    ];

    /// A label for logs and counters.
    pub fn label(self) -> &'static str {
        match self {
            Cause::Done => "done",
            Cause::Broken => "broken",
            Cause::Malformed => "malformed",
            Cause::TooBig => "too_big",
            Cause::Silent => "silent",
            Cause::TooSlow => "too_slow",
            Cause::TooManyCommands => "too_many_commands",
            Cause::Draining => "draining",
            Cause::BadToken => "bad_token",
            Cause::UnknownSession => "unknown_session",
            Cause::Deleted => "deleted",
        }
    }

    /// What the client is told; `None` where there is nobody to tell.
    pub fn close_frame(self) -> Option<CloseFrame> {
        let (code, reason) = match self {
            Cause::Broken | Cause::Silent => return None,
            Cause::Done => (1000, "done"),
            Cause::Draining => (1001, "the server is stopping; connect again"),
            Cause::Malformed => (1002, "not a WebSocket message"),
            Cause::TooBig => (1009, "a message may have at most 1 MiB"),
            Cause::TooSlow => (3008, "a message could not be delivered for too long"),
            Cause::TooManyCommands => (3013, "more commands per second than are taken"),
            Cause::BadToken => (3500, "the token is missing, or not one of this session's"),
            Cause::UnknownSession => (3501, "there is no such session"),
            Cause::Deleted => (3502, "the session was deleted"),
        };
        Some(CloseFrame { code, reason: reason.into() })
    }

    /// Whether the rest of what the client sends can still be read.
    pub fn is_readable(self) -> bool {
        !matches!(self, Cause::Broken | Cause::Malformed | Cause::TooBig)
    }
}

impl From<axum::Error> for Cause {
    fn from(error: axum::Error) -> Cause {
        match error.into_inner().downcast_ref::<WsError>() {
            Some(WsError::Capacity(_)) => Cause::TooBig,
            Some(WsError::Protocol(_) | WsError::Utf8(_) | WsError::AttackAttempt) => {
                Cause::Malformed
            }
            _ => Cause::Broken,
        }
    }
}

#[cfg(test)]
mod tests {
    use tungstenite::error::{CapacityError, ProtocolError};

    use super::*;

    #[test]
    fn errors_of_the_connection_have_their_causes() {
        let cases = [
            (
                WsError::Capacity(CapacityError::MessageTooLong { size: 2, max_size: 1 }),
                Cause::TooBig,
            ),
            (WsError::Protocol(ProtocolError::UnmaskedFrameFromClient), Cause::Malformed),
            (WsError::Utf8(String::new()), Cause::Malformed),
            (WsError::Io(std::io::Error::other("cut")), Cause::Broken),
        ];
        for (error, cause) in cases {
            assert_eq!(Cause::from(axum::Error::new(error)), cause);
        }
    }

    #[test]
    fn close_codes_are_those_of_the_contract() {
        let codes = [
            (Cause::Done, Some(1000)),
            (Cause::Draining, Some(1001)),
            (Cause::TooBig, Some(1009)),
            (Cause::TooSlow, Some(3008)),
            (Cause::TooManyCommands, Some(3013)),
            (Cause::BadToken, Some(3500)),
            (Cause::UnknownSession, Some(3501)),
            (Cause::Deleted, Some(3502)),
            (Cause::Silent, None),
        ];
        for (cause, code) in codes {
            assert_eq!(cause.close_frame().map(|frame| frame.code), code, "{}", cause.label());
        }
    }
}
