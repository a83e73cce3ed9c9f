"""Every warning of fdnet: what follows from it, what to do, and where to read on."""

import re
import textwrap
import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

PAGE = "docs/reference/warnings.md"
GAP = "…"


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One kind of warning.

    Attributes:
        key: its place on the page.
        text: what it says, with `GAP` for what differs from case to case.
        follows: what follows.
        do: what to do.
        read: page of the documentation.
        says: which of "follows" and "do" the warning says itself.
    """

    key: str
    text: str
    follows: str
    do: str
    read: str
    says: tuple[str, ...] = ()

    def matches(self, warning: str) -> bool:
        """Whether a warning is of this kind; what follows its text is free."""
        pattern = ".*?".join(re.escape(part) for part in self.text.split(GAP))
        return re.match(pattern, warning, re.DOTALL) is not None


@cache
def catalogue() -> tuple[Entry, ...]:
    """All kinds of warnings."""
    text = files("fdnet").joinpath("scales/check/warnings.toml").read_text(encoding="utf-8")
    return tuple(
        Entry(**{**one, "says": tuple(one.get("says", ()))})
        for one in tomllib.loads(text)["warning"]
    )


def entry_of(warning: str) -> Entry | None:
    """The kind of a warning; None for one that is not in the catalogue."""
    return next((entry for entry in catalogue() if entry.matches(warning)), None)


def explained(warning: str) -> str:
    """The warning with what it does not say itself: what follows, what to do, where to read."""
    entry = entry_of(warning)
    if entry is None or warning.endswith(f"{PAGE}#{entry.key})"):
        return warning
    missing = [
        f"{label}: {getattr(entry, name)}"
        for name, label in (("follows", "what follows"), ("do", "what to do"))
        if name not in entry.says
    ]
    return "; ".join([warning.rstrip("."), *missing]) + f" (see {PAGE}#{entry.key})"


def _wrapped(text: str, indent: str = "  ") -> list[str]:
    return textwrap.wrap(text, 97, subsequent_indent=indent, break_on_hyphens=False)


def page() -> str:
    """The page of all warnings."""
    lines = [
        "# Warnings",
        "",
        "This page lists every warning of fdnet: what follows from it, and what to do. A warning",
        "names something that is valid but doubtful, and the run goes on. … stands for what",
        "differs from case to case. What `fdnet check` finds odd about the sizes, the speed and",
        "the supply of a case comes first in the summary; it says all this itself.",
    ]
    for entry in catalogue():
        lines += [
            "",
            f"({entry.key})=",
            f"## {entry.key.replace('-', ' ').capitalize()}",
            "",
            *_wrapped(f"> {entry.text}", "> "),
            "",
            *_wrapped(f"- **What follows:** {entry.follows}."),
            *_wrapped(f"- **What to do:** {entry.do}."),
            f"- **Read:** [{entry.read}](../{entry.read})",
        ]
    return "\n".join(lines) + "\n"
