"""Markdown of the pages: tables, numbers, and source lines below 100 characters."""

import math
import re
from collections.abc import Iterable, Iterator, Sequence

from fdnet.statistics.bands import Band
from validation.engine.bands import ROUNDING

NONE = "–"
WIDTH = 99
_UNBREAKABLE = re.compile(r"!?\[[^\]]*\]\([^)]*\)\S*|(?:[^\s`]*`[^`]*`)+[^\s`]*|\S+")
_MARKER = re.compile(r"(\s*)([-*+]|\d+\.)\s+")
_STARTS_BLOCK = re.compile(r"([-*+=#]+|\d+[.)])$|[|><%]")
_FENCES = ("```", "$$", ":::")


def markdown_table(header: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """A header, a rule and one line each."""
    return "\n".join(
        "| " + " | ".join(line) + " |" for line in [header, ["---"] * len(header), *lines]
    )


def bullets(lines: Iterable[str]) -> str:
    """A list, each of `lines` one item."""
    return "\n".join(f"- {line}" for line in lines)


def figure(value: float, *, digits: int = 3) -> str:
    """A number with so many significant digits, or all those before the point; a dash for nan."""
    if math.isnan(value):
        return NONE
    if abs(value) < ROUNDING:
        return "0"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{value:.{decimals}f}".replace("-", "−")


def as_told(value: float) -> str:
    """A number with the digits that its source gives it."""
    return f"{round(value, 6):.6g}"


def with_band(band: Band) -> str:
    """A mean, with half of its 95 % band when that is known."""
    if math.isnan(band.half_width):
        return figure(band.mean)
    return f"{figure(band.mean)} ± {figure(band.half_width, digits=2)}"


def wrapped(page: str, width: int = WIDTH) -> str:
    """The page with its paragraphs and list items wrapped to `width` characters.

    Headings, tables, code blocks and HTML stay as they are; links and inline code count as single
    words, which are never broken.
    """
    lines: list[str] = []
    for block, fixed in _blocks(page.split("\n")):
        lines += block if fixed else _filled(block, width)
    return "\n".join(lines)


def _blocks(lines: Sequence[str]) -> Iterator[tuple[list[str], bool]]:
    """Lines that are wrapped together, and single lines that must stay as they are (True)."""
    block: list[str] = []
    fenced = False
    for line in lines:
        fence = line.lstrip().startswith(_FENCES)
        fixed = fenced or fence or not line.strip() or line.lstrip()[0] in "#|><"
        fenced = fenced != fence
        if block and (fixed or _MARKER.match(line)):
            yield block, False
            block = []
        if fixed:
            yield [line], True
        else:
            block.append(line)
    if block:
        yield block, False


def _filled(block: Sequence[str], width: int) -> list[str]:
    """One paragraph or list item, its further lines indented like the text of the first."""
    first = block[0]
    marker = _MARKER.match(first)
    head = marker[0] if marker else first[: len(first) - len(first.lstrip())]
    words = _words(" ".join([first[len(head) :], *(line.strip() for line in block[1:])]))
    lines, current = [], head + words[0]
    for word in words[1:]:
        if len(current) + 1 + len(word) > width:
            lines.append(current)
            current = " " * len(head) + word
        else:
            current += " " + word
    return [*lines, current]


def _words(text: str) -> list[str]:
    """The words; one that would start a list, a table or a comment in a line is glued on."""
    words: list[str] = []
    for word in _UNBREAKABLE.findall(text):
        if words and _STARTS_BLOCK.match(word):
            words[-1] += " " + word
        else:
            words.append(word)
    return words
