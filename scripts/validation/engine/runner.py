"""Runs the points of a study, keeps each when it is done, and continues an earlier session."""

import contextlib
import fcntl
import hashlib
import json
import os
import resource
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Self

from fdnet.errors import CaseError, FdnetError, LiggghtsError
from validation.engine.children import Send, end_children, start_child
from validation.engine.study import COSTS, DONE, Measured, Point, Study

POINTS, WORK = "points.jsonl", "work"
OVER_TIME, OVER_MEMORY, FAILED = "over time", "over memory", "failed"
NAN = float("nan")
Measure = Callable[[Point, Path], Mapping[str, float]]


def run_points(
    study: Study, out: Path, *, quick: bool, report: Callable[[str], None] = lambda _: None
) -> list[Measured]:
    """All points of the study's form, measured.

    Points that an earlier session recorded in `out` are not run again unless they failed. A point
    that is refused, fails or exceeds its limits is recorded with that status.

    Args:
        study: what to run.
        out: folder of the record.
        quick: the reduced form.
        report: gets a line after each point, with an estimate of the time left.

    Raises:
        CaseError: `out` holds something else, or another session writes there.
    """
    points = study.points(quick)
    keys = [point.key for point in points]
    assert len(set(keys)) == len(keys), f"study {study.name}: a point appears twice"
    owner = {
        "study": study.name,
        "form": "quick" if quick else "full",
        "inputs": _digest(study.inputs()),
    }
    with _Record(out, owner) as record:
        return _run_all(study, points, record, quick=quick, report=report)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _run_all(
    study: Study,
    points: Sequence[Point],
    record: "_Record",
    *,
    quick: bool,
    report: Callable[[str], None],
) -> list[Measured]:
    known, work = record.known(points), record.path.parent / WORK
    todo = [point for point in points if point.key not in known]
    if len(known):
        report(f"{len(known)} of {len(points)} points are there already")
    start = time.monotonic()
    for number, point in enumerate(todo, 1):
        known[point.key] = measured = _measure(study, point, work, quick=quick)
        record.add(measured)
        left = (time.monotonic() - start) / number * (len(todo) - number)
        report(
            f"{len(known)} of {len(points)}: {point.key}: "
            f"{measured.status}, {measured.wall_s:.1f} s{eta(left)}"
        )
    shutil.rmtree(work, ignore_errors=True)
    return [known[point.key] for point in points]


def eta(seconds: float) -> str:
    """The time left in words, to end a line; nothing at 0."""
    return (
        f", about {seconds / 60:.0f} min left"
        if seconds >= 60
        else (f", about {seconds:.0f} s left" if seconds else "")
    )


class _Record:
    """The file of measured points: a first line that names the study, then one line a point."""

    def __init__(self, out: Path, owner: Mapping[str, str]) -> None:
        self.path, self.owner = out / POINTS, dict(owner)
        if out.exists() and not out.is_dir():
            raise CaseError(
                f"{out}: is a file, expected a folder for the study; give another --out"
            )
        if out.exists() and any(out.iterdir()) and not self.path.exists():
            raise CaseError(
                f"{out}: holds no study (no {POINTS}); give an empty or new folder with --out"
            )
        out.mkdir(parents=True, exist_ok=True)
        self.lock = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o644)

    def __enter__(self) -> Self:
        try:
            fcntl.flock(self.lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(self.lock)
            raise CaseError(
                f"{self.path}: another session of this study is writing here; wait for it"
            ) from error
        if not self.path.stat().st_size:
            self.path.write_text(json.dumps(self.owner) + "\n", encoding="utf-8")
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self.lock)

    def known(self, points: Sequence[Point]) -> dict[str, Measured]:
        """Recorded points by key, without those that failed and are to be run again.

        An unfinished last line is cut off; records of other points stay in the file.
        """
        text = self.path.read_text(encoding="utf-8", errors="replace")
        whole = text[: text.rfind("\n") + 1]
        lines = [self._line(number, line) for number, line in enumerate(whole.splitlines(), 1)]
        if not lines or lines[0] != self.owner:
            owner = lines[0] if lines else "nothing"
            raise CaseError(
                f"{self.path}: belongs to {owner}, expected {self.owner}; give another --out"
            )
        if whole != text:
            self.path.write_text(whole, encoding="utf-8")
        by_key = {point.key: point for point in points}
        return {
            line["key"]: Measured(point=by_key[line["key"]], **_numbers(line))
            for line in lines[1:]
            if line["key"] in by_key and not str(line["status"]).startswith(FAILED)
        }

    def _line(self, number: int, text: str) -> dict:
        try:
            line = json.loads(text)
        except ValueError:
            line = None
        if not isinstance(line, dict) or (number > 1 and not {"key", "status"} <= set(line)):
            raise CaseError(
                f"{self.path}:{number}: is no record of a point; "
                "remove the line, or give another --out"
            )
        return line

    def add(self, measured: Measured) -> None:
        fields = asdict(measured)
        fields.pop("point")
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"key": measured.point.key, **fields}) + "\n")
            file.flush()
            os.fsync(file.fileno())


def _numbers(line: Mapping[str, object]) -> dict:
    return {name: value for name, value in line.items() if name != "key"}


def _measure(study: Study, point: Point, work: Path, *, quick: bool) -> Measured:
    work.mkdir(parents=True, exist_ok=True)
    isolated = study.isolated(point) if callable(study.isolated) else study.isolated
    if quick or not isolated:
        return _attempt(study.measure, point, work)
    start = time.monotonic()
    child = start_child(_limited_attempt, study.measure, point, work, (study.seconds, study.bytes))
    try:
        child.answers.recv()
        start = time.monotonic()
        if child.answers.poll(study.seconds):
            return child.answers.recv()
        return _nothing(point, OVER_TIME, time.monotonic() - start)
    except EOFError:
        child.process.join()
        status = f"{FAILED}: its process ended with exit code {child.process.exitcode}"
        return _nothing(point, status, time.monotonic() - start)
    finally:
        end_children([child])


def _limited_attempt(
    measure: Measure, point: Point, work: Path, limits: tuple[float, float], send: Send
) -> None:
    """Sends "ready", then the measurement; the memory of this process is limited."""
    seconds, most = limits
    resource.setrlimit(resource.RLIMIT_AS, (int(most), int(most)))
    send("ready")
    result = _attempt(measure, point, work)
    late = result.status == DONE and result.wall_s > seconds
    send(replace(result, status=OVER_TIME, observed={}) if late else result)


def _attempt(measure: Measure, point: Point, work: Path) -> Measured:
    """One measurement with its costs.

    What fdnet refuses becomes a status; a fault of the study itself is raised.
    """
    forget_peak()
    wall, core = time.monotonic(), core_seconds()
    try:
        observed = dict(measure(point, work))
        status = DONE
    except FdnetError as error:
        observed, status = {}, _why(error, work)
    except MemoryError:
        observed, status = {}, OVER_MEMORY
    costs = {
        "wall_s": time.monotonic() - wall,
        "core_s": core_seconds() - core,
        "steps": NAN,
        "peak_memory_bytes": peak_memory(),
    }
    costs |= {name: observed.pop(name) for name in COSTS if name in observed}
    return Measured(point=point, status=status, observed=observed, **costs)


def _why(error: FdnetError, work: Path) -> str:
    """What fdnet refused or how LIGGGHTS failed, without the advice and without the folder."""
    message = " ".join(str(error).split()).replace(f"{work}/", "").split("; ")[0]
    return f"{FAILED if isinstance(error, LiggghtsError) else 'refused'}: {message}"


def _nothing(point: Point, status: str, wall: float) -> Measured:
    return Measured(
        point=point,
        status=status,
        observed={},
        wall_s=wall,
        core_s=NAN,
        steps=NAN,
        peak_memory_bytes=NAN,
    )


def core_seconds() -> float:
    """CPU seconds, user and system, of this process and of the children it has waited for."""
    usages = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def child_core_seconds() -> float:
    """CPU seconds, user and system, of the children this process has waited for."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def forget_peak() -> None:
    """Restarts `peak_memory` of this process from what it holds now, where the system can."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def peak_memory() -> float:
    """Largest resident memory so far, bytes, of this process or of one child.

    The memory of this process is counted by the kernel since the start of the program, because
    getrusage also counts what the process had as a copy of its parent.
    """
    status = Path("/proc/self/status")
    lines = status.read_text().splitlines() if status.exists() else []
    own = next((float(line.split()[1]) for line in lines if line.startswith("VmHWM")), 0.0)
    own = own or resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return 1024.0 * max(own, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
