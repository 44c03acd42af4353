//! An asynchronous client of a Firn server, for game servers and tools.
//!
//! A [`Client`] talks to a server, a [`Session`] is a handle to one snowpack there, and a [`Stream`] reports the
//! changes of its surface. The types of requests and answers come from [`firn_protocol`]. A request that the
//! server refuses returns [`Error::Refused`] with the server's problem details.
//!
//! ```no_run
//! use firn_client::{Client, Message};
//! use firn_protocol::stream::SubProtocol;
//! use firn_protocol::{SessionSpec, Snowfall, Subscribe};
//!
//! # async fn run() -> Result<(), firn_client::Error> {
//! let client = Client::new("http://127.0.0.1:8080")?;
//! let (alp, _) = client.create(&SessionSpec::default()).await?;
//! alp.snowfall(&Snowfall::new(0.5)).await?;
//!
//! let mut stream = alp.stream(SubProtocol::Binary).await?;
//! stream.subscribe(Subscribe::default()).await?;
//! loop {
//!     if let Message::Heights(heights) = stream.next().await? {
//!         println!("tick {}: {} tiles", heights.tick, heights.tiles.len());
//!     }
//! }
//! # }
//! ```
//!
//! Alpine snow feels the weather:
//!
//! ```no_run
//! use firn_client::Client;
//! use firn_protocol::{Physics, SessionBody, SnowLayer, Weather};
//!
//! # async fn run() -> Result<(), firn_client::Error> {
//! let client = Client::new("http://127.0.0.1:8080")?;
//! let snow = vec![SnowLayer::new(1.2)];
//! let body = SessionBody { physics: Physics::Alpine, initial_snow: snow, ..SessionBody::default() };
//! let (alp, _) = client.create(&body.into()).await?;
//! let thaw = Weather { air_temperature: 4.0, rainfall: Some(2.0), shortwave: Some(0.0), ..Weather::default() };
//! alp.put_weather(&thaw.into()).await?;
//! println!("{:?}", alp.weather().await?.now);
//! # Ok(())
//! # }
//! ```
//!
//! A [`HeightField`] puts the tiles together, and the ground where a subscription asks for its
//! [`terrain`](firn_protocol::Subscribe::terrain). After a lost connection, open another stream, pass
//! [`HeightField::resume`] to the next subscription, and only what was missed is sent. To forward or count
//! messages without decoding them, use [`Stream::next_raw`].

mod client;
mod error;
mod field;
mod message;
mod session;
mod stream;

pub use client::Client;
pub use error::Error;
pub use field::{HeightField, OtherGrid};
pub use firn_protocol as protocol;
pub use message::{Ack, HeightTile, Heights, Message, Welcome, read};
pub use reqwest::{Method, Response};
pub use session::Session;
pub use stream::{Raw, Stream};
pub use tokio_tungstenite::tungstenite::{Bytes, Utf8Bytes};
