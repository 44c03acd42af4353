//! A server as it is started from a shell.

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, ChildStderr, Command, ExitStatus, Stdio};

/// `firn serve` as it is started from a shell, with some options.
pub fn serve(options: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_firn"));
    command
        .args(["serve", "--backend", "cpu", "--ephemeral"])
        .args(options)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    command
}

/// A server that is ended with the test.
pub struct Running {
    child: Child,
    log: BufReader<ChildStderr>,
    seen: String,
    /// Where it listens.
    pub url: String,
}

impl Running {
    /// Starts a server, and waits until it says where it listens.
    pub fn start(mut command: Command) -> Running {
        let mut child = command.spawn().expect("it starts");
        let mut log = BufReader::new(child.stderr.take().expect("its log is piped"));
        let mut seen = String::new();
        let url = loop {
            let mut line = String::new();
            assert!(log.read_line(&mut line).expect("the log is text") > 0, "it ended: {seen}");
            seen.push_str(&line);
            if let Some((_, at)) = line.split_once("listening on ") {
                let end = |c: char| c.is_whitespace() || c == '"';
                break at.split(end).next().expect("an address").to_owned();
            }
        };
        Running { child, log, seen, url }
    }

    /// Kills it; returns everything that it logged.
    pub fn end(mut self) -> String {
        self.child.kill().expect("it runs");
        self.log.read_to_string(&mut self.seen).expect("the log is text");
        self.child.wait().expect("it ends");
        std::mem::take(&mut self.seen)
    }

    /// Asks it to stop and waits until it has; returns its exit code and everything that it logged.
    #[cfg(unix)]
    pub fn stop(self) -> (Option<i32>, String) {
        self.signal(rustix::process::Signal::TERM);
        let (status, log) = self.ended();
        (status.code(), log)
    }

    /// Sends it a signal.
    #[cfg(unix)]
    pub fn signal(&self, signal: rustix::process::Signal) {
        rustix::process::kill_process(self.pid(), signal).expect("it runs");
    }

    /// The number of its process.
    #[cfg(unix)]
    pub fn pid(&self) -> rustix::process::Pid {
        rustix::process::Pid::from_child(&self.child)
    }

    /// Waits until it has ended; returns how, and everything that it logged.
    pub fn ended(mut self) -> (ExitStatus, String) {
        self.log.read_to_string(&mut self.seen).expect("the log is text");
        let status = self.child.wait().expect("it ends");
        (status, std::mem::take(&mut self.seen))
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
