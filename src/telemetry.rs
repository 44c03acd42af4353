//! What the process says about its work: a log on standard error, and traces for a collector.

use std::io::IsTerminal;
use std::time::Duration;

use opentelemetry::trace::TracerProvider;
use opentelemetry::{KeyValue, global};
use opentelemetry_otlp::{ExporterBuildError, SpanExporter, WithExportConfig};
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::propagation::TraceContextPropagator;
use opentelemetry_sdk::resource::{EnvResourceDetector, TelemetryResourceDetector};
use opentelemetry_sdk::trace::SdkTracerProvider;
use tracing::level_filters::LevelFilter;
use tracing::{Subscriber, info, warn};
use tracing_subscriber::filter::{ParseError, Targets};
use tracing_subscriber::layer::{Layer, SubscriberExt};
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, fmt};

use crate::config::{LogConfig, LogFormat};

/// Where a collector takes traces, below its address.
const TRACES: &str = "/v1/traces";

/// Longest wait for a collector: traces are not worth more.
const PATIENCE: Duration = Duration::from_secs(3);

/// Why there can be no telemetry.
#[derive(Debug, thiserror::Error)]
pub enum TelemetryError {
    /// The filter says nothing that the log understands.
    #[error("{place} '{filter}': {error}")]
    Filter {
        /// What says it.
        place: &'static str,
        /// What it says.
        filter: String,
        /// What is wrong with it.
        error: ParseError,
    },
    /// The exporter can't be made.
    #[error("--otlp-endpoint: {0}")]
    Exporter(#[from] ExporterBuildError),
}

/// Telemetry that has begun.
#[must_use = "spans that were not sent yet are lost unless it is finished"]
#[derive(Debug)]
pub struct Telemetry {
    traces: Option<SdkTracerProvider>,
}

impl Telemetry {
    /// Begins the log, and traces where they are asked for. Not to be called on a thread that runs
    /// asynchronous tasks.
    ///
    /// # Errors
    /// [`TelemetryError`].
    pub fn start(config: &LogConfig) -> Result<Telemetry, TelemetryError> {
        let (filter, place) = config.filter();
        let filter = EnvFilter::try_new(&filter).map_err(|error| TelemetryError::Filter {
            place,
            filter,
            error,
        })?;
        let traces = config.otlp_endpoint.as_deref().map(trace_provider).transpose()?;
        let exported = traces.as_ref().map(|provider| {
            global::set_text_map_propagator(TraceContextPropagator::new());
            let tracer = provider.tracer("firn");
            // Of our own work only: the exporter's requests would be traced and exported as well.
            let ours = Targets::new().with_target("firn", LevelFilter::DEBUG);
            tracing_opentelemetry::layer().with_tracer(tracer).with_filter(ours)
        });
        let subscriber =
            tracing_subscriber::registry().with(exported).with(log(config.log_format, filter));
        // There is one already where a test starts the server twice.
        let _ = subscriber.try_init();
        if let Some(endpoint) = &config.otlp_endpoint {
            info!("traces go to {endpoint}{TRACES}");
        }
        Ok(Telemetry { traces })
    }

    /// Sends what has not been sent yet.
    pub fn finish(self) {
        let shutdown = self.traces.map_or(Ok(()), |it| it.shutdown_with_timeout(PATIENCE));
        if let Err(error) = shutdown {
            warn!("the last traces were not sent: {error}");
        }
    }
}

/// A log of nothing but what goes wrong, for commands whose output is their report.
pub fn log_what_goes_wrong() {
    let filter = EnvFilter::new("warn,wgpu_core=warn,wgpu_hal=error,naga=warn");
    // There is one already where a test calls a command twice.
    let _ = tracing_subscriber::registry().with(log(LogFormat::Text, filter)).try_init();
}

fn log<S>(format: LogFormat, filter: EnvFilter) -> Box<dyn Layer<S> + Send + Sync>
where
    S: Subscriber + for<'a> LookupSpan<'a>,
{
    // A log that nobody reads any more must not end the server.
    let lines = fmt::layer().log_internal_errors(false).with_writer(std::io::stderr);
    match format {
        LogFormat::Text => {
            let ansi = std::io::stderr().is_terminal();
            lines.with_ansi(ansi).with_target(false).with_filter(filter).boxed()
        }
        LogFormat::Json => {
            let objects = lines.json().flatten_event(true).with_span_list(false);
            objects.with_filter(filter).boxed()
        }
    }
}

/// Sends finished spans in batches, from a thread of its own. What OpenTelemetry's environment
/// variables say about headers, sampling, batches and the service's name holds.
fn trace_provider(endpoint: &str) -> Result<SdkTracerProvider, ExporterBuildError> {
    let exporter = SpanExporter::builder()
        .with_http()
        .with_endpoint(format!("{endpoint}{TRACES}"))
        .with_timeout(PATIENCE)
        .build()?;
    let name = std::env::var("OTEL_SERVICE_NAME").ok().filter(|name| !name.is_empty());
    let resource = Resource::builder_empty()
        .with_service_name(name.unwrap_or_else(|| env!("CARGO_PKG_NAME").to_owned()))
        .with_attribute(KeyValue::new("service.version", env!("CARGO_PKG_VERSION")))
        .with_detector(Box::new(EnvResourceDetector::new()))
        .with_detector(Box::new(TelemetryResourceDetector))
        .build();
    Ok(SdkTracerProvider::builder().with_batch_exporter(exporter).with_resource(resource).build())
}
