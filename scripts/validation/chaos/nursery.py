"""A process that has imported fdnet and forks for every command, which saves a second each.

    python -m validation.chaos.nursery SOCKET WORD ...

It does the command WORD ... itself first, so that all compiled code is loaded. Then it answers
requests on the socket with the number SOCKET: to start a command, or whether one has ended. A
command runs in a process and session of its own, as one from a terminal does; only the start of
Python and the imports are not repeated.
"""

import json
import os
import resource
import signal
import socket
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any, NoReturn

PROGRAM = "fdnet.cli"
"""The module that `python -m` runs for a command."""
_MOST_BYTES = 1 << 16
_SHOWN = ("fdnet.report.figures", "fdnet.report.html", "fdnet.run.pipeline", "pyvista")
"""Modules that are imported once for all commands."""


def set_limits(limits: Mapping[int, int]) -> None:
    """Limits of the system on this process (RLIMIT_...: value), and an ordinary Ctrl+C."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for what, most in limits.items():
        resource.setrlimit(what, (most, most))


class Nursery:
    """The process, seen from the one that started it. Threads may share it."""

    def __init__(self, words: Sequence[str]) -> None:
        """Start it; `words` is the command that it does first."""
        own, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        module = [sys.executable, "-m", "validation.chaos.nursery", str(other.fileno())]
        self._process = subprocess.Popen(
            [*module, *words],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            pass_fds=(other.fileno(),),
        )
        other.close()
        self._socket, self._lock = own, threading.Lock()

    def start(self, words: Sequence[str], error: int, limits: Mapping[int, int]) -> int:
        """Id of a new process that runs `fdnet WORD ...` with its errors to a descriptor."""
        return int(self._ask({"words": list(words), "limits": list(limits.items())}, [error]))

    def poll(self, process: int) -> int | None:
        """Exit code of a command, negative for a signal; None while it runs."""
        code = self._ask({"poll": process}, [])
        return None if code is None else int(code)

    def _ask(self, request: Mapping[str, Any], descriptors: list[int]) -> Any:
        with self._lock:
            socket.send_fds(self._socket, [json.dumps(request).encode()], descriptors)
            answer = self._socket.recv(_MOST_BYTES)
        if not answer:
            raise RuntimeError("the process that starts commands has ended")
        return json.loads(answer)

    def close(self) -> None:
        """End it."""
        self._socket.close()
        self._process.wait()


def _serve(number: int) -> None:
    with socket.socket(fileno=number) as channel:
        while True:
            text, descriptors, _, _ = socket.recv_fds(channel, _MOST_BYTES, 1)
            if not text:
                return
            request = json.loads(text)
            if "poll" in request:
                ended, status = os.waitpid(request["poll"], os.WNOHANG)
                answer = os.waitstatus_to_exitcode(status) if ended else None
            else:
                answer = os.fork()
                if answer == 0:
                    channel.close()
                    _run(request, descriptors[0])
                os.close(descriptors[0])
            channel.send(json.dumps(answer).encode())


def _run(request: Mapping[str, Any], error: int) -> NoReturn:
    """What a forked process does: the command, as `python -m PROGRAM` would."""
    code: Any = 1
    try:
        os.setsid()
        os.dup2(error, 2)
        os.close(error)
        sys.stderr = os.fdopen(2, "w", buffering=1, closefd=False)
        set_limits({int(what): most for what, most in request["limits"]})
        code = _program()(request["words"])
    except SystemExit as end:
        code = end.code
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(code if isinstance(code, int) else code is not None)


def _program() -> Callable[[Sequence[str]], int]:
    """The function of the command line, which is in a room above this one."""
    main: Callable[[Sequence[str]], int] = import_module(PROGRAM).main
    return main


if __name__ == "__main__":
    for _name in _SHOWN:
        import_module(_name)
    if _program()(sys.argv[2:]) == 0:
        for _number in (signal.SIGINT, signal.SIGTERM):  # a child just forked ends by them
            signal.signal(_number, signal.SIG_DFL)
        _serve(int(sys.argv[1]))
