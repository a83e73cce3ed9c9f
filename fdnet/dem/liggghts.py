"""Running the LIGGGHTS binary: finding it, starting it, feeding it, and what its end means.

The environment in which LIGGGHTS is started, with what Open MPI reads of it.
"""

import contextlib
import ctypes
import fcntl
import os
import re
import resource
import select
import shlex
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from fdnet.errors import CaseError, LiggghtsError
from fdnet.files import disk_is_full

_ALWAYS = {
    "OMP_NUM_THREADS": "1",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
}
_ALONE = {
    "OMPI_MCA_ess_singleton_isolated": "1",
    "OMPI_MCA_orte_create_session_dirs": "0",
    "OMPI_MCA_pml": "ob1",
    "OMPI_MCA_btl": "self",
}
"""One rank talks to no other one. So it starts no daemon and looks for no network, which takes
Open MPI a third of a second at each start. It makes no folder in /tmp either: without the daemon
all processes would share one, and a process that ends would remove it while another one starts.
Another MPI does not read these variables."""


def environment(ranks: int) -> dict[str, str]:
    """The environment of this process, and what LIGGGHTS on so many `ranks` needs."""
    return os.environ | _ALWAYS | (_ALONE if ranks == 1 else {})


# ------------------------------------------------------------------------------------------------
# Whether a run of LIGGGHTS really finished; its exit code 0 alone proves nothing.


END_MARK = "DECK_DONE"
"""The last line that a deck prints."""
SCREEN = "screen.txt"
"""File with what LIGGGHTS printed."""
_LONGEST_LINE, _MOST_BAD = 1 << 20, 100
_BAD_LINE = re.compile(
    r"^(ERROR|Lost atoms)|Signal: |Segmentation fault|Forced restart written|No space left"
)
_NAN = re.compile(r"(?i)(?:^|\s)[-+]?(?:nan|inf)(?:\s|$)")


@dataclass(slots=True)
class _Seen:
    """What a screen says.

    Attributes:
        bad: the first lines that report a failure.
        ended: whether it holds the end mark.
        last: the last line; None without any.
        not_a_number: the first line with a not-a-number, "" without one.
    """

    bad: list[str] = field(default_factory=list)
    ended: bool = False
    last: str | None = None
    not_a_number: str = ""


def _read_screen(path: Path) -> _Seen:
    """Look through a screen line by line, for it can be large."""
    seen = _Seen()
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in iter(lambda: file.readline(_LONGEST_LINE), ""):
            seen.last = line.strip()
            seen.ended = seen.ended or seen.last == END_MARK
            if _BAD_LINE.search(line) and len(seen.bad) < _MOST_BAD:
                seen.bad.append(seen.last)
            if not seen.not_a_number and _NAN.search(line):
                silent = line.lstrip().startswith(("#", "print", "fix"))
                seen.not_a_number = "" if silent else seen.last
    return seen


def verify(folder: Path, deck: str, code: int) -> None:
    """Raises LiggghtsError with the evidence, unless the run of `deck` really finished.

    `code` is its exit code. A finished run has printed `END_MARK`, no error and no not-a-number.
    """
    where, seen = f"{folder / deck}", _read_screen(folder / SCREEN)
    if code == 0 and not seen.bad and seen.ended:
        if seen.not_a_number:
            raise LiggghtsError(
                f"{where}: not-a-number in the output ({seen.not_a_number[:80]!r}); "
                "lower run.time_step_factor and start over with --force or another --out"
            )
        return
    bad = seen.bad
    last = f"the last line is {seen.last!r}" if seen.last is not None else "no output"
    evidence = bad[0] if bad else last
    if disk_is_full(folder):
        evidence = f"the disk is full ({evidence})"
    state = f"ended by signal {-code}" if code < 0 else f"exit {code}"
    finished = "" if bad else f", no {END_MARK} line"
    raise LiggghtsError(
        f"{where}: LIGGGHTS failed ({state}{finished}): {evidence[:200]}; "
        f"see {folder / SCREEN}; {_advice(bad)}"
    )


def _advice(bad: list[str]) -> str:
    """What helps: another case where it would happen again, --resume for causes outside."""
    if any("Lost atoms" in line for line in bad):
        return (
            "spheres were thrown out: lower run.time_step_factor or drag.multiplier, or raise "
            "run.stiffness_N_m, and start over with --force or another --out"
        )
    if any(line.startswith("ERROR") and "No space" not in line for line in bad):
        return (
            "the same deck would fail again: mend the case and start over with --force or "
            "another --out"
        )
    return "mend the cause and continue with --resume"


# ------------------------------------------------------------------------------------------------
# A process of LIGGGHTS: how it is started, watched over and stopped.


LOCK_PATIENCE = 20.0
"""Seconds to wait for processes of an earlier run to end."""
MOST_BYTES = 1 << 29
"""Largest screen or log of a run; a checkpoint takes some 3 kB of either."""
_STOP_SIGNALS = {signal.SIGINT, signal.SIGTERM}


@contextlib.contextmanager
def started(
    folder: Path,
    command: list[str],
    *,
    ranks: int,
    lock: int,
    stdin: IO[bytes] | int,
    stdout: IO[bytes] | int,
) -> Iterator[subprocess.Popen]:
    """A process of LIGGGHTS in `folder` that inherits the `lock` of `only_writer`.

    It is stopped with its children when the `with` block is left by an exception. Raises
    LiggghtsError when it cannot be started.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOP_SIGNALS)
    try:
        process = subprocess.Popen(
            command,
            cwd=folder,
            stdin=stdin,
            stdout=stdout,
            stderr=subprocess.STDOUT,
            env=environment(ranks),
            start_new_session=True,
            pass_fds=(lock,),
            preexec_fn=_prepare_child(ranks, before),
        )
    except OSError as error:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        raise LiggghtsError(f"{command[0]}: cannot be started: {error}") from error
    try:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        yield process
    except BaseException:
        _stop(process)
        raise


@contextlib.contextmanager
def only_writer(folder: Path) -> Iterator[int]:
    """A lock on the folder of a stage that LIGGGHTS inherits.

    It holds until the last process that inherited it has ended. One that MPI started may outlive
    LIGGGHTS by a moment, so this waits for a lock that is taken.
    """
    lock = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT, 0o644)
    deadline = time.monotonic() + LOCK_PATIENCE
    try:
        while not _locked(lock):
            if time.monotonic() > deadline:
                raise LiggghtsError(
                    f"{folder}: a LIGGGHTS of an earlier run is still writing here; "
                    "wait until it ends"
                )
            time.sleep(0.05)
        yield lock
    finally:
        os.close(lock)


def _locked(lock: int) -> bool:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _prepare_child(ranks: int, mask: set[int]) -> Callable[[], None]:
    """What the child does before it becomes LIGGGHTS.

    It asks the kernel to end it when fdnet dies, so that no orphan writes into a resumed run. Then
    it restores `mask`, the signals that were blocked before the start. While the child is being
    started SIGINT and SIGTERM wait: Python would swallow an exception that is raised inside the
    fork, and the run would go on.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    last = signal.SIGKILL if ranks == 1 else signal.SIGTERM

    def prepare() -> None:
        libc.prctl(1, last, 0, 0, 0)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)

    return prepare


def refuse_late(folder: Path, deadline: float | None) -> None:
    """Raises LiggghtsError after `deadline`, s of the monotonic clock."""
    if deadline is not None and time.monotonic() > deadline:
        raise LiggghtsError(
            f"{folder}: LIGGGHTS did not end within its time limit and was stopped; raise "
            "--timeout and continue with --resume"
        )


def refuse_flood(folder: Path) -> None:
    """Raises LiggghtsError when the screen or the log is larger than any sound run makes it."""
    for path in (folder / SCREEN, folder / "log.liggghts"):
        if path.exists() and path.stat().st_size > MOST_BYTES:
            raise LiggghtsError(
                f"{folder}: LIGGGHTS wrote more than {MOST_BYTES >> 20} MiB into {path.name} and "
                "was stopped: it repeats a message without end; read the beginning of the file, "
                "then mend the cause and continue with --resume"
            )


def _stop(process: subprocess.Popen) -> None:
    """End the process and its children, first gently."""
    for end, patience in ((signal.SIGTERM, 5.0), (signal.SIGKILL, 5.0)):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, end)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(patience)
            return


# ------------------------------------------------------------------------------------------------
# The LIGGGHTS binary: where it is, which version it has, and how it is called.


KNOWN_VERSION = "3.8.0"
"""The version that fdnet was measured and tested with."""
LOG = "log.liggghts"
RANKS = "{ranks}"
"""Where a template of a launcher has the number of MPI ranks."""
FEWEST_HANDLES = 64
"""Fewest open files with which LIGGGHTS and MPI start."""
_PROJECT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True, slots=True, kw_only=True)
class Binary:
    """A LIGGGHTS that answers.

    Attributes:
        path: of the binary.
        version: as it prints it.
        launcher: the mpirun that belongs to it; None: one rank only.
        template: words of another launcher, `{ranks}` among them; empty: `launcher` is taken.
    """

    path: Path
    version: str
    launcher: Path | None
    template: tuple[str, ...] = ()

    def command(self, deck: str | None, ranks: int) -> list[str]:
        """The command line for a deck in the current folder; None: for commands on stdin.

        Raises LiggghtsError for several ranks without a launcher.
        """
        source = [] if deck is None else ["-in", deck]
        base = [str(self.path), *source, "-log", LOG]
        stdbuf = shutil.which("stdbuf")
        if ranks == 1:
            return ([stdbuf, "-oL"] if stdbuf else []) + base
        if self.template:
            return [word.replace(RANKS, str(ranks)) for word in self.template] + base
        if self.launcher is None:
            raise LiggghtsError(
                f"--np {ranks}: no mpirun next to {self.path} or on PATH; install openmpi-bin or "
                "use --np 1"
            )
        return [
            str(self.launcher),
            "--allow-run-as-root",
            "--oversubscribe",
            "-np",
            str(ranks),
            *base,
        ]


def find_binary(option: str | None = None, *, launcher: str | None = None) -> Binary:
    """LIGGGHTS from `option`, $FDNET_LIGGGHTS, PATH or the project's .prefix, in that order.

    `launcher` is a template that starts several ranks, for example "srun -n {ranks}".

    Raises LiggghtsError when there is none, when it does not answer like LIGGGHTS, or when the
    launcher is not there; CaseError for a template without `{ranks}`.
    """
    template = _template(launcher)
    given = os.path.expanduser(option or os.environ.get("FDNET_LIGGGHTS") or "")
    places = [given] if given else ["liggghts", str(_PROJECT / ".prefix" / "bin" / "liggghts")]
    _refuse_surroundings()
    hit = next(filter(None, map(shutil.which, places)), None)
    if hit is None:
        raise LiggghtsError(
            f"LIGGGHTS not found (looked for {', '.join(places)}); run scripts/setup.sh, install "
            "the Debian package liggghts, or give its path with --liggghts"
        )
    path = Path(hit).absolute()
    return Binary(path=path, version=_version(path), launcher=_launcher(path), template=template)


def _template(launcher: str | None) -> tuple[str, ...]:
    """The words of a launcher's template. Raises as `find_binary` does."""
    if launcher is None:
        return ()
    try:
        words = tuple(shlex.split(launcher))
    except ValueError as error:
        raise CaseError(f"--launcher {launcher!r}: {error}; quote it as in a shell") from error
    if not any(RANKS in word for word in words):
        raise CaseError(
            f"--launcher {launcher!r}: does not say where the number of ranks goes; write "
            f"{RANKS} there, e.g. 'srun -n {RANKS}'"
        )
    if shutil.which(words[0]) is None:
        raise LiggghtsError(
            f"--launcher {launcher!r}: {words[0]} is not on PATH; load it, or leave the option "
            "out for mpirun"
        )
    return words


def _refuse_surroundings() -> None:
    """Raise LiggghtsError on surroundings in which no LIGGGHTS can run, named by their cause."""
    folder = os.environ.get("TMPDIR")
    if folder and not (os.path.isdir(folder) and os.access(folder, os.W_OK | os.X_OK)):
        raise LiggghtsError(
            f"TMPDIR: {folder} is no folder that can be written to, and temporary files go there; "
            "set TMPDIR to such a folder, or unset it"
        )
    handles = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if 0 <= handles < FEWEST_HANDLES:
        raise LiggghtsError(
            f"ulimit -n: only {handles} files may be open at a time, expected at least "
            f"{FEWEST_HANDLES}; raise the limit with ulimit -n {16 * FEWEST_HANDLES}"
        )


def _launcher(binary: Path) -> Path | None:
    """The mpirun in the folder of the binary, which was built with it, or one on PATH."""
    own = binary.parent / "mpirun"
    if own.exists():
        return own
    hit = shutil.which("mpirun") or shutil.which("orterun")
    return Path(hit) if hit else None


def _version(path: Path) -> str:
    try:
        answer = subprocess.run(
            [str(path), "-h", "-log", "none"],
            capture_output=True,
            timeout=60,
            check=False,
            stdin=subprocess.DEVNULL,
            cwd="/tmp",
            env=environment(1),
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise LiggghtsError(
            f"{path}: cannot be started: {error}; check the file or run scripts/setup.sh"
        ) from error
    text = (answer.stdout + answer.stderr).decode("utf-8", "replace")
    match = re.search(r"Version LIGGGHTS[-A-Z]*\s+([0-9.]+)", text)
    if not match:
        first = text.strip().splitlines()[:1]
        if answer.returncode in (126, 127):
            raise LiggghtsError(
                f"{path}: a program or library that it needs was not found ({first}); check PATH "
                f"({os.environ.get('PATH', '')!r}) and the set-up"
            )
        raise LiggghtsError(
            f"{path}: does not answer like LIGGGHTS (exit {answer.returncode}, {first}); expected "
            f"version {KNOWN_VERSION}, run scripts/setup.sh"
        )
    return match.group(1)


# ------------------------------------------------------------------------------------------------
# Runs of LIGGGHTS: started, followed, stopped, and only accepted when they really finished.


_PART, _LONGEST_OUTPUT_LINE = 1 << 16, 1 << 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Launch:
    """How to run decks.

    Attributes:
        binary: LIGGGHTS.
        ranks: MPI ranks.
        timeout: s, time limit of one deck; None: no limit.
        follow: is called with each new line that LIGGGHTS prints.
    """

    binary: Binary
    ranks: int = 1
    timeout: float | None = None
    follow: Callable[[str], None] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One run that really finished; there is none of a run that did not.

    Attributes:
        directory: folder that it ran in.
        command: command line.
        version: of LIGGGHTS.
        seconds: s, from start to end.
        waited: s of them, in which LIGGGHTS waited for fdnet to compute something.
        ranks: MPI ranks.
    """

    directory: Path
    command: tuple[str, ...]
    version: str
    seconds: float
    ranks: int
    waited: float = 0.0


def run_deck(folder: Path, deck: str, launch: Launch) -> Run:
    """Run `folder/deck` to its end mark.

    Raises LiggghtsError with the evidence when the run did not really finish. On KeyboardInterrupt
    the run is stopped and what it wrote is kept.
    """
    if not (folder / deck).is_file():
        raise LiggghtsError(f"{folder / deck}: deck not found; render it first")
    command, start = launch.binary.command(deck, launch.ranks), time.monotonic()
    deadline = None if launch.timeout is None else start + launch.timeout
    with (
        only_writer(folder) as lock,
        (folder / SCREEN).open("wb") as screen,
        started(
            folder,
            command,
            ranks=launch.ranks,
            lock=lock,
            stdin=subprocess.DEVNULL,
            stdout=screen,
        ) as process,
    ):
        _wait(process, folder / SCREEN, launch.follow, deadline)
    verify(folder, deck, process.returncode)
    seconds = time.monotonic() - start
    return Run(
        directory=folder,
        command=tuple(command),
        version=launch.binary.version,
        seconds=seconds,
        ranks=launch.ranks,
    )


def _wait(
    process: subprocess.Popen,
    screen: Path,
    follow: Callable[[str], None] | None,
    deadline: float | None,
) -> None:
    """Wait until the process has ended, with each line of its screen given to `follow`.

    Raises LiggghtsError after `deadline`, s, and when the screen or the log is flooded.
    """
    with screen.open("rb") as file:
        rest = b""
        while True:
            ended = process.poll() is not None
            part = file.read(_PART)
            *lines, rest = (rest + part).split(b"\n")
            if ended and not part and rest:
                lines, rest = [*lines, rest], b""
            for line in lines:
                refuse_late(screen.parent, deadline)
                if follow:
                    follow(line.rstrip(b"\r").decode(errors="replace"))
            refuse_late(screen.parent, deadline)
            refuse_flood(screen.parent)
            rest = rest[-_LONGEST_OUTPUT_LINE:]
            if not part:
                if ended:
                    return
                time.sleep(0.05)


# ------------------------------------------------------------------------------------------------
# LIGGGHTS fed on its standard input: it takes blocks of commands and waits in between.
#
# fdnet computes something between two blocks and puts it into files, which the next block reads.
# The process ends when its standard input does, so it cannot outlive fdnet.


_FEED_PART, _LONGEST_FEED_LINE = 1 << 16, 1 << 20
_PATIENCE = 0.1
"""Longest time, s, to wait for a line before the process and its time limit are looked at."""


class _EndedError(Exception):
    """LIGGGHTS has ended although more was to come."""


class Feed:
    """A LIGGGHTS that waits for commands; call it with some, and it returns when they are done.

    `busy` are the seconds that it has worked on them.
    """

    def __init__(
        self,
        process: subprocess.Popen,
        folder: Path,
        screen: IO[bytes],
        *,
        follow: Callable[[str], None] | None,
        deadline: float | None,
    ) -> None:
        self.process, self.folder, self.screen = process, folder, screen
        self.follow, self.deadline = follow, deadline
        self.busy, self._fed, self._rest = 0.0, 0, b""

    def __call__(self, *commands: str) -> None:
        """Carry out the commands, in order.

        Raises LiggghtsError after the time limit or when the screen is flooded, and what `follow`
        raises. `run_fed` reports a LIGGGHTS that ends before it has done them.
        """
        self._fed, began = self._fed + 1, time.monotonic()
        mark = f"FDNET fed {self._fed}"
        self._write("".join(f"{line}\n" for line in (*commands, f'print "{mark}"')))
        while mark not in self._lines():
            pass
        self.busy += time.monotonic() - began

    def finish(self) -> None:
        """Let LIGGGHTS print its end mark and end."""
        self._write(f'print "{END_MARK}"\n')
        assert self.process.stdin is not None
        try:
            self.process.stdin.close()
            while True:
                self._lines()
        except (_EndedError, BrokenPipeError):
            self.process.wait()

    def _write(self, text: str) -> None:
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(text.encode())
            self.process.stdin.flush()
        except BrokenPipeError:
            while True:
                self._lines()

    def _lines(self) -> list[str]:
        """What LIGGGHTS has printed next, line by line; each went to `follow` and to the screen.

        Raises _EndedError at the end of its output.
        """
        assert self.process.stdout is not None
        pipe = self.process.stdout.fileno()
        while not select.select([pipe], [], [], _PATIENCE)[0]:
            refuse_late(self.folder, self.deadline)
            if self.process.poll() is not None:  # a daemon of MPI may keep the pipe open
                raise _EndedError
        part = os.read(pipe, _FEED_PART)
        self.screen.write(part)
        *parts, self._rest = (self._rest + part).split(b"\n")
        if not part and self._rest:
            parts, self._rest = [*parts, self._rest], b""
        self._rest = self._rest[-_LONGEST_FEED_LINE:]
        refuse_late(self.folder, self.deadline)
        refuse_flood(self.folder)
        lines = [line.rstrip(b"\r").decode(errors="replace") for line in parts]
        for line in lines:
            if self.follow:
                self.follow(line)
        if not part and not lines:
            raise _EndedError
        return lines


def run_fed(folder: Path, deck: str, launch: Launch, play: Callable[[Feed], None]) -> Run:
    """Run LIGGGHTS in `folder` on the commands that `play` feeds it; `deck` is their main file.

    Raises LiggghtsError with the evidence when the run did not really finish, and what `play`
    raises. LIGGGHTS is stopped then, and what it wrote is kept.
    """
    command, start = launch.binary.command(None, launch.ranks), time.monotonic()
    deadline, waited = None if launch.timeout is None else start + launch.timeout, 0.0
    with (
        only_writer(folder) as lock,
        (folder / SCREEN).open("wb", buffering=0) as screen,
        started(
            folder,
            command,
            ranks=launch.ranks,
            lock=lock,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        ) as process,
    ):
        feed = Feed(process, folder, screen, follow=launch.follow, deadline=deadline)
        try:
            began = time.monotonic()
            play(feed)
            waited = time.monotonic() - began - feed.busy
            feed.finish()
        except _EndedError:
            process.wait()
        finally:
            _close(process)
    verify(folder, deck, process.returncode)  # no run that was cut short gets beyond this
    return Run(
        directory=folder,
        command=tuple(command),
        version=launch.binary.version,
        seconds=time.monotonic() - start,
        ranks=launch.ranks,
        waited=waited,
    )


def _close(process: subprocess.Popen) -> None:
    """Close both ends of the pipes; LIGGGHTS ends at the end of its input."""
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with contextlib.suppress(BrokenPipeError):
                pipe.close()
