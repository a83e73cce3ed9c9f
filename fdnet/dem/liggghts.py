"""Running the LIGGGHTS binary: finding it, starting it, feeding it, and what its end means."""

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
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from fdnet.errors import CaseError, LiggghtsError, cure_of
from fdnet.files import disk_is_full

_ALWAYS = dict.fromkeys(
    ("OMP_NUM_THREADS", "OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"), "1"
)
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
    if ranks > 1:
        return os.environ | _ALWAYS
    # in a job of Slurm a lone Open MPI would look for the job step that these name
    steps = ("SLURM_", "PMI_", "PMIX_")
    own = {name: value for name, value in os.environ.items() if not name.startswith(steps)}
    return own | _ALWAYS | _ALONE


# ---- Whether a run of LIGGGHTS really finished; its exit code 0 alone proves nothing.
END_MARK = "DECK_DONE"  # The last line that a deck prints
SCREEN = "screen.txt"  # File with what LIGGGHTS printed
_LONGEST_LINE, _MOST_BAD = 1 << 20, 100
_BAD_LINE = re.compile(
    r"^(ERROR|Lost atoms)|Signal: |Segmentation fault|Forced restart written|No space left"
)
_NAN = re.compile(r"(?i)(?:^|\s)[-+]?(?:nan|inf)(?:\s|$)")
_ECHOED = ("#", "print", "fix")
"""What lines begin with that LIGGGHTS repeats from the deck."""


def verify(folder: Path, deck: str, code: int) -> None:
    """Raises LiggghtsError with the evidence, unless the run of `deck` really finished.

    `code` is its exit code. A finished run has printed `END_MARK`, no error and no not-a-number.
    """
    bad: list[str] = []
    ended, evidence, not_a_number = False, "no output", ""
    with (folder / SCREEN).open(encoding="utf-8", errors="replace") as file:
        for line in iter(lambda: file.readline(_LONGEST_LINE), ""):
            text = line.strip()
            evidence = f"the last line is {text!r}"
            ended = ended or text == END_MARK
            if _BAD_LINE.search(line) and len(bad) < _MOST_BAD:
                bad.append(text)
            if not not_a_number and _NAN.search(line) and not text.startswith(_ECHOED):
                not_a_number = text
    if code == 0 and not bad and ended:
        if not_a_number:
            raise LiggghtsError(
                f"{folder / deck}: not-a-number in the output ({not_a_number[:80]!r}); "
                "lower run.time_step_factor and start over with --force or another --out"
            )
        return
    evidence = bad[0] if bad else evidence
    evidence = f"the disk is full ({evidence})" if disk_is_full(folder) else evidence
    state = f"ended by signal {-code}" if code < 0 else f"exit {code}"
    finished = "" if bad else f", no {END_MARK} line"
    raise LiggghtsError(
        f"{folder / deck}: LIGGGHTS failed ({state}{finished}): {evidence[:200]}; "
        f"see {folder / SCREEN}; {_advice(bad)}"
    )


def _advice(bad: list[str]) -> str:
    """What helps: another case where it would happen again, --resume for causes outside."""
    anew = "and start over with --force or another --out"
    if any("Lost atoms" in line for line in bad):
        change = "lower run.time_step_factor or drag.multiplier, or raise run.stiffness_N_m"
        return f"spheres were thrown out: {change}, {anew}"
    if any(line.startswith("ERROR") and "No space" not in line for line in bad):
        return f"the same deck would fail again: mend the case {anew}"
    return "mend the cause and continue with --resume"


# ---- A process of LIGGGHTS: how it is started, watched over and stopped.
LOCK_PATIENCE = 20.0  # Seconds to wait for processes of an earlier run to end
MOST_BYTES = 1 << 29  # Largest screen or log of a run; a checkpoint takes some 3 kB of either


@contextlib.contextmanager
def started(
    folder: Path, command: list[str], *, ranks: int, fed: bool
) -> Iterator[subprocess.Popen]:
    """A process of LIGGGHTS in `folder`; its output is a pipe, its input too where it is `fed`.

    It inherits a lock on the folder, which holds until the last process that inherited it has
    ended. One that MPI started may outlive LIGGGHTS by a moment, so this waits for a lock that is
    taken. The process is stopped with its children, first gently, when the `with` block is left by
    an exception. Raises LiggghtsError when it cannot be started.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    last = signal.SIGKILL if ranks == 1 else signal.SIGTERM
    deadline = time.monotonic() + LOCK_PATIENCE
    lock = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT, 0o644)
    try:
        while True:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except OSError:
                if time.monotonic() > deadline:
                    raise LiggghtsError(
                        f"{folder}: a LIGGGHTS of an earlier run is still writing here; wait "
                        "until it ends"
                    ) from None
                time.sleep(0.05)
        # while the child is being started SIGINT and SIGTERM wait: Python would swallow an
        # exception that is raised inside the fork, and the run would go on
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})

        def prepare() -> None:
            """Let the kernel end the child when fdnet dies, so that no orphan writes on."""
            libc.prctl(1, last, 0, 0, 0)
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

        try:
            process = subprocess.Popen(
                command,
                cwd=folder,
                stdin=subprocess.PIPE if fed else subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                env=environment(ranks),
                start_new_session=True,
                pass_fds=(lock,),
                preexec_fn=prepare,
            )
        except OSError as error:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            raise LiggghtsError(f"{command[0]}: cannot be started: {error}") from error
        try:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            yield process
        except BaseException:
            for end in (signal.SIGTERM, signal.SIGKILL):
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, end)
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(5.0)
                    break
            raise
    finally:
        os.close(lock)


# ---- The LIGGGHTS binary: where it is, which version it has, and how it is called.
KNOWN_VERSION = "3.8.0"  # The version that fdnet was measured and tested with
LOG = "log.liggghts"
RANKS = "{ranks}"  # Where a template of a launcher has the number of MPI ranks
FEWEST_HANDLES = 64  # Fewest open files with which LIGGGHTS and MPI start
_PROJECT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True, slots=True, kw_only=True)
class Binary:
    """A LIGGGHTS that answers."""

    path: Path
    version: str  # as it prints it
    # words that start several ranks, `{ranks}` among them; None: one rank only
    launcher: tuple[str, ...] | None

    def command(self, deck: str | None, ranks: int) -> list[str]:
        """The command line for a deck in the current folder; None: for commands on stdin.

        Raises LiggghtsError for several ranks without a launcher.
        """
        source = [] if deck is None else ["-in", deck]
        base = [str(self.path), *source, "-log", LOG]
        if ranks == 1:
            stdbuf = shutil.which("stdbuf")
            return ([stdbuf, "-oL"] if stdbuf else []) + base
        if self.launcher is None:
            raise LiggghtsError(
                f"--np {ranks}: no mpirun next to {self.path} or on PATH; install openmpi-bin or "
                "use --np 1"
            )
        return [word.replace(RANKS, str(ranks)) for word in self.launcher] + base


def find_binary(option: str | None = None, *, launcher: str | None = None) -> Binary:
    """LIGGGHTS from `option`, $FDNET_LIGGGHTS, PATH or the project's .prefix, in that order.

    `launcher` is a template that starts several ranks, for example "srun -n {ranks}".

    Raises LiggghtsError when there is none, when it does not answer like LIGGGHTS, or when the
    launcher is not there; CaseError for a template without `{ranks}`.
    """
    words = _template(launcher)
    given = os.path.expanduser(option or os.environ.get("FDNET_LIGGGHTS") or "")
    places = [given] if given else ["liggghts", str(_PROJECT / ".prefix" / "bin" / "liggghts")]
    scratch = os.environ.get("TMPDIR")
    if scratch and not (os.path.isdir(scratch) and os.access(scratch, os.W_OK | os.X_OK)):
        raise LiggghtsError(
            f"TMPDIR: {scratch} is no folder that can be written to, and temporary files go "
            "there; set TMPDIR to such a folder, or unset it"
        )
    handles = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if 0 <= handles < FEWEST_HANDLES:
        raise LiggghtsError(
            f"ulimit -n: only {handles} files may be open at a time, expected at least "
            f"{FEWEST_HANDLES}; raise the limit with ulimit -n {16 * FEWEST_HANDLES}"
        )
    hit = next(filter(None, map(shutil.which, places)), None)
    if hit is None:
        raise LiggghtsError(
            f"LIGGGHTS not found (looked for {', '.join(places)}); run scripts/setup.sh, install "
            "the Debian package liggghts, or give its path with --liggghts"
        )
    path = Path(hit).absolute()
    own = path.parent / "mpirun"  # the binary was built with it
    mpirun = str(own) if own.exists() else shutil.which("mpirun") or shutil.which("orterun")
    if words is None and mpirun:
        words = mpirun, "--allow-run-as-root", "--oversubscribe", "-np", RANKS
    return Binary(path=path, version=_version(path), launcher=words)


def _template(launcher: str | None) -> tuple[str, ...] | None:
    """The words of a launcher's template. Raises as `find_binary` does."""
    if launcher is None:
        return None
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
        raise LiggghtsError(
            f"{path}: does not answer like LIGGGHTS (exit {answer.returncode}, {first}); expected "
            f"version {KNOWN_VERSION}, with all programs and libraries that it needs; run "
            "scripts/setup.sh"
        )
    return match.group(1)


# ------------------------------------------------------------------------------------------------
# Runs of LIGGGHTS: started, followed, stopped, and only accepted when they really finished.
#
# One that is fed takes blocks of commands on its standard input and waits in between. fdnet
# computes something then and puts it into files, which the next block reads. The process ends when
# its standard input does, so it cannot outlive fdnet.


_PART, _LONGEST_OUTPUT_LINE = 1 << 16, 1 << 20
_PATIENCE = 0.1
"""Longest time, s, to wait for a line before the process and its time limit are looked at."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Launch:
    """How to run decks."""

    binary: Binary
    ranks: int = 1  # MPI ranks
    # s of the monotonic clock, when LIGGGHTS is stopped; None: never
    deadline: float | None = None
    # is called with each new line that LIGGGHTS prints
    follow: Callable[[str], None] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Execution:
    """One run that really finished; there is none of a run that did not."""

    directory: Path  # folder that it ran in
    command: tuple[str, ...]
    version: str  # of LIGGGHTS
    seconds: float  # s, from start to end
    ranks: int
    waited: float = 0.0  # s, in which LIGGGHTS waited for fdnet to compute something
    cpu_seconds: float = 0.0  # s of processors, user and system, of LIGGGHTS on all ranks
    # largest resident memory of LIGGGHTS; None on several ranks
    peak_memory_bytes: int | None = None


class _EndedError(Exception):
    """LIGGGHTS has ended although more was to come."""


@dataclass(slots=True, eq=False, kw_only=True)
class Feed:
    """A LIGGGHTS that waits for commands; call it with some, and it returns when they are done."""

    process: subprocess.Popen
    folder: Path  # that it runs in
    screen: IO[bytes]  # takes what it prints
    launch: Launch  # how it was started
    busy: float = 0.0  # s, that it has worked on the commands
    waited: float = 0.0  # s, in between
    # what the process and its children used, known when it has ended
    usage: resource.struct_rusage | None = None
    peak_memory_bytes: int = 0  # largest resident memory of the process so far
    _fed: int = 0
    _rest: bytes = b""

    def __call__(self, *commands: str) -> None:
        """Carry out the commands, in order.

        Raises LiggghtsError after the time limit or when the screen is flooded, and what `follow`
        raises. `run_deck` reports a LIGGGHTS that ends before it has done them.
        """
        self._fed, began = self._fed + 1, time.monotonic()
        mark = f"FDNET fed {self._fed}"
        self._write("".join(f"{line}\n" for line in (*commands, f'print "{mark}"')))
        while mark not in self._lines():
            pass
        self.busy += time.monotonic() - began

    def play(self, play: Callable[["Feed"], None] | None) -> None:
        """Let `play` feed LIGGGHTS, if it is fed, and print its end mark; wait until it has ended.

        Raises as `run_deck` does.
        """
        try:
            if play is not None:
                began = time.monotonic()
                play(self)
                self.waited = time.monotonic() - began - self.busy
                self._write(f'print "{END_MARK}"\n')
                assert self.process.stdin is not None
                with contextlib.suppress(BrokenPipeError):
                    self.process.stdin.close()
            while True:
                self._lines()
        except _EndedError:
            while not self._ended():  # it may close its output before
                self._refuse()
                time.sleep(0.02)

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
            self._refuse()
            # a daemon of MPI may keep the pipe open; the last words may have come just now
            if self._ended() and not select.select([pipe], [], [], 0.0)[0]:
                raise _EndedError
        self.peak_memory_bytes = max(self.peak_memory_bytes, peak_resident_bytes(self.process.pid))
        part = os.read(pipe, _PART)
        try:
            self.screen.write(part)
        except OSError as error:
            raise LiggghtsError(
                f"{self.folder / SCREEN}: what LIGGGHTS prints cannot be written "
                f"({error.strerror}), so it was stopped; {cure_of(error)} and continue with "
                "--resume"
            ) from error
        *parts, self._rest = (self._rest + part).split(b"\n")
        if not part and self._rest:
            parts, self._rest = [*parts, self._rest], b""
        self._rest = self._rest[-_LONGEST_OUTPUT_LINE:]
        self._refuse()
        lines = [line.rstrip(b"\r").decode(errors="replace") for line in parts]
        for line in lines:
            self._refuse_late()
            if self.launch.follow:
                self.launch.follow(line)
        if not part and not lines:
            raise _EndedError
        return lines

    def _ended(self) -> bool:
        """Whether the process has ended; the kernel then says once what it used."""
        if self.process.returncode is None:
            pid, status, usage = os.wait4(self.process.pid, os.WNOHANG)
            if pid:
                self.process.returncode = os.waitstatus_to_exitcode(status)
                self.usage = usage
        return self.process.returncode is not None

    def _refuse_late(self) -> None:
        if self.launch.deadline is not None and time.monotonic() > self.launch.deadline:
            raise LiggghtsError(
                f"{self.folder}: LIGGGHTS did not end within its time limit and was stopped; "
                "raise --timeout and continue with --resume"
            )

    def _refuse(self) -> None:
        """Raise LiggghtsError after the time limit, or when the screen or the log is flooded."""
        self._refuse_late()
        for path in (self.folder / SCREEN, self.folder / LOG):
            if path.exists() and path.stat().st_size > MOST_BYTES:
                raise LiggghtsError(
                    f"{self.folder}: LIGGGHTS wrote more than {MOST_BYTES >> 20} MiB into "
                    f"{path.name} and was stopped: it repeats a message without end; read the "
                    "beginning of the file, then mend the cause and continue with --resume"
                )


def peak_resident_bytes(process: int | str = "self") -> int:
    """Largest resident memory, bytes, of a process since its program began; 0 if unknown.

    That of getrusage also counts what a process had as a copy of its parent.
    """
    try:
        lines = Path(f"/proc/{process}/status").read_text(encoding="utf-8").splitlines()
    except OSError:
        return 0
    return next((1024 * int(line.split()[1]) for line in lines if line.startswith("VmHWM")), 0)


def run_deck(
    folder: Path, deck: str, launch: Launch, play: Callable[[Feed], None] | None = None
) -> Execution:
    """Run `folder/deck` to its end mark, or the commands that `play` feeds LIGGGHTS instead.

    Raises LiggghtsError with the evidence when the run did not really finish, and what `play`
    raises. LIGGGHTS is stopped then, as on KeyboardInterrupt, and what it wrote is kept.
    """
    if play is None and not (folder / deck).is_file():
        raise LiggghtsError(f"{folder / deck}: deck not found; render it first")
    command = launch.binary.command(deck if play is None else None, launch.ranks)
    start = time.monotonic()
    with (
        started(folder, command, ranks=launch.ranks, fed=play is not None) as process,
        (folder / SCREEN).open("wb", buffering=0) as screen,
    ):
        feed = Feed(process=process, folder=folder, screen=screen, launch=launch)
        try:
            feed.play(play)
        finally:
            for pipe in filter(None, (process.stdin, process.stdout)):
                with contextlib.suppress(BrokenPipeError):
                    pipe.close()
    verify(folder, deck, process.returncode)  # no run that was cut short gets beyond this
    return Execution(
        directory=folder,
        command=tuple(command),
        version=launch.binary.version,
        seconds=time.monotonic() - start,
        ranks=launch.ranks,
        waited=feed.waited,
        cpu_seconds=feed.usage.ru_utime + feed.usage.ru_stime if feed.usage else 0.0,
        peak_memory_bytes=feed.peak_memory_bytes if launch.ranks == 1 else None,
    )
