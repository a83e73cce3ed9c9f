"""Whether a run of LIGGGHTS really finished; its exit code 0 alone proves nothing."""

import re
from pathlib import Path

from fdnet.atomic import disk_is_full
from fdnet.errors import LiggghtsError

END_MARK = "DECK_DONE"
"""The last line that a deck prints."""
SCREEN = "screen.txt"
"""File with what LIGGGHTS printed."""
_BAD_LINE = re.compile(
    r"^(ERROR|Lost atoms)|Signal: |Segmentation fault|Forced restart written|No space left"
)
_NAN = re.compile(r"(?i)(?:^|\s)[-+]?(?:nan|inf)(?:\s|$)")


def verify(folder: Path, deck: str, code: int) -> None:
    """Raises LiggghtsError with the evidence, unless the run of `deck` really finished.

    `code` is its exit code. A finished run has printed `END_MARK`, no error and no not-a-number.
    """
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
