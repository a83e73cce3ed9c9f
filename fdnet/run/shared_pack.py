"""A pack that several runs share: made once, and copied into each of them."""

import shlex
import shutil
from pathlib import Path
from typing import Any

from fdnet.errors import CaseError
from fdnet.run.made_files import START_OVER, check_files
from fdnet.run.mark import LOCK, RECORDS
from fdnet.run.record_files import read_record
from fdnet.run.records import ranks_of
from fdnet.run.session import Session


def take_pack(session: Session, source: Path) -> None:
    """Copy the finished pack of the run folder `source`, as if this run had made it.

    Its record counts no seconds of LIGGGHTS, which belong to the run that made the pack.

    Raises CaseError when `source` holds no finished pack, or one of another case, seed or number
    of ranks, or when its files are not those that the stage made.
    """
    record = read_record(source, "pack")
    if record is None:
        raise CaseError(
            f"--pack-from {source}: holds no finished pack; make it with fdnet run CASE.toml "
            f"--stages pack --out {shlex.quote(str(source))}"
        )
    _refuse_other(session, source, record)
    check_files(source / "pack", record, START_OVER)
    with session.timed("pack"):
        shutil.copytree(
            source / "pack",
            session.path / "pack",
            ignore=shutil.ignore_patterns(LOCK, Path(RECORDS["pack"]).name),
            dirs_exist_ok=True,
        )
    session.folder.finish("pack", _taken(record, source, session.seconds["pack"]))


def _refuse_other(session: Session, source: Path, record: dict[str, Any]) -> None:
    if record["digest"] != session.case.digest("pack"):
        raise CaseError(
            f"--pack-from {source}: its pack is that of another case or seed (digest "
            f"{record['digest']}, this case {session.case.digest('pack')}); leave the option out"
        )
    if ranks_of(record) != session.options.ranks:
        raise CaseError(
            f"--pack-from {source}: its pack was made with --np {ranks_of(record)}, this run has "
            f"--np {session.options.ranks}, which would give another pack; use the same number"
        )


def _taken(record: dict[str, Any], source: Path, seconds: float) -> dict[str, Any]:
    """The record of the copy; the time that it took to make is kept apart."""
    return record | {
        "seconds": seconds,
        "taken_from": str(source),
        "made_in_seconds": record["seconds"],
        "runs": [row | {"seconds": 0.0} for row in record["runs"]],
        "attempts": [row | {"liggghts_s": 0.0} for row in record["attempts"]],
    }
