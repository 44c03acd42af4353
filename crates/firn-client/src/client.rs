//! A server.

use std::time::Duration;

use firn_protocol::{CreatedSession, SessionSpec, is_valid_id};
use reqwest::header::{self, HeaderValue};
use reqwest::{Method, RequestBuilder, Response, Url};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::{Error, refused, root_cause};
use crate::session::Session;

/// Longest time until a connection stands.
const CONNECTING: Duration = Duration::from_secs(10);

/// Longest time without a byte of an answer. Steps until the snow has settled may take minutes.
const SILENCE: Duration = Duration::from_secs(600);

/// A server, with the key to send along. Clones share their connections.
#[derive(Clone, Debug)]
pub struct Client {
    http: reqwest::Client,
    base: Url,
    /// `Authorization`, which no log shows.
    bearer: Option<HeaderValue>,
}

impl Client {
    /// The server at an address such as `http://127.0.0.1:8080`; a path below which it is may follow. TLS is
    /// not spoken.
    ///
    /// # Errors
    /// [`Error::Address`].
    pub fn new(url: &str) -> Result<Client, Error> {
        let wrong = || Error::Address(url.to_owned());
        let base = Url::parse(url).map_err(|_| wrong())?;
        let plain = base.username().is_empty() && base.password().is_none();
        if base.scheme() != "http"
            || base.host_str().is_none_or(str::is_empty)
            || !plain
            || base.query().is_some()
            || base.fragment().is_some()
        {
            return Err(wrong());
        }
        let unreachable =
            |why: reqwest::Error| Error::Unreachable { url: url.to_owned(), why: root_cause(&why) };
        let http = reqwest::Client::builder()
            .no_proxy()
            .connect_timeout(CONNECTING)
            .read_timeout(SILENCE)
            .build()
            .map_err(unreachable)?;
        Ok(Client { http, base, bearer: None })
    }

    /// The same client, with an API key or one of a session's tokens in each request.
    ///
    /// # Errors
    /// [`Error::Key`] where a header can't carry it.
    pub fn with_key(self, key: &str) -> Result<Client, Error> {
        let mut bearer = HeaderValue::try_from(format!("Bearer {key}")).map_err(|_| Error::Key)?;
        bearer.set_sensitive(true);
        Ok(Client { bearer: Some(bearer), ..self })
    }

    /// Creates a session. Returns a handle to it, and the server's answer with its tokens.
    ///
    /// # Errors
    /// [`Error::Refused`] where the server has no room for it or a field is out of its range.
    pub async fn create(&self, spec: &SessionSpec) -> Result<(Session, CreatedSession), Error> {
        let created: CreatedSession = self.call(Method::POST, "/v1/sessions", Some(spec)).await?;
        Ok((self.session(&created.session.id)?, created))
    }

    /// A handle to a session. Whether it exists shows at the first call.
    ///
    /// # Errors
    /// [`Error::Name`] where no session can have that name.
    pub fn session(&self, id: &str) -> Result<Session, Error> {
        Ok(Session::new(self.clone(), checked(id)?))
    }

    /// Sends a request and reads the answer as JSON.
    ///
    /// # Errors
    /// [`Error::Refused`] where the server says why not.
    pub async fn call<T: DeserializeOwned>(
        &self,
        method: Method,
        path: &str,
        body: Option<&(impl Serialize + ?Sized)>,
    ) -> Result<T, Error> {
        let what = format!("{method} {path}");
        read_json(self.send(method, path, body).await?, what).await
    }

    /// Sends bytes of a media type and reads the answer as JSON.
    ///
    /// # Errors
    /// [`Error::Refused`] where the server says why not.
    pub(crate) async fn call_with_bytes<T: DeserializeOwned>(
        &self,
        method: Method,
        path: &str,
        media_type: &'static str,
        body: Vec<u8>,
    ) -> Result<T, Error> {
        let (what, url) = (format!("{method} {path}"), self.url(path));
        let request = self.request(method, &url).header(header::CONTENT_TYPE, media_type);
        let unreachable = |error| Error::Unreachable { url, why: root_cause(&error) };
        read_json(request.body(body).send().await.map_err(unreachable)?, what).await
    }

    /// Sends a request and ignores the body of its answer.
    ///
    /// # Errors
    /// [`Error::Refused`] where the server says why not.
    pub async fn tell(
        &self,
        method: Method,
        path: &str,
        body: Option<&(impl Serialize + ?Sized)>,
    ) -> Result<(), Error> {
        let what = format!("{method} {path}");
        let response = accepted(self.send(method, path, body).await?, &what).await?;
        // The connection is only used again once the answer is read.
        let read = response.bytes().await;
        read.map(drop).map_err(|error| Error::Unreadable { what, why: root_cause(&error) })
    }

    /// Reads something that is too large to be read at once. Returns the response before its body is read.
    ///
    /// # Errors
    /// [`Error::Refused`] where the server says why not.
    pub async fn fetch(&self, path: &str) -> Result<Response, Error> {
        let response = self.send(Method::GET, path, None::<&()>).await?;
        accepted(response, &format!("GET {path}")).await
    }

    /// Sends a request and returns the response, whatever its status.
    ///
    /// # Errors
    /// [`Error::Unreachable`].
    pub async fn send(
        &self,
        method: Method,
        path: &str,
        body: Option<&(impl Serialize + ?Sized)>,
    ) -> Result<Response, Error> {
        let url = self.url(path);
        let mut request = self.request(method, &url);
        if let Some(body) = body {
            request = request.json(body);
        }
        let unreachable = |error| Error::Unreachable { url, why: root_cause(&error) };
        request.send().await.map_err(unreachable)
    }

    /// A request with the key, where there is one.
    fn request(&self, method: Method, url: &str) -> RequestBuilder {
        let request = self.http.request(method, url);
        match &self.bearer {
            Some(bearer) => request.header(header::AUTHORIZATION, bearer),
            None => request,
        }
    }

    /// Where something of the server is.
    pub(crate) fn url(&self, path: &str) -> String {
        format!("{}{path}", self.base.as_str().trim_end_matches('/'))
    }

    /// `Authorization`, where there is a key.
    pub(crate) fn bearer(&self) -> Option<&HeaderValue> {
        self.bearer.as_ref()
    }

    /// The server's host.
    pub fn host(&self) -> &str {
        self.base.host_str().unwrap_or_default()
    }

    /// The path below which the server is, without a slash at its end; empty for most.
    pub fn base_path(&self) -> &str {
        self.base.path().trim_end_matches('/')
    }

    /// Host and port to connect to.
    pub fn address(&self) -> String {
        format!("{}:{}", self.host(), self.base.port_or_known_default().unwrap_or(80))
    }
}

/// Refuses a name that no session or object can have: in a path it could lead the request elsewhere.
pub(crate) fn checked(id: &str) -> Result<&str, Error> {
    if is_valid_id(id) { Ok(id) } else { Err(Error::Name(id.to_owned())) }
}

/// An answer in JSON.
async fn read_json<T: DeserializeOwned>(response: Response, what: String) -> Result<T, Error> {
    let answer = accepted(response, &what).await?.bytes().await;
    let unreadable = |why| Error::Unreadable { what: what.clone(), why };
    let answer = answer.map_err(|error| unreadable(root_cause(&error)))?;
    serde_json::from_slice(&answer).map_err(|error| unreadable(error.to_string()))
}

/// A response, unless it is a problem.
async fn accepted(response: Response, what: &str) -> Result<Response, Error> {
    let status = response.status();
    if status.is_success() {
        return Ok(response);
    }
    let told = response.bytes().await.unwrap_or_default();
    Err(refused(what.to_owned(), status, &told))
}

#[cfg(test)]
mod tests {
    use tokio::io::AsyncReadExt;
    use tokio::net::TcpListener;

    use super::*;

    #[test]
    fn an_address_is_that_of_a_host_with_or_without_port_and_path() {
        let address = |url| Client::new(url).map(|client| client.address());
        assert_eq!(address("http://snow.example").unwrap(), "snow.example:80");
        assert_eq!(address("HTTP://snow.example:81/firn/").unwrap(), "snow.example:81");
        assert_eq!(address("http://[::1]").unwrap(), "[::1]:80");
        assert_eq!(address("http://[::1]:8080").unwrap(), "[::1]:8080");
        for wrong in [
            "https://snow.example",
            "snow.example:80",
            "http://",
            "http://127.0.0.1@snow.example",
            "http://snow.example/?x",
        ] {
            assert!(matches!(Client::new(wrong), Err(Error::Address(_))), "{wrong}");
        }
        let below = Client::new("http://snow.example/firn/").unwrap();
        assert_eq!(below.url("/livez"), "http://snow.example/firn/livez");
    }

    #[tokio::test]
    async fn answers_may_come_compressed() {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let client = Client::new(&format!("http://{}", listener.local_addr().unwrap())).unwrap();
        let asking = tokio::spawn(async move { client.fetch("/livez").await.map(drop) });
        let (mut socket, _) = listener.accept().await.unwrap();
        let mut head = Vec::new();
        while !head.ends_with(b"\r\n\r\n") {
            assert_ne!(socket.read_buf(&mut head).await.unwrap(), 0);
        }
        asking.abort();
        let head = String::from_utf8(head).unwrap().to_lowercase();
        let taken = head.lines().find_map(|line| line.strip_prefix("accept-encoding: "));
        let taken: Vec<_> = taken.unwrap().split(',').map(str::trim).collect();
        assert!(taken.contains(&"gzip") && taken.contains(&"zstd"), "{taken:?}");
    }

    #[test]
    fn names_lead_nowhere_else_and_keys_are_not_shown() {
        let client = Client::new("http://snow.example").unwrap();
        for wrong in ["", "..", "a/b", "a?b", "a#b", "%2e"] {
            assert!(matches!(client.session(wrong), Err(Error::Name(_))), "{wrong}");
        }
        let client = client.with_key("hunter2").unwrap();
        assert!(!format!("{client:?}").contains("hunter2"), "{client:?}");
        assert!(matches!(client.with_key("a\nb"), Err(Error::Key)));
    }
}
