"""A real server for the tests: the program that FIRN_BINARY names, else the newest that cargo has built."""

from __future__ import annotations

import os
import re
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from firn import Client

ROOT = Path(__file__).parents[3]


def binary() -> Path:
    if named := os.environ.get("FIRN_BINARY"):
        return Path(named)
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    built = [path for kind in ("release", "debug") if (path := target / kind / "firn").exists()]
    if not built:
        pytest.fail(f"there is no server in {target}: run `cargo build`, or name one in FIRN_BINARY", pytrace=False)
    return max(built, key=lambda path: path.stat().st_mtime)


class Server:
    """A server on a port of its own, or on a given one."""

    def __init__(self, port: int = 0) -> None:
        with tempfile.NamedTemporaryFile(suffix=".log", delete=False) as log:
            self.log = Path(log.name)
            arguments = ["serve", "--backend", "cpu", "--ephemeral", "--listen", f"127.0.0.1:{port}"]
            self.process = subprocess.Popen([binary(), *arguments], stderr=log)
        self.url = self._announced()
        self.port = int(self.url.rsplit(":", 1)[1])

    def _announced(self) -> str:
        while self.process.poll() is None:
            if found := re.search(r"listening on (http://\S+)", self.log.read_text()):
                return found[1]
            time.sleep(0.02)
        pytest.fail(f"the server ended: {self.log.read_text()}", pytrace=False)

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()

    def stop(self) -> None:
        self.process.terminate()
        self.process.wait(timeout=60)
        self.log.unlink()


@pytest.fixture(scope="session")
def server() -> Iterator[Server]:
    server = Server()
    yield server
    server.stop()


@pytest.fixture
def client(server: Server) -> Iterator[Client]:
    with Client(server.url) as client:
        yield client
        for view in list(client.sessions()):
            client.session(view["id"]).delete()
