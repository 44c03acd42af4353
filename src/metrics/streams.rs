//! Streams: how many are open, what they carry, and how they end.

use firn_protocol::stream::{Cause, SubProtocol};
use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::{Registry, Unit};

/// Counts streams.
#[derive(Clone, Debug, Default)]
pub struct StreamMetrics {
    open: Family<ByProtocol, Gauge>,
    ended: Family<ByCause, Counter>,
    messages: Family<ByProtocol, Counter>,
    bytes: Family<ByProtocol, Counter>,
    tiles: Family<ByProtocol, Counter>,
    encoded: Family<ByProtocol, Counter>,
    conflated: Family<ByProtocol, Counter>,
}

/// What the streams of one protocol carry: handles that cost no look-up.
#[derive(Clone, Debug)]
pub struct Carried {
    open: Gauge,
    messages: Counter,
    bytes: Counter,
    tiles: Counter,
    encoded: Counter,
    conflated: Counter,
}

impl Carried {
    fn open(metrics: &StreamMetrics, protocol: SubProtocol) -> Carried {
        let label = ByProtocol { protocol: protocol.name() };
        let carried = Carried {
            open: metrics.open.get_or_create_owned(&label),
            messages: metrics.messages.get_or_create_owned(&label),
            bytes: metrics.bytes.get_or_create_owned(&label),
            tiles: metrics.tiles.get_or_create_owned(&label),
            encoded: metrics.encoded.get_or_create_owned(&label),
            conflated: metrics.conflated.get_or_create_owned(&label),
        };
        carried.open.inc();
        carried
    }

    /// Counts a message of heights to a client.
    pub fn message(&self, bytes: usize) {
        self.messages.inc();
        self.bytes.inc_by(bytes as u64);
    }

    /// Counts the tiles of a message, which may have several parts, and those that were encoded for it.
    pub fn tiles(&self, told: u64, encoded: u64) {
        self.tiles.inc_by(told);
        self.encoded.inc_by(encoded);
    }

    /// Counts states that a newer one replaced before the client could be told.
    pub fn conflated(&self, states: u64) {
        self.conflated.inc_by(states);
    }
}

impl Drop for Carried {
    fn drop(&mut self) {
        self.open.dec();
    }
}

impl StreamMetrics {
    /// Adds the metrics of streams to a registry.
    pub fn register(registry: &mut Registry) -> StreamMetrics {
        let metrics = StreamMetrics::default();
        registry.register("streams", "Streams that are open", metrics.open.clone());
        let help = "Streams that have ended, by cause";
        registry.register("streams_ended", help, metrics.ended.clone());
        let help = "Messages of heights to stream clients";
        registry.register("stream_messages", help, metrics.messages.clone());
        let help = "Payload of the messages of heights to stream clients";
        registry.register_with_unit("stream_payload", help, Unit::Bytes, metrics.bytes.clone());
        let help = "Tiles told to stream clients";
        registry.register("stream_tiles", help, metrics.tiles.clone());
        let help = "Tiles that were encoded for stream clients; the others were shared";
        registry.register("stream_tiles_encoded", help, metrics.encoded.clone());
        let help = "Published states that newer ones replaced before a busy client was told";
        registry.register("stream_states_conflated", help, metrics.conflated.clone());
        // What has not occurred yet reads 0, so that alerts and rates can watch it.
        for cause in Cause::ALL {
            drop(metrics.ended.get_or_create(&ByCause { cause: cause.label() }));
        }
        for protocol in SubProtocol::ALL {
            drop(Carried::open(&metrics, protocol));
        }
        metrics
    }

    /// Counts a stream as open until what is returned is dropped.
    pub fn begin(&self, protocol: SubProtocol) -> Carried {
        Carried::open(self, protocol)
    }

    /// Counts a stream that ended.
    pub fn end(&self, cause: Cause) {
        self.ended.get_or_create(&ByCause { cause: cause.label() }).inc();
    }

    /// Streams that have ended for a cause.
    pub fn ended(&self, cause: Cause) -> u64 {
        self.ended.get_or_create(&ByCause { cause: cause.label() }).get()
    }
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct ByProtocol {
    protocol: &'static str,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct ByCause {
    cause: &'static str,
}
