"""Processes of a study that end with the study, however it ends.

A child that is started here is killed by the kernel when the study is killed. A study that is
stopped by a signal or an error ends its children before it ends itself.
"""

import contextlib
import ctypes
import multiprocessing as mp
import os
import signal
import time
from collections.abc import Callable, Generator, Iterable, Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, NoReturn, TypeVar

from fdnet.run.progress import ONE_CORE

PATIENCE = 1.0
"""Seconds that children may take to end themselves before they are killed."""
_PR_SET_PDEATHSIG = 1
_SIGNALS = {signal.SIGINT, signal.SIGTERM}

Send = Callable[[Any], None]
Key = TypeVar("Key")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Child:
    """A process of the study.

    Attributes:
        process: the process.
        answers: what it sends; its end is the end of the process.
    """

    process: BaseProcess
    answers: Connection


def start_child(work: Callable[..., None], *arguments: Any) -> Child:
    """Call `work(*arguments, send)` in a new process; what it sends is received in `answers`.

    It works on one core, as all processes do that this one starts from now on. SIGINT and SIGTERM
    wait while the process is being started, so that no child is left unknown.
    """
    os.environ.update(ONE_CORE)  # read when the new process loads numpy and numba
    context = mp.get_context("spawn")
    answers, sender = context.Pipe(duplex=False)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)
    try:
        process = context.Process(
            target=_child, args=(os.getpid(), before, work, arguments, sender), daemon=True
        )
        process.start()
        sender.close()
        return Child(process=process, answers=answers)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _child(
    parent: int,
    mask: set[signal.Signals],
    work: Callable[..., None],
    arguments: tuple[Any, ...],
    sender: Connection,
) -> None:
    """The life of a child: it ends with `parent`, and leaves Ctrl-C to it."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:  # the study ended before the kernel was asked
        os._exit(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _stop)
    with contextlib.suppress(KeyboardInterrupt):
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)  # one that came meanwhile is heard here
        work(*arguments, sender.send)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)  # nothing is left to unwind


def _stop(*_: Any) -> NoReturn:
    """Unwinds the work, which so stops its own processes, as Ctrl-C does in a run."""
    raise KeyboardInterrupt


def end_children(children: Iterable[Child]) -> None:
    """End these processes: first by SIGTERM, after PATIENCE by SIGKILL."""
    running = list(children)
    for child in running:
        child.process.terminate()
    deadline = time.monotonic() + PATIENCE
    for child in running:
        child.process.join(max(0.0, deadline - time.monotonic()))
        child.process.kill()
        child.process.join()
        child.answers.close()


def answers_of(
    work: Callable[..., None], tasks: Mapping[Key, tuple[Any, ...]], *, jobs: int
) -> Generator[tuple[Key, Any], None, None]:
    """Do each task in a process of its own, `jobs` at the same time, in the given order.

    Close the iterator (contextlib.closing) so that all processes end with the block.

    Args:
        work: is called with the arguments of a task and a function that sends its answer.
        tasks: arguments by key.
        jobs: number of processes at the same time.

    Yields:
        Key and answer of each task as it ends; EOFError as the answer of a process that ended
        without one.
    """
    waiting = list(tasks.items())
    running: dict[Connection, tuple[Key, Child]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < jobs:
                key, arguments = waiting.pop(0)
                child = start_child(work, *arguments)
                running[child.answers] = (key, child)
            for answers in wait(list(running)):
                assert isinstance(answers, Connection)
                key, child = running[answers]
                answer = _answer(child)
                del running[answers]
                yield key, answer
    finally:
        end_children(child for _, child in running.values())


def _answer(child: Child) -> Any:
    """What a child sent, once it has ended."""
    try:
        answer = child.answers.recv()
        child.process.join()
    except EOFError:
        child.process.join()
        answer = EOFError(f"its process ended with exit code {child.process.exitcode}")
    child.answers.close()
    return answer
