"""A case looked at: all that is odd, and what the run takes."""

import textwrap
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

from fdnet.case.case import Case
from fdnet.scales.check.catalogue import PAGE, entry_of
from fdnet.scales.check.finding import Finding
from fdnet.scales.check.findings import findings
from fdnet.scales.cost import Cost, cost_of, peak_memory
from fdnet.scales.scales import Scales
from fdnet.scales.times import spoken_memory, spoken_time

_WIDTH = 96


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """What is odd about a case, and what it takes.

    Attributes:
        name: of the case.
        findings: what is odd; what `fdnet run` refuses comes first.
        cost: of the run.
        memory: bytes at most, of one process.
    """

    name: str
    findings: tuple[Finding, ...]
    cost: Cost
    memory: float

    def data(self) -> dict[str, Any]:
        """As plain values."""
        return {
            "case": self.name,
            "findings": [asdict(one) for one in self.findings],
            "seconds": self.cost.seconds,
            "seconds_pack": self.cost.pack_seconds,
            "seconds_invade": self.cost.invade_seconds,
            "seconds_analyse": self.cost.analyse_seconds,
            "time": spoken_time(self.cost.seconds),
            "memory_bytes": self.memory,
        }

    def lines(self) -> list[str]:
        """As text."""
        count = len(self.findings)
        plural = "" if count == 1 else "s"
        head = f"{self.name}: {count} thing{plural} to look at" if count else f"{self.name}: fine"
        rows = [*(line for one in self.findings for line in _finding(one)), *self._takes()]
        return [head, *(line for row in rows for line in _wrapped(row))]

    def _takes(self) -> list[str]:
        cost = self.cost
        parts = f"pack {spoken_time(cost.pack_seconds)}"
        if cost.invade_seconds:
            parts += f", invasion {spoken_time(cost.invade_seconds)}"
        if cost.update_seconds:
            parts += f" ({spoken_time(cost.update_seconds)} of them for the flow)"
        parts += f", analysis and report {spoken_time(cost.analyse_seconds)}"
        return [
            f"time: {spoken_time(cost.seconds)} on one idle core, within a factor of 2 ({parts})",
            f"memory: {spoken_memory(self.memory)}",
        ]


def checked(case: Case, scales: Scales, refusals: Iterable[str] = ()) -> Checked:
    """All that is odd about a case; `refusals` are why `fdnet run` would not take it."""
    refused = [
        Finding(
            key=text.split(":")[0],
            what=text,
            follows="fdnet run refuses the case",
            do="",
            read="",
            refused=True,
        )
        for text in refusals
    ]
    return Checked(
        name=case.name,
        findings=(*refused, *every_finding(case, scales)),
        cost=cost_of(case, scales),
        memory=peak_memory(case, scales),
    )


def every_finding(case: Case, scales: Scales) -> list[Finding]:
    """All that is odd about a case: what `fdnet check` says, and the summary of its run."""
    return [*findings(case, scales), *map(_of_warning, scales.warnings)]


def _of_warning(text: str) -> Finding:
    entry = entry_of(text)
    if entry is None:
        return Finding(key="", what=text, follows="", do="", read=PAGE)
    return Finding(
        key="", what=text, follows=entry.follows, do=entry.do, read=f"{PAGE}#{entry.key}"
    )


def _finding(finding: Finding) -> list[str]:
    what = finding.what
    key = f"{finding.key}: " if finding.key and not what.startswith(finding.key) else ""
    rows = (("what follows", finding.follows), ("what to do", finding.do), ("read", finding.read))
    return [f"warning: {key}{what}", *(f"    {name}: {text}" for name, text in rows if text)]


def _wrapped(row: str) -> list[str]:
    return textwrap.wrap(
        row, _WIDTH, subsequent_indent=" " * 8, break_on_hyphens=False, break_long_words=False
    )
