"""Warnings: each is raised as a `Doubt`, a text with its kind.

`warnings.toml` has, for every kind, what follows from it, what to do, and where to read on.
"""

import textwrap
import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

PAGE = "docs/reference/warnings.md"
GAP = "…"


class Doubt(str):
    """A warning: its text, to be used as any other text, with the key of `warnings.toml`."""

    kind: str

    def __new__(cls, kind: str, text: str) -> "Doubt":
        doubt = super().__new__(cls, text)
        doubt.kind = kind
        return doubt

    def __getnewargs__(self) -> tuple[str, str]:  # type: ignore[override]
        return self.kind, str(self)


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


@cache
def catalogue() -> dict[str, Entry]:
    """All kinds of warnings by their keys."""
    text = files("fdnet").joinpath("warnings.toml").read_text(encoding="utf-8")
    rows = tomllib.loads(text)["warning"]
    return {one["key"]: Entry(**one | {"says": tuple(one.get("says", ()))}) for one in rows}


def explained(warning: str) -> str:
    """The warning with what it does not say itself: what follows, what to do, where to read.

    A text that is no `Doubt` stays as it is.
    """
    if not isinstance(warning, Doubt):
        return warning
    entry = catalogue()[warning.kind]
    missing = [
        f"{label}: {getattr(entry, name)}"
        for name, label in (("follows", "what follows"), ("do", "what to do"))
        if name not in entry.says
    ]
    return "; ".join([warning.rstrip("."), *missing]) + f" (see {PAGE}#{entry.key})"


def page() -> str:
    """The page of all warnings."""

    def filled(text: str, indent: str = "  ") -> list[str]:
        return textwrap.wrap(text, 97, subsequent_indent=indent, break_on_hyphens=False)

    lines = [
        "# Warnings",
        "",
        "This page lists every warning of fdnet: what follows from it, and what to do. A warning",
        "names something that is valid but doubtful, and the run goes on. … stands for what",
        "differs from case to case. What `fdnet check` finds odd about the sizes, the speed and",
        "the supply of a case comes first in the summary; it says all this itself.",
    ]
    for key, entry in catalogue().items():
        lines += [
            "",
            f"({key})=",
            f"## {key.replace('-', ' ').capitalize()}",
            "",
            *filled(f"> {entry.text}", "> "),
            "",
            *filled(f"- **What follows:** {entry.follows}."),
            *filled(f"- **What to do:** {entry.do}."),
            f"- **Read:** [{entry.read}](../{entry.read})",
        ]
    return "\n".join(lines) + "\n"
