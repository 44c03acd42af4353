//! What is published about the server is what the server does: `api/`, `docs/` and `deploy/`.

mod arrows;
mod openapi;
mod operations;
#[path = "../support/mod.rs"]
mod support;
