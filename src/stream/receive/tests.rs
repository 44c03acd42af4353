use std::future::pending;
use std::sync::Mutex;
use std::time::Duration;

use firn_protocol::{AirTemperature, Stamp};
use futures_util::stream;
use governor::{Quota, RateLimiter};
use serde_json::Value;
use tokio::sync::oneshot;

use super::*;

type Applying = oneshot::Sender<Result<Applied, SessionError>>;

/// Changes that are applied when a test says so.
#[derive(Default)]
struct Desk(Mutex<Vec<(Change, Option<Applying>)>>);

impl Desk {
    async fn apply(&self, change: Change) -> Result<Applied, SessionError> {
        let (send, receive) = oneshot::channel();
        self.0.lock().unwrap().push((change, Some(send)));
        receive.await.unwrap()
    }

    fn begun(&self) -> Vec<f64> {
        let celsius = |change: &Change| match change {
            Change::AirTemperature(AirTemperature { celsius }) => *celsius,
            other => panic!("{other:?}"),
        };
        self.0.lock().unwrap().iter().map(|(change, _)| celsius(change)).collect()
    }

    fn finish(&self, place: usize) {
        let applying = self.0.lock().unwrap()[place].1.take().unwrap();
        applying.send(Ok(Applied::Stamp(Stamp { tick: 0, seq: place as u64 }))).unwrap();
    }
}

fn text(text: String) -> Result<Message, axum::Error> {
    Ok(Message::Text(text.into()))
}

fn air(id: usize) -> Result<Message, axum::Error> {
    text(format!(r#"{{"op":"air_temperature","id":{id},"celsius":-{id}}}"#))
}

/// Bounds that nothing here reaches.
fn free() -> Bounds<'static> {
    static IDLE: AtomicBool = AtomicBool::new(false);
    Bounds { rate: rate(1_000_000), writing: &IDLE, unfinished: None }
}

/// Some commands at once, and no more for a long time.
fn rate(at_once: u32) -> DefaultDirectRateLimiter {
    let refill = Quota::with_period(Duration::from_secs(3600)).unwrap();
    RateLimiter::direct(refill.allow_burst(at_once.try_into().unwrap()))
}

/// Nothing here reads the snow.
async fn reads(_: i64, _: Read) -> Next {
    unreachable!("no message asks for it")
}

/// Messages, and after them nothing.
fn waiting(
    messages: Vec<Result<Message, axum::Error>>,
) -> impl Stream<Item = Result<Message, axum::Error>> + Unpin {
    Box::pin(stream::iter(messages).chain(stream::once(pending())))
}

fn id(next: Option<Next>) -> Value {
    let Some(Next::Text(text)) = next else { panic!("{next:?}") };
    serde_json::from_str::<Value>(&text).unwrap()["id"].clone()
}

#[tokio::test]
async fn changes_are_begun_and_answered_in_order_whatever_the_order_of_their_ends() {
    let desk = Desk::default();
    let messages = waiting((0..300).map(air).collect());
    let (send, mut answers) = mpsc::channel(4);
    let listening = receive(messages, send, (|change| desk.apply(change), reads), free());
    let watching = async {
        while desk.begun().len() < 300 {
            tokio::task::yield_now().await;
        }
        (0..300).rev().for_each(|place| desk.finish(place));
        for expected in 0..300 {
            assert_eq!(id(answers.recv().await), expected);
        }
    };
    tokio::select! {
        cause = listening => panic!("{cause:?}"),
        () = watching => {}
    }
    assert_eq!(desk.begun(), (0..300).map(|i| -f64::from(i)).collect::<Vec<_>>());
}

#[tokio::test]
async fn no_more_is_read_than_may_be_under_way() {
    let desk = Desk::default();
    let messages = waiting((0..PIPELINE + 10).map(air).collect());
    let (send, mut answers) = mpsc::channel(1);
    let listening = receive(messages, send, (|change| desk.apply(change), reads), free());
    let watching = async {
        for _ in 0..4 * PIPELINE {
            tokio::task::yield_now().await;
        }
        assert_eq!(desk.begun().len(), PIPELINE);
        // Finished ones still count as long as nobody takes their answers.
        (0..PIPELINE).for_each(|place| desk.finish(place));
        for _ in 0..4 * PIPELINE {
            tokio::task::yield_now().await;
        }
        assert!(desk.begun().len() <= PIPELINE + 1, "{}", desk.begun().len());
        for expected in 0..PIPELINE {
            assert_eq!(id(answers.recv().await), expected);
        }
        while desk.begun().len() < PIPELINE + 10 {
            tokio::task::yield_now().await;
        }
    };
    tokio::select! {
        cause = listening => panic!("{cause:?}"),
        () = watching => {}
    }
}

#[tokio::test]
async fn what_cannot_be_read_is_answered_in_its_turn() {
    let desk = Desk::default();
    let messages = waiting(vec![
        air(1),
        text("{".to_owned()),
        Ok(Message::Binary(vec![1].into())),
        text(r#"{"op":"ping","id":4}"#.to_owned()),
    ]);
    let (send, mut answers) = mpsc::channel(8);
    let listening = receive(messages, send, (|change| desk.apply(change), reads), free());
    let watching = async {
        while desk.begun().is_empty() {
            tokio::task::yield_now().await;
        }
        desk.finish(0);
        assert_eq!(id(answers.recv().await), 1);
        assert_eq!(id(answers.recv().await), Value::Null);
        assert_eq!(id(answers.recv().await), Value::Null);
        let last = answers.recv().await;
        assert!(matches!(last, Some(Next::Control(Control::Ping(Some(4))))), "{last:?}");
    };
    tokio::select! {
        cause = listening => panic!("{cause:?}"),
        () = watching => {}
    }
}

#[tokio::test(start_paused = true)]
async fn a_client_is_given_up_after_a_minute_of_silence() {
    let desk = Desk::default();
    let pongs = stream::unfold(0, |count| async move {
        if count == 3 {
            pending::<()>().await;
        }
        tokio::time::sleep(Duration::from_secs(50)).await;
        Some((Ok(Message::Pong(Vec::new().into())), count + 1))
    });
    let (send, _answers) = mpsc::channel(1);
    let begin = Instant::now();
    let cause = receive(Box::pin(pongs), send, (|change| desk.apply(change), reads), free()).await;
    assert_eq!((cause, begin.elapsed().as_secs()), (Cause::Silent, 3 * 50 + 60));
}

#[tokio::test]
async fn the_end_of_the_messages_says_why() {
    let ends = [
        (vec![Ok(Message::Close(None))], Cause::Done),
        (vec![], Cause::Broken),
        (vec![Err(axum::Error::new(std::io::Error::other("cut")))], Cause::Broken),
    ];
    for (messages, expected) in ends {
        let desk = Desk::default();
        let (send, _answers) = mpsc::channel(1);
        let cause =
            receive(stream::iter(messages), send, (|change| desk.apply(change), reads), free())
                .await;
        assert_eq!(cause, expected);
    }
}

#[tokio::test(start_paused = true)]
async fn nobody_is_called_silent_while_a_message_to_it_is_being_written() {
    let desk = Desk::default();
    let writing = AtomicBool::new(true);
    let (send, _answers) = mpsc::channel(1);
    let bounds = Bounds { writing: &writing, ..free() };
    let begin = Instant::now();
    let listening = receive(waiting(vec![]), send, (|change| desk.apply(change), reads), bounds);
    let written = async {
        tokio::time::sleep(Duration::from_secs(70)).await;
        writing.store(false, Ordering::Relaxed);
    };
    let (cause, ()) = tokio::join!(listening, written);
    assert_eq!((cause, begin.elapsed().as_secs()), (Cause::Silent, 120));
}

#[tokio::test(start_paused = true)]
async fn more_commands_than_are_taken_end_the_stream() {
    let desk = Desk::default();
    let bounds = Bounds { rate: rate(5), ..free() };
    let pings = (0..6).map(|id| text(format!(r#"{{"op":"ping","id":{id}}}"#))).collect();
    let (send, mut answers) = mpsc::channel(8);
    let cause = receive(waiting(pings), send, (|change| desk.apply(change), reads), bounds).await;
    assert_eq!(cause, Cause::TooManyCommands);
    while let Some(next) = answers.recv().await {
        assert!(matches!(next, Next::Control(Control::Ping(Some(0..5)))), "{next:?}");
    }
}
