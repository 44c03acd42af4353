//! The Rust client, `firn-client`, against a real server.

use std::sync::Arc;

use firn::config::BackendChoice;
use firn_client::{Client, Error, HeightField, Heights, Message, Session, Stream};
use firn_protocol::stream::{Command, SubProtocol};
use firn_protocol::{
    Clearing, ColumnRegion, DepthWatch, Event, EventKind, Events, Load, Region, SampleBatch,
    SampleField, SampleReply, SessionSpec, SettingsPatch, SnowLayer, Snowfall, State, StepSpec,
    Subscribe, Terrain, Update,
};
use firn_snow::Grid;
use tokio::time::timeout;

use crate::on_each_backend;
use crate::support::wait::PATIENCE;
use crate::support::{Server, numbers, slow};

on_each_backend!(
    a_field_is_what_rest_reads,
    a_step_is_told_and_ended,
    a_session_goes_back,
    it_resumes_where_it_was,
    events_and_watches_are_asked_for,
    what_is_refused_says_why,
    samples_are_typed,
    the_ground_is_laid_anew,
    a_stream_tells_its_end,
);

/// A paused session of 3 × 2 tiles with a metre of snow.
async fn field(server: &Server) -> Session {
    let client = Client::new(&server.url).unwrap();
    let spec = SessionSpec {
        grid: Grid { width: 20, depth: 12, height: 20, cell_size: 0.2 },
        paused: true,
        initial_snow: vec![SnowLayer::new(1.0)],
        ..SessionSpec::default()
    };
    client.create(&spec).await.unwrap().0
}

async fn the_ground_is_laid_anew(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = field(&server).await;
    assert_eq!(session.terrain().await.unwrap(), [0.0; 240]);
    let mut stream = session.stream(SubProtocol::Binary).await.unwrap();
    let wish = Subscribe { terrain: true, ..Subscribe::default() };
    let id = stream.subscribe(wish.clone()).await.unwrap();
    let mut field = HeightField::new(stream.welcome(), id, &wish);
    assert!(field.take(&told(&mut stream).await));
    assert_eq!(field.ground(), [0.0; 240]);
    let heights: Arc<[f64]> = (0..240).map(f64::from).collect();
    let stamp = session.put_terrain(&Terrain { heights: heights.clone() }).await.unwrap();
    assert_eq!(session.terrain().await.unwrap(), *heights);
    let view = session.view().await.unwrap();
    assert!(view.terrain && view.seq == stamp.seq);
    until(&mut field, &mut stream, stamp.seq).await;
    assert_eq!((field.ground(), field.ground_height(19, 1)), (&*heights, Some(39.0)));
    let few = Terrain { heights: [1.0].into() };
    let refused = session.put_terrain(&few).await.unwrap_err();
    assert!(
        matches!(&refused, Error::Refused { problem, .. } if problem.status == 422),
        "{refused}"
    );
    server.stop().await;
}

async fn samples_are_typed(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = field(&server).await;
    let batch = SampleBatch {
        points: vec![[0.3, 0.5], [4.0, 2.4]],
        fields: vec![SampleField::Depth, SampleField::Sink],
        load: Some(Load { mass: 80.0, area: 0.1, duration: Some(0.5) }),
    };
    let reply = session.sample(&batch).await.unwrap();
    assert_eq!(reply.fields.depth, Some(vec![1.0, 1.0]));
    assert!(reply.fields.sink.as_ref().unwrap().iter().all(|&sink| sink > 0.01));
    assert_eq!(reply.fields.normal, None);
    let mut stream = session.stream(SubProtocol::Binary).await.unwrap();
    stream.send(&Command::Samples { id: 3, batch }).await.unwrap();
    let Message::Ack(ack) = stream.next().await.unwrap() else { panic!("no ack") };
    let fields = serde_json::from_value(ack.reply["fields"].clone()).unwrap();
    assert_eq!((ack.id, SampleReply { stamp: ack.stamp, fields }), (3, reply));
    server.stop().await;
}

/// The next message of heights.
async fn told(stream: &mut Stream) -> Heights {
    let heights = async {
        loop {
            if let Message::Heights(heights) = stream.next().await.unwrap() {
                return heights;
            }
        }
    };
    timeout(PATIENCE, heights).await.expect("the server tells nothing")
}

/// Takes in what is told until a field shows a state.
async fn until(field: &mut HeightField, stream: &mut Stream, seq: u64) {
    while field.resume().is_none_or(|resume| resume.seq < seq) {
        let heights = told(stream).await;
        field.take(&heights);
    }
}

async fn a_field_is_what_rest_reads(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = field(&server).await;
    for protocol in [SubProtocol::Json, SubProtocol::Binary] {
        let mut stream = session.stream(protocol).await.unwrap();
        let wish = Subscribe { quantum: 0.0001, max_rate: 60.0, ..Subscribe::default() };
        let id = stream.subscribe(wish.clone()).await.unwrap();
        let mut field = HeightField::new(stream.welcome(), id, &wish);
        let region = Some(Region { x: 0.0, z: 0.0, width: 1.0, depth: 1.0 });
        let snowfall = Snowfall { region, ..Snowfall::new(0.3) };
        session.snowfall(&snowfall).await.unwrap();
        let step = StepSpec { ticks: Some(30), ..StepSpec::default() };
        let view = session.step(&step).await.unwrap();
        until(&mut field, &mut stream, view.seq).await;
        let read = server.get(&session.path("/heights")).await.expect(200);
        let read = numbers(&read["heights"]);
        assert_eq!((field.size(), field.heights().len()), ((20, 12), read.len()));
        for (told, read) in field.heights().iter().zip(&read) {
            assert!((told - read).abs() < 0.000_051, "{told} for {read}");
        }
        assert!(field.height(0, 0).unwrap() > field.height(19, 11).unwrap() + 0.2);
        stream.close().await;
    }
    assert_eq!(session.mass().await.unwrap().imbalance_quanta, 0);
    server.stop().await;
}

async fn a_step_is_told_and_ended(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(slow()).await;
    let client = Client::new(&server.url).unwrap();
    let session = client.session(path.trim_start_matches("/v1/sessions/")).unwrap();
    let mut stream = session.stream(SubProtocol::Json).await.unwrap();
    let step = StepSpec { ticks: Some(1_000_000), ..StepSpec::default() };
    let watched = async {
        loop {
            if let Message::Event(Event::StepProgress { progress: Some(progress), .. }) =
                stream.next().await.unwrap()
            {
                break progress;
            }
        }
    };
    let ended = async {
        let progress = watched.await;
        assert_eq!(progress.of, 1_000_000);
        let view = session.view().await.unwrap();
        assert_eq!(view.state, State::Stepping);
        assert!(
            view.progress.unwrap().done >= progress.done,
            "{:?} before {progress:?}",
            view.progress
        );
        session.end_step().await.unwrap();
    };
    let (stepped, ()) = tokio::join!(session.step(&step), ended);
    let stepped = stepped.unwrap();
    assert!(stepped.tick < 1_000_000 && stepped.progress.is_none(), "{}", stepped.tick);
    assert!(matches!(session.end_step().await, Err(Error::Refused { .. })));
    server.stop().await;
}

async fn a_session_goes_back(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = field(&server).await;
    let mut stream = session.stream(SubProtocol::Json).await.unwrap();
    let kept = session.put_checkpoint("full").await.unwrap();
    assert_eq!(session.checkpoints().await.unwrap().items, std::slice::from_ref(&kept));
    assert_eq!(session.checkpoint("full").await.unwrap(), kept);
    let snapshot = session.snapshot().await.unwrap();
    assert_eq!(kept.bytes, snapshot.len() as u64);
    for to_checkpoint in [true, false] {
        session.clear(&Clearing { depth: 0.1, ..Clearing::default() }).await.unwrap();
        let back = if to_checkpoint {
            session.reset_to_checkpoint("full").await.unwrap()
        } else {
            session.reset_to_snapshot(snapshot.clone()).await.unwrap()
        };
        assert!(back.summary.min_height > 0.9, "{:?}", back.summary);
        let told = loop {
            if let Message::Event(Event::Reset { stamp }) = stream.next().await.unwrap() {
                break stamp;
            }
        };
        assert_eq!((told.tick, told.seq), (back.tick, back.seq));
    }
    session.delete_checkpoint("full").await.unwrap();
    let gone = session.reset_to_checkpoint("full").await;
    assert!(matches!(gone, Err(Error::Refused { .. })), "{gone:?}");
    server.stop().await;
}

async fn it_resumes_where_it_was(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = field(&server).await;
    let mut stream = session.stream(SubProtocol::Binary).await.unwrap();
    let id = stream.subscribe(Subscribe::default()).await.unwrap();
    let mut field = HeightField::new(stream.welcome(), id, &Subscribe::default());
    let first = told(&mut stream).await;
    assert!(first.snapshot && field.take(&first));
    assert_eq!((first.id, first.tiles.len()), (id, 6));
    stream.close().await;

    // Snow on the last tile while nobody watches.
    let region = Some(Region { x: 3.3, z: 1.7, width: 0.6, depth: 0.6 });
    session.snowfall(&Snowfall { region, ..Snowfall::new(0.5) }).await.unwrap();
    let mut stream = session.stream(SubProtocol::Binary).await.unwrap();
    let resume = field.resume();
    let id = stream.subscribe(Subscribe { resume, ..Subscribe::default() }).await.unwrap();
    field.reconnect(stream.welcome(), id).unwrap();
    let missed = told(&mut stream).await;
    assert_eq!((missed.snapshot, missed.recovered), (false, Some(true)));
    let corners: Vec<_> = missed.tiles.iter().map(|tile| (tile.column_x, tile.column_z)).collect();
    assert_eq!(corners, [(16, 8)]);
    let before = field.height(17, 9).unwrap();
    assert!(field.take(&missed) && field.height(17, 9).unwrap() > before + 0.4);
    server.stop().await;
}

/// The next event.
async fn event(stream: &mut Stream) -> Event {
    let event = async {
        loop {
            if let Message::Event(event) = stream.next().await.unwrap() {
                return event;
            }
        }
    };
    timeout(PATIENCE, event).await.expect("nothing happens")
}

async fn events_and_watches_are_asked_for(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = field(&server).await;
    let mut stream = session.stream(SubProtocol::Binary).await.unwrap();
    let region = Some(ColumnRegion { column_x: 0, column_z: 0, width: 8, depth: 8 });
    let deep = DepthWatch { id: "deep".to_owned(), region, above: Some(1.5), below: None };
    let events = Some(Events::from_iter([EventKind::Clearing]));
    let wish =
        Subscribe { region, events, watch: vec![deep], max_rate: 60.0, ..Subscribe::default() };
    let subscription = stream.subscribe(wish).await.unwrap();
    let mut stands = async || match event(&mut stream).await {
        Event::Watch { subscription: told, id, holds, mean_depth, .. } => {
            assert_eq!((told, &*id), (subscription, "deep"));
            (holds, mean_depth)
        }
        other => panic!("{other:?}"),
    };
    assert_eq!(stands().await, (false, 1.0));
    session.snowfall(&Snowfall::new(1.0)).await.unwrap();
    assert_eq!(stands().await, (true, 2.0));
    let update = Update { region, events: None, watch: Some(Vec::new()) };
    stream.send(&Command::Update { id: subscription, update }).await.unwrap();
    let cleared = session.clear(&Clearing::default()).await.unwrap();
    let Event::Clearing { cleared_mass, stamp } = event(&mut stream).await else {
        panic!("a watch that is gone tells something")
    };
    assert_eq!((cleared_mass, stamp), (cleared.cleared_mass, cleared.stamp));
    server.stop().await;
}

async fn what_is_refused_says_why(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = field(&server).await;
    let refused = session.snowfall(&Snowfall::new(-1.0)).await.unwrap_err();
    let problem = refused.problem().expect("the server refuses it");
    assert_eq!((problem.status, &*problem.errors[0].pointer), (422, "/depth"));
    let nobody = Client::new(&server.url).unwrap().session("nobody").unwrap();
    assert_eq!(nobody.view().await.unwrap_err().problem().map(|problem| problem.status), Some(404));
    let no_stream = nobody.stream(SubProtocol::Json).await.unwrap_err();
    assert_eq!(no_stream.problem().map(|problem| problem.status), Some(404));
    nobody.delete().await.expect("what is not there counts as deleted");

    let mut stream = session.stream(SubProtocol::Json).await.unwrap();
    let settings = SettingsPatch { tick_rate: Some(0.0), ..SettingsPatch::default() };
    stream.send(&Command::Set { id: 3, settings }).await.unwrap();
    match timeout(PATIENCE, stream.next()).await.expect("it answers").unwrap() {
        Message::Refused { id, problem } => assert_eq!((id, problem.status), (Some(3), 422)),
        other => panic!("{other:?}"),
    }
    let snowfall = Snowfall::new(0.1);
    stream.send(&Command::Snowfall { id: 4, snowfall }).await.unwrap();
    let (mut acknowledged, mut fell) = (false, false);
    while !(acknowledged && fell) {
        match timeout(PATIENCE, stream.next()).await.expect("it answers").unwrap() {
            Message::Ack(ack) => {
                acknowledged = ack.id == 4 && ack.reply["fallen_mass"].as_f64() > Some(0.0);
            }
            Message::Event(Event::Snowfall { fallen_mass, .. }) => fell = fallen_mass > 0.0,
            other => panic!("{other:?}"),
        }
    }
    server.stop().await;

    // Nobody listens there any more.
    let gone = session.view().await.unwrap_err();
    assert!(matches!(gone, Error::Unreachable { .. }), "{gone}");
}

async fn a_stream_tells_its_end(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = field(&server).await;
    let mut stream = session.stream(SubProtocol::Json).await.unwrap();
    session.delete().await.unwrap();
    let end = timeout(PATIENCE, async {
        loop {
            if let Err(end) = stream.next_raw().await {
                return end;
            }
        }
    });
    match end.await.expect("it ends") {
        Error::Closed { code, reason } => {
            assert_eq!((code, &*reason), (3502, "the session was deleted"));
        }
        other => panic!("{other}"),
    }
    server.stop().await;
}
