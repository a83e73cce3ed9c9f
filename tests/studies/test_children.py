"""Processes of a study: how they end."""

import atexit
import os
import signal
import time
from collections.abc import Callable
from typing import Any

import pytest

from validation.engine.children import end_children, start_child


def _slow_to_leave(send: Callable[[Any], None]) -> None:
    """Sends an answer, and is busy for a while when Python shuts down."""
    atexit.register(_wait)
    send("done")


def _wait() -> None:
    end = time.monotonic() + 5.0
    while time.monotonic() < end:
        time.sleep(0.01)


def test_a_child_that_is_done_says_nothing_when_it_is_ended(
    capfd: pytest.CaptureFixture[str],
) -> None:
    child = start_child(_slow_to_leave)
    assert child.answers.recv() == "done"
    time.sleep(0.5)  # it is in `_wait` by now
    end_children([child])
    assert not child.process.is_alive()
    assert capfd.readouterr().err == ""


def test_a_child_that_is_stopped_while_it_starts_says_nothing(
    capfd: pytest.CaptureFixture[str],
) -> None:
    """The signal waits until the child can hear it, before its work has begun."""
    child = start_child(_slow_to_leave)
    assert child.process.pid is not None
    os.kill(child.process.pid, signal.SIGTERM)
    child.process.join(60)
    assert child.process.exitcode == 0
    assert capfd.readouterr().err == ""
