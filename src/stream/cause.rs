//! Why a stream ends, and what its client is told.

use std::io::ErrorKind;

use axum::extract::ws::CloseFrame;
use firn_protocol::stream::Cause;
use tungstenite::Error as WsError;

use crate::limit::Limit;

/// What the client is told; `None` where there is nobody to tell.
pub fn close_frame(cause: Cause) -> Option<CloseFrame> {
    cause.close().map(|(code, reason)| CloseFrame { code, reason: reason.into() })
}

/// The limit that it met, where it was one.
pub fn limit(cause: Cause) -> Option<Limit> {
    match cause {
        Cause::TooSlow => Some(Limit::StreamWriteTimeout),
        Cause::TooManyCommands => Some(Limit::StreamCommandsPerSecond),
        _ => None,
    }
}

/// Whether the rest of what the client sends can still be read.
pub fn is_readable(cause: Cause) -> bool {
    !matches!(cause, Cause::Broken | Cause::Malformed | Cause::TooBig | Cause::NoRoom)
}

/// Why a stream ends whose connection failed.
pub fn cause_of(error: axum::Error) -> Cause {
    match error.into_inner().downcast_ref::<WsError>() {
        Some(WsError::Capacity(_)) => Cause::TooBig,
        Some(WsError::Protocol(_) | WsError::Utf8(_) | WsError::AttackAttempt) => Cause::Malformed,
        Some(WsError::Io(error)) => match error.kind() {
            ErrorKind::TimedOut => Cause::TooSlow,
            ErrorKind::OutOfMemory => Cause::NoRoom,
            _ => Cause::Broken,
        },
        _ => Cause::Broken,
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
            (WsError::Io(ErrorKind::TimedOut.into()), Cause::TooSlow),
            (WsError::Io(ErrorKind::OutOfMemory.into()), Cause::NoRoom),
        ];
        for (error, cause) in cases {
            assert_eq!(cause_of(axum::Error::new(error)), cause);
        }
    }
}
