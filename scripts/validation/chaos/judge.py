"""What became of an attacked run: the result of the uncut one, one refusal, or a fault."""

import csv
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from fdnet.run.folder import OUTPUTS
from validation.chaos.commands import Ended, FaultError
from validation.chaos.runs import (
    NOTES,
    TABLES,
    Prepared,
    contents,
    digest,
    read_results,
    to_go_on,
)

MOST_BYTES = 200 << 20
"""Bytes that one file of an attacked run may have."""
_ENDS = {".png": b"IEND", ".vtp": b"</VTKFile>", ".pvd": b"</VTKFile>", ".html": b"</html>"}


def judge(prepared: Prepared, out: Path, ended: Ended, *, stopped: bool = False) -> str:
    """Returns "ok" or "refused".

    Args:
        prepared: the uncut run.
        out: the attacked folder.
        ended: the command on it.
        stopped: whether a signal was sent to the command, so that it may end by it.

    Raises:
        FaultError: the command did neither.
    """
    if "Traceback" in ended.error:
        raise FaultError(f"traceback: {ended.error.strip().splitlines()[-1]}")
    for path in out.rglob("*"):
        if path.is_file() and path.stat().st_size > MOST_BYTES:
            raise FaultError(f"size: {path.relative_to(out)} has {path.stat().st_size} bytes")
    if ended.code == 0:
        difference = differs(prepared, out)
        if difference:
            raise FaultError(f"silent: {difference}")
        return "ok"
    if stopped and (ended.code == 130 or ended.code < 0):
        return "refused"
    lines = ended.error.strip().splitlines()
    if ended.code not in (2, 3, 4) or len(lines) != 1 or not lines[0].startswith("fdnet: "):
        raise FaultError(f"words: exit code {ended.code} with {len(lines)} lines: {lines[-1:]}")
    return "refused"


def differs(prepared: Prepared, out: Path) -> str:
    """What differs from the uncut run in a finished folder, in words; "" when nothing does."""
    for name in TABLES:
        if not (out / name).exists():
            return f"{name} is missing"
        if digest(out / name) != prepared.tables[name]:
            return f"{name} {_column(prepared.root / 'finished' / name, out / name)}"
    try:
        summary = read_results(out)
    except (OSError, ValueError) as error:
        return f"summary.json cannot be read: {error}"
    keys = [key for key in prepared.summary if summary.get(key) != prepared.summary[key]]
    return f"summary.json: {', '.join(keys)}" if keys else ""


def _column(expected: Path, actual: Path) -> str:
    """The first column that differs."""
    with (
        expected.open(newline="") as one,
        actual.open(newline="", encoding="utf-8", errors="replace") as other,
    ):
        rows = zip(csv.DictReader(one), csv.DictReader(other), strict=False)
        for number, (first, second) in enumerate(rows, 1):
            for name, value in first.items():
                if second.get(name) != value:
                    return f"row {number} column {name}"
    return "has another number of rows"


def check_kept(out: Path, before: Mapping[str, str], *, everything: bool) -> None:
    """Raises FaultError when the user's file, or a file of a run only read, has changed."""
    after = contents(out)
    names = [name for name in before if everything or name == NOTES]
    lost = [name for name in names if after.get(name) != before[name] and name != ".lock"]
    if lost:
        raise FaultError(f"lost: {', '.join(lost)}")


def check_report(out: Path) -> None:
    """Raises FaultError when a file of the report is missing or cut."""
    for name in OUTPUTS["report"]:
        path = out / name
        files = sorted(path.rglob("*")) if path.is_dir() else [path]
        bad = next(_bad(files or [path]), None)
        if bad is not None:
            raise FaultError(f"silent: {bad.relative_to(out)} is missing or cut")


def _bad(files: Iterable[Path]) -> Iterator[Path]:
    for path in files:
        whole = path.is_file() and _ENDS[path.suffix] in path.read_bytes()[-20:]
        if not whole:
            yield path


def finish(prepared: Prepared, out: Path, *options: str) -> str:
    """Continue a run without any hindrance: it must end as the uncut one."""
    resume = to_go_on(out)
    ended = prepared.call(out, *resume, *options)
    if judge(prepared, out, ended) != "ok":
        raise FaultError(f"stuck: {' '.join(ended.error.split())[:200]}")
    return "ok"
