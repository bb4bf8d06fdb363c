"""A server that goes away in the middle of something, and work that is then done again."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from kpred.errors import DatabaseError

ATTEMPTS = 4
"""How often work is done again when the server goes away in the middle of it."""

Value = TypeVar("Value")


class ConnectionLost(DatabaseError):
    """The server went away, or has not come back; what was not committed is not there."""


def steadily(work: Callable[[bool], Value]) -> Value:
    """Do work that may be done again, and do it again when the server went away in the middle of it.

    `work` is told whether a connection was lost before.
    """
    for attempt in range(ATTEMPTS):
        try:
            return work(attempt > 0)
        except ConnectionLost:
            if attempt == ATTEMPTS - 1:
                raise
    raise AssertionError("unreachable")
