"""What tests take: a server, and a client that leaves nothing behind on it."""

from server import client, server

__all__ = ["client", "server"]
