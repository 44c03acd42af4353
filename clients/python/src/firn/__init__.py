"""Client of Firn, the snowpack server.

`Client` speaks REST; `Session.stream` opens the height stream. Units are SI and °C, names are those of the wire:
api/openapi.json and api/asyncapi.yaml describe them.
"""

from .client import Client
from .codec import GROUND_STEPS_PER_METRE, DecodeError, GroundTile, HeightMessage, Tile, decode
from .problem import FieldError, ProblemError
from .session import Heights, Samples, Session
from .stream import Disconnected, Stream, StreamClosed
from .subscription import Change, Subscription

__all__ = [
    "GROUND_STEPS_PER_METRE",
    "Change",
    "Client",
    "DecodeError",
    "Disconnected",
    "FieldError",
    "GroundTile",
    "HeightMessage",
    "Heights",
    "ProblemError",
    "Samples",
    "Session",
    "Stream",
    "StreamClosed",
    "Subscription",
    "Tile",
    "decode",
]
