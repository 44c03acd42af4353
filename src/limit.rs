//! What one client, or all of them, may take of the server.

/// A limit, named as its option where it has one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Limit {
    /// Connections at a time.
    MaxConnections,
    /// Time without a byte taken.
    WriteTimeout,
    /// Length of a body.
    MaxBodyBytes,
    /// Memory of bodies that are arriving.
    MaxBodies,
    /// Memory of answers that were not taken yet.
    MaxUnsent,
    /// Time for a body, or for an answer.
    RequestTimeout,
    /// Memory of answers that are kept for repeats.
    KeptAnswers,
    /// Requests with one token.
    RequestsPerSecond,
    /// Requests that wait for one session.
    WaitingRequests,
    /// Wrong tokens from one address.
    AuthFailuresPerMinute,
    /// Sessions, columns and cells that the server holds.
    ServerFull,
    /// What a tenant may hold, or ask for.
    Quota,
    /// Messages of one stream.
    StreamCommandsPerSecond,
    /// Time for a message to be taken by a stream's client.
    StreamWriteTimeout,
}

impl Limit {
    /// Every limit.
    pub const ALL: [Limit; 14] = [
        Limit::MaxConnections,
        Limit::WriteTimeout,
        Limit::MaxBodyBytes,
        Limit::MaxBodies,
        Limit::MaxUnsent,
        Limit::RequestTimeout,
        Limit::KeptAnswers,
        Limit::RequestsPerSecond,
        Limit::WaitingRequests,
        Limit::AuthFailuresPerMinute,
        Limit::ServerFull,
        Limit::Quota,
        Limit::StreamCommandsPerSecond,
        Limit::StreamWriteTimeout,
    ];

    /// Its name, that of the option without the dashes before it.
    pub fn name(self) -> &'static str {
        match self {
            Limit::MaxConnections => "max-connections",
            Limit::WriteTimeout => "write-timeout",
            Limit::MaxBodyBytes => "max-body-bytes",
            Limit::MaxBodies => "max-bodies",
            Limit::MaxUnsent => "max-unsent",
            Limit::RequestTimeout => "request-timeout",
            Limit::KeptAnswers => "kept-answers",
            Limit::RequestsPerSecond => "requests-per-second",
            Limit::WaitingRequests => "waiting-requests",
            Limit::AuthFailuresPerMinute => "auth-failures-per-minute",
            Limit::ServerFull => "server-full",
            Limit::Quota => "quota",
            Limit::StreamCommandsPerSecond => "stream-commands-per-second",
            Limit::StreamWriteTimeout => "stream-write-timeout",
        }
    }
}
