"""Whether a run of LIGGGHTS really finished; its exit code 0 alone proves nothing."""

import re
from dataclasses import dataclass, field
from pathlib import Path

from fdnet.errors import LiggghtsError
from fdnet.files.atomic import disk_is_full

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
