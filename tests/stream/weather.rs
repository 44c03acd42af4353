//! The weather of alpine snow: by the Rust client, and over the stream.

use firn::config::BackendChoice;
use firn_client::{Ack, Client, Error, Message, Session, Stream};
use firn_protocol::stream::{Command, SubProtocol};
use firn_protocol::{
    Event, Physics, SessionBody, SessionSpec, Site, SnowLayer, Weather, WeatherInput, WeatherRow,
    WeatherSeries,
};
use firn_snow::Grid;
use tokio::time::timeout;

use crate::on_each_backend;
use crate::support::wait::PATIENCE;
use crate::support::{Server, small};

on_each_backend!(
    weather_is_told_read_and_replaced,
    a_stream_takes_weather_and_tells_it,
    only_alpine_snow_feels_weather,
);

async fn alpine(server: &Server) -> Session {
    let body = SessionBody {
        physics: Physics::Alpine,
        grid: Grid { width: 4, depth: 4, height: 20, cell_size: 0.1 },
        paused: true,
        initial_snow: vec![SnowLayer { density: Some(280.0), ..SnowLayer::new(1.0) }],
        weather: Some(WeatherInput::from(weather(-6.0)).into()),
        ..SessionBody::default()
    };
    let client = Client::new(&server.url).unwrap();
    client.create(&SessionSpec::from(body)).await.unwrap().0
}

/// Weather of an air temperature, with nothing to be worked out.
fn weather(air_temperature: f64) -> Weather {
    Weather {
        air_temperature,
        shortwave: Some(120.0),
        longwave: Some(250.0),
        cloud_cover: Some(0.5),
        pressure: Some(870.0),
        ..Weather::default()
    }
}

/// Mild weather, and an hour later colder one.
fn cooling() -> WeatherInput {
    let row = |at, air_temperature| WeatherRow { at, weather: weather(air_temperature) };
    let series = vec![row(0.0, 2.0), row(3600.0, -2.0)];
    WeatherInput::Series(WeatherSeries { series, interpolate: true })
}

async fn weather_is_told_read_and_replaced(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = alpine(&server).await;
    let view = session.view().await.unwrap();
    assert_eq!((view.physics, view.weather_step), (Physics::Alpine, Some(900.0)));
    assert_eq!(view.site.as_deref(), Some(&Site::default()));
    let told = session.weather().await.unwrap();
    assert_eq!(*told.weather, WeatherInput::from(weather(-6.0)));
    assert_eq!((told.now.air_temperature, told.now.shortwave), (-6.0, 120.0));
    assert!(told.derived.is_empty() && told.steps == 0, "{told:?}");
    let stamp = session.put_weather(&cooling()).await.unwrap();
    let told = session.weather().await.unwrap();
    assert_eq!((told.stamp, told.now.air_temperature), (stamp, 2.0));
    assert_eq!(*told.weather, cooling());

    let mut unsorted = cooling();
    if let WeatherInput::Series(series) = &mut unsorted {
        series.series.reverse();
    }
    match session.put_weather(&unsorted).await.unwrap_err() {
        Error::Refused { problem, .. } => {
            assert_eq!((problem.status, &*problem.errors[0].pointer), (422, "/series/1/at"));
        }
        other => panic!("{other}"),
    }
    assert_eq!(*session.weather().await.unwrap().weather, cooling());
    server.stop().await;
}

async fn a_stream_takes_weather_and_tells_it(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = alpine(&server).await;
    let mut stream = session.stream(SubProtocol::Json).await.unwrap();
    for (id, input, celsius) in [(1, WeatherInput::from(weather(-9.0)), -9.0), (2, cooling(), 2.0)]
    {
        stream.send(&Command::Weather { id, weather: input.clone() }).await.unwrap();
        let (ack, event) = answers(&mut stream).await;
        assert_eq!((ack.id, ack.reply.len()), (id, 0));
        let Event::Weather { stamp, now } = event else { panic!("{event:?}") };
        assert_eq!((stamp, now.air_temperature), (ack.stamp, celsius));
        let told = session.weather().await.unwrap();
        assert_eq!((&*told.weather, told.now), (&input, now));
    }
    server.stop().await;
}

async fn only_alpine_snow_feels_weather(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    let id = path.rsplit('/').next().unwrap();
    let session = Client::new(&server.url).unwrap().session(id).unwrap();
    let status = |error: Error| match error {
        Error::Refused { problem, .. } => problem.status,
        other => panic!("{other}"),
    };
    assert_eq!(status(session.weather().await.unwrap_err()), 409);
    assert_eq!(status(session.put_weather(&cooling()).await.unwrap_err()), 409);
    let mut stream = session.stream(SubProtocol::Json).await.unwrap();
    stream.send(&Command::Weather { id: 1, weather: cooling() }).await.unwrap();
    let refused = async {
        loop {
            if let Message::Refused { id, problem } = stream.next().await.unwrap() {
                return (id, problem.status);
            }
        }
    };
    assert_eq!(timeout(PATIENCE, refused).await.unwrap(), (Some(1), 409));
    server.stop().await;
}

/// The answer to a change and the event of it, in whatever order they come.
async fn answers(stream: &mut Stream) -> (Ack, Event) {
    let (mut ack, mut event) = (None, None);
    let listen = async {
        loop {
            match stream.next().await.unwrap() {
                Message::Ack(told) => ack = Some(told),
                Message::Event(told) if matches!(told, Event::Weather { .. }) => event = Some(told),
                _ => {}
            }
            if let (Some(ack), Some(event)) = (&ack, &event) {
                return (ack.clone(), event.clone());
            }
        }
    };
    timeout(PATIENCE, listen).await.expect("the server tells nothing")
}
