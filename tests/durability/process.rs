//! The real program, started, killed and started again.

use std::path::Path;
use std::process::Stdio;

use reqwest::{Client, Method, StatusCode};
use serde_json::Value;
use tokio::io::{AsyncBufReadExt, BufReader, Lines};
use tokio::process::{Child, ChildStderr, Command};

use crate::support::wait::{PATIENCE, until};

/// A running server.
pub struct Process {
    child: Child,
    log: Lines<BufReader<ChildStderr>>,
    /// Log lines read so far.
    pub read: Vec<String>,
    pub url: String,
    client: Client,
}

impl Process {
    /// Starts the program on a data directory; it need not be ready yet when this returns.
    pub async fn start(data: &Path, options: &[&str]) -> Process {
        Process::spawn(Process::command(data, options)).await
    }

    /// What starts the program.
    pub fn command(data: &Path, options: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_firn"));
        command.args(["serve", "--listen", "127.0.0.1:0", "--data-dir"]).arg(data).args(options);
        command
    }

    /// Starts a server by a command; it need not be ready yet when this returns.
    pub async fn spawn(mut command: Command) -> Process {
        let mut child = command
            .env_remove("FIRN_LOG")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .kill_on_drop(true)
            .spawn()
            .expect("the program starts");
        let log = BufReader::new(child.stderr.take().expect("it is piped")).lines();
        let client = Client::new();
        let mut process = Process { child, log, read: Vec::new(), url: String::new(), client };
        let line = process.wait_for("listening on ").await;
        let at = line.find("http://").expect("the line names the address");
        process.url = line[at..].split_whitespace().next().unwrap().to_owned();
        process
    }

    /// Starts the program and waits until it is ready.
    pub async fn ready(data: &Path, options: &[&str]) -> Process {
        let process = Process::start(data, options).await;
        process.recover().await;
        process
    }

    /// Waits until it is ready.
    pub async fn recover(&self) {
        until("it is ready", async || {
            let (status, body) = self.send(Method::GET, "/readyz", None).await.unwrap();
            if status != 200 {
                assert_eq!((status, &body["status"]), (503, &Value::from("recovering")));
            }
            status == 200
        })
        .await;
    }

    /// The value of a metric without labels.
    pub async fn metric(&self, name: &str) -> f64 {
        let text =
            self.client.get(format!("{}/metrics", self.url)).send().await.expect("it answers");
        let text = text.text().await.expect("it is text");
        let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
        line.unwrap_or_else(|| panic!("no {name} in {text}")).parse().expect("a number")
    }

    /// Waits for a line of the log.
    pub async fn wait_for(&mut self, text: &str) -> String {
        loop {
            let line = tokio::time::timeout(PATIENCE, self.log.next_line()).await;
            let line = line.unwrap_or_else(|_| panic!("no '{text}' in {:#?}", self.read));
            let line = line.unwrap().unwrap_or_else(|| panic!("no '{text}' in {:#?}", self.read));
            self.read.push(line.clone());
            if line.contains(text) {
                return line;
            }
        }
    }

    /// Sends a request; `None` where the server is gone.
    pub async fn send(
        &self,
        method: Method,
        path: &str,
        body: Option<&Value>,
    ) -> Option<(u16, Value)> {
        send(&self.client, &self.url, method, path, body).await
    }

    pub async fn get(&self, path: &str) -> Value {
        let (status, body) = self.send(Method::GET, path, None).await.expect("it answers");
        assert_eq!(status, 200, "{path}: {body}");
        body
    }

    pub async fn post(&self, path: &str, body: Value) -> Value {
        let (status, answer) =
            self.send(Method::POST, path, Some(&body)).await.expect("it answers");
        assert!((200..300).contains(&status), "{path}: {answer}");
        answer
    }

    /// The number of its process.
    pub fn id(&self) -> u32 {
        self.child.id().expect("it runs")
    }

    /// Ends it as a crash would.
    pub async fn kill(mut self) {
        self.child.kill().await.expect("it can be killed");
    }

    /// Asks it to stop.
    pub fn terminate(&self) {
        let id = rustix::process::Pid::from_raw(self.id() as i32).expect("a process has a number");
        rustix::process::kill_process(id, rustix::process::Signal::TERM).expect("it is ours");
    }

    /// Waits until it has ended; returns its exit code and all of its log.
    pub async fn exit_code(mut self) -> (Option<i32>, Vec<String>) {
        let all = async {
            while let Ok(Some(line)) = self.log.next_line().await {
                self.read.push(line);
            }
        };
        tokio::time::timeout(PATIENCE, all).await.expect("it does not end");
        (self.child.wait().await.expect("it ends").code(), self.read)
    }

    /// Waits until it has stopped; returns the rest of its log.
    pub async fn ended(mut self) -> (bool, Vec<String>) {
        while let Ok(Some(line)) = self.log.next_line().await {
            self.read.push(line);
        }
        let status = self.child.wait().await.expect("it ends");
        (status.success(), self.read)
    }
}

/// Sends a request; `None` where there is no answer.
pub async fn send(
    client: &Client,
    url: &str,
    method: Method,
    path: &str,
    body: Option<&Value>,
) -> Option<(u16, Value)> {
    let mut request = client.request(method, format!("{url}{path}"));
    if let Some(body) = body {
        request = request.json(body);
    }
    let response = request.send().await.ok()?;
    let status = response.status();
    let body = response.bytes().await.ok()?;
    if status == StatusCode::NO_CONTENT {
        return Some((204, Value::Null));
    }
    Some((status.as_u16(), serde_json::from_slice(&body).expect("answers are JSON")))
}
