"""The LIGGGHTS binary: found, started, followed, stopped, and judged. Exit code 0 alone proves nothing."""

import contextlib
import ctypes
import fcntl
import os
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from fdnet.atomic import disk_is_full
from fdnet.errors import LiggghtsError

END_MARK = "DECK_DONE"
SCREEN, LOG = "screen.txt", "log.liggghts"
KNOWN_VERSION = "3.8.0"
LOCK_PATIENCE = 20.0
"""Seconds to wait for processes of an earlier run to end."""
_STOP_SIGNALS = {signal.SIGINT, signal.SIGTERM}
_PROJECT = Path(__file__).resolve().parents[2]
_BAD_LINE = re.compile(
    r"^(ERROR|Lost atoms)|Signal: |Segmentation fault|Forced restart written|No space left"
)
_NAN = re.compile(r"(?i)(?:^|\s)[-+]?(?:nan|inf)(?:\s|$)")


@dataclass(frozen=True, slots=True, kw_only=True)
class Binary:
    """A LIGGGHTS that answers: its path and version, and the MPI launcher that belongs to it (None: serial only)."""

    path: Path
    version: str
    launcher: Path | None

    def command(self, deck: str, ranks: int) -> list[str]:
        """The command line for a deck in the current folder.

        Raises LiggghtsError when several ranks are asked for and there is no launcher.
        """
        base = [str(self.path), "-in", deck, "-log", LOG]
        stdbuf = shutil.which("stdbuf")
        if ranks == 1:
            return ([stdbuf, "-oL"] if stdbuf else []) + base
        if self.launcher is None:
            raise LiggghtsError(
                f"--np {ranks}: no mpirun beside {self.path} or on PATH; install openmpi-bin or use --np 1"
            )
        return [
            str(self.launcher),
            "--allow-run-as-root",
            "--oversubscribe",
            "-np",
            str(ranks),
            *base,
        ]


@dataclass(frozen=True, slots=True, kw_only=True)
class Launch:
    """How to run decks: the binary, MPI ranks, a time limit per deck (s), and who gets each new line of the screen."""

    binary: Binary
    ranks: int = 1
    timeout: float | None = None
    follow: Callable[[str], None] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One finished, verified execution. Exists only if complete."""

    directory: Path
    command: tuple[str, ...]
    version: str
    seconds: float
    ranks: int


def find_binary(option: str | None = None) -> Binary:
    """LIGGGHTS from `option`, $FDNET_LIGGGHTS, PATH or the project's .prefix, in that order.

    Raises LiggghtsError when there is none, or when it does not answer like LIGGGHTS.
    """
    asked = option or os.environ.get("FDNET_LIGGGHTS")
    places = [asked] if asked else ["liggghts", str(_PROJECT / ".prefix" / "bin" / "liggghts")]
    found = next((hit for hit in map(shutil.which, places) if hit), None)
    if found is None:
        raise LiggghtsError(
            f"LIGGGHTS not found (looked for {', '.join(places)}); run scripts/setup.sh, install the "
            "Debian package liggghts, or give its path with --liggghts"
        )
    path = Path(found).absolute()
    beside = path.parent / "mpirun"
    launcher = (
        str(beside) if beside.exists() else (shutil.which("mpirun") or shutil.which("orterun"))
    )
    return Binary(path=path, version=_version(path), launcher=Path(launcher) if launcher else None)


def _version(path: Path) -> str:
    try:
        answer = subprocess.run(
            [str(path), "-h", "-log", "none"],
            capture_output=True,
            timeout=60,
            check=False,
            stdin=subprocess.DEVNULL,
            cwd="/tmp",
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
            f"version {KNOWN_VERSION}, run scripts/setup.sh"
        )
    return match.group(1)


def run_deck(folder: Path, deck: str, launch: Launch) -> Run:
    """Run `folder/deck` to its end mark.

    Raises LiggghtsError with the evidence when the run did not really finish. On KeyboardInterrupt the run is
    stopped and what it wrote is kept.
    """
    if not (folder / deck).is_file():
        raise LiggghtsError(f"{folder / deck}: deck not found; render it first")
    command, start = launch.binary.command(deck, launch.ranks), time.monotonic()
    deadline = None if launch.timeout is None else start + launch.timeout
    with _only_writer(folder) as lock, (folder / SCREEN).open("wb") as screen:
        before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOP_SIGNALS)
        try:
            process = subprocess.Popen(
                command,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=screen,
                stderr=subprocess.STDOUT,
                env=_environment(),
                start_new_session=True,
                pass_fds=(lock,),
                preexec_fn=_prepare_child(launch.ranks, before),
            )
        except OSError as error:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            raise LiggghtsError(f"{command[0]}: cannot be started: {error}") from error
        try:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            _wait(process, folder / SCREEN, launch.follow, deadline)
        except BaseException:
            _stop(process)
            raise
    _verify(folder, deck, process.returncode)
    seconds = time.monotonic() - start
    return Run(
        directory=folder,
        command=tuple(command),
        version=launch.binary.version,
        seconds=seconds,
        ranks=launch.ranks,
    )


@contextlib.contextmanager
def _only_writer(folder: Path) -> Iterator[int]:
    """A lock on the stage's folder that LIGGGHTS inherits: it holds until the last process there has ended.

    Open MPI's daemon of a serial run outlives it by a moment, so a taken lock is waited for.
    """
    lock, deadline = (
        os.open(folder / ".lock", os.O_RDWR | os.O_CREAT, 0o644),
        time.monotonic() + LOCK_PATIENCE,
    )
    try:
        while not _locked(lock):
            if time.monotonic() > deadline:
                raise LiggghtsError(
                    f"{folder}: a LIGGGHTS of an earlier run is still writing here; wait until it ends"
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


def _environment() -> dict[str, str]:
    return os.environ | {
        "OMP_NUM_THREADS": "1",
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    }


def _prepare_child(ranks: int, mask: set[int]) -> Callable[[], None]:
    """The child is ended by the kernel when fdnet dies, so that no orphan writes into a resumed run.

    `mask` are the signals blocked before the start: while it lasts, SIGINT and SIGTERM wait, for an exception raised
    inside the fork is swallowed by Python and the run would go on.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    last = signal.SIGKILL if ranks == 1 else signal.SIGTERM

    def ask() -> None:
        libc.prctl(1, last, 0, 0, 0)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)

    return ask


def _wait(
    process: subprocess.Popen,
    screen: Path,
    follow: Callable[[str], None] | None,
    deadline: float | None,
) -> None:
    with screen.open("r", encoding="utf-8", errors="replace") as lines:
        while True:
            code, partial = process.poll(), lines.tell()
            for line in iter(lines.readline, ""):
                if not line.endswith("\n") and code is None:
                    lines.seek(partial)
                    break
                partial = lines.tell()
                if follow:
                    follow(line.rstrip("\n"))
            if code is not None:
                return
            if deadline is not None and time.monotonic() > deadline:
                raise LiggghtsError(
                    f"{screen.parent}: LIGGGHTS did not end within its time limit and was stopped; "
                    "raise --timeout and continue with --resume"
                )
            time.sleep(0.05)


def _stop(process: subprocess.Popen) -> None:
    for end, patience in ((signal.SIGTERM, 5.0), (signal.SIGKILL, 5.0)):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, end)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(patience)
            return


def _verify(folder: Path, deck: str, code: int) -> None:
    text = (folder / SCREEN).read_text(encoding="utf-8", errors="replace")
    lines = text.splitlines()
    bad = [line.strip() for line in lines if _BAD_LINE.search(line)]
    where = f"{folder / deck}"
    if code == 0 and not bad and any(line.strip() == END_MARK for line in lines):
        numbers = [
            line
            for line in lines
            if _NAN.search(line) and not line.lstrip().startswith(("#", "print", "fix"))
        ]
        if numbers:
            raise LiggghtsError(
                f"{where}: not-a-number in the output ({numbers[0].strip()[:80]!r}); "
                "lower run.time_step_factor and start over with --force or another --out"
            )
        return
    evidence = (
        bad[0] if bad else (f"the last line is {lines[-1].strip()!r}" if lines else "no output")
    )
    if disk_is_full(folder):
        evidence = f"the disk is full ({evidence})"
    state = f"ended by signal {-code}" if code < 0 else f"exit {code}"
    finished = "" if bad else f", no {END_MARK} line"
    raise LiggghtsError(
        f"{where}: LIGGGHTS failed ({state}{finished}): {evidence[:200]}; see {folder / SCREEN}; {_advice(bad)}"
    )


def _advice(bad: list[str]) -> str:
    """What helps: another case for what would happen again, --resume for what came from outside."""
    if any("Lost atoms" in line for line in bad):
        return (
            "spheres were thrown out: lower run.time_step_factor or drag.multiplier, or raise "
            "run.stiffness_N_m, and start over "
            "with --force or another --out"
        )
    if any(line.startswith("ERROR") and "No space" not in line for line in bad):
        return "the same deck would fail again: mend the case and start over with --force or another --out"
    return "mend the cause and continue with --resume"
