"""What goes wrong with a request: problem details after RFC 9457."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class FieldError:
    """A part of a request that was not accepted."""

    pointer: str
    """JSON pointer to the field, or the name of a parameter."""
    detail: str
    """What was found and what is allowed."""


class ProblemError(Exception):
    """The server refused a request, or a command of a stream."""

    def __init__(self, problem: Mapping[str, Any], retry_after: float | None = None) -> None:
        self.status: int = problem["status"]
        self.type: str = problem.get("type", "about:blank")
        self.title: str = problem.get("title", "")
        self.detail: str = problem.get("detail", self.title)
        self.errors = [FieldError(error["pointer"], error["detail"]) for error in problem.get("errors", [])]
        self.retry_after = retry_after
        """Seconds after which trying again makes sense, where the server says so."""
        fields = [f"{error.pointer}: {error.detail}" for error in self.errors]
        super().__init__("\n".join(dict.fromkeys([f"{self.status}: {self.detail}", *fields])))

    @classmethod
    def from_response(cls, status: int, body: bytes, headers: Mapping[str, str]) -> ProblemError:
        """Reads an answer; one that holds no problem, as a proxy may give, becomes a plain one."""
        try:
            said = json.loads(body)
        except ValueError:
            said = None
        problem = said if isinstance(said, dict) else {}
        retry_after = headers.get("retry-after", "")
        return cls(
            {"title": f"HTTP {status}", **problem, "status": status},
            float(retry_after) if retry_after.isdigit() else None,
        )
