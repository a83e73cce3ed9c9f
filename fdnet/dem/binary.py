"""The LIGGGHTS binary: where it is, which version it has, and how it is called."""

import os
import re
import resource
import shlex
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from fdnet.dem.environment import environment
from fdnet.errors import CaseError, LiggghtsError

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
