"""The tables of the case reference and the lists of options, written into their pages.

    python docs/_ext/reference_tables.py --write    # after a change of a key or an option

Each stands between two comments, `<!-- case-keys grains -->` (or `command-options run`, or
`shared-options`) and `<!-- end -->`, so the pages are whole as plain Markdown, too.
"""

import re
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path

from case_keys import key_rows
from command_options import own_rows, shared_rows

from fdnet.errors import PAGE, catalogue

PAGES = ("docs/reference/case.md", "docs/reference/commands.md")
BLOCK = re.compile(
    r"(<!-- (case-keys|command-options|shared-options)(?: ([\w.]+))? -->\n).*?(<!-- end -->)", re.S
)


def filled(page: str) -> str:
    """The text of a page with the tables of the models and parsers between its comments."""
    return BLOCK.sub(lambda block: f"{block[1]}\n{_table(block[2], block[3])}\n{block[4]}", page)


def warnings_page() -> str:
    """The page of all warnings."""

    opening = (
        "A warning names something that is valid but doubtful, and the run goes on. Here stands "
        "what follows from it and what to do. Findings of `fdnet check` say this themselves."
    )
    lines = ["# Warnings", "", *_wrapped(opening)]
    for key, entry in catalogue().items():
        title, *said = (
            one[0].upper() + one[1:] for one in (key.replace("-", " "), entry.follows, entry.do)
        )
        lines += ["", f"## {title}", "", *_wrapped(f"{'. '.join(said)}. [More](../{entry.read})")]
    return "\n".join(lines) + "\n"


def _table(kind: str, name: str | None) -> str:
    if kind == "case-keys":
        return _lines(("Key", "Default", "Meaning"), list(key_rows(name or "")))
    rows = shared_rows() if kind == "shared-options" else own_rows(str(name))
    items = (_wrapped(f"- {option}: {meaning}", "  ") for option, meaning in rows)
    return "".join(f"{line}\n" for item in items for line in item)


def _wrapped(text: str, indent: str = "") -> list[str]:
    return textwrap.wrap(
        text, 99, subsequent_indent=indent, break_on_hyphens=False, break_long_words=False
    )


def _lines(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    cells = [[" ".join(cell.split(" ")).replace("|", r"\|") for cell in line] for line in lines]
    return "".join(f"| {' | '.join(line)} |\n" for line in cells)


def written(root: Path) -> list[tuple[Path, str]]:
    """The generated pages with the text that they should have."""
    pages = [root / name for name in PAGES]
    return [
        *((path, filled(path.read_text(encoding="utf-8"))) for path in pages),
        (root / PAGE, warnings_page()),
    ]


def main() -> int:
    """Write the pages with `--write`; otherwise name those that are out of date, with code 1."""
    root, code = Path(__file__).resolve().parents[2], 0
    for path, text in written(root):
        if path.exists() and path.read_text(encoding="utf-8") == text:
            continue
        if "--write" in sys.argv[1:]:
            path.write_text(text, encoding="utf-8")
        else:
            code = 1
            print(f"{path.relative_to(root)}: it is not that of the code", file=sys.stderr)
    return code


if __name__ == "__main__":
    raise SystemExit(main())
