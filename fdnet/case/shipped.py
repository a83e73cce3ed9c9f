"""The case files that come with fdnet."""

import re
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from fdnet.errors import CaseError

QUICK = "quick-"
_SENTENCE = re.compile(r"(.+?)[.:](\s|$)")


@dataclass(frozen=True, slots=True, kw_only=True)
class ShippedCase:
    """A case file that comes with fdnet.

    Attributes:
        name: as `fdnet cases` takes it; "quick-NAME" is the quick form of NAME.
        path: of the file.
        about: the first sentence of its comment.
    """

    name: str
    path: Path
    about: str


def cases_folder() -> Path:
    """The folder of the shipped cases: in an installed package, or next to an editable one."""
    package = Path(str(files("fdnet")))
    for folder in (package / "cases", package.parent / "cases"):
        if folder.is_dir():
            return folder
    raise CaseError(
        f"{package.parent / 'cases'}: the shipped case files are missing; install fdnet again"
    )


def case_path(name: str) -> Path:
    """The file of a shipped case; "quick-NAME" is the quick form of NAME."""
    quick = name.startswith(QUICK)
    return (
        cases_folder()
        / ("quick" if quick else "")
        / f"{name.removeprefix(QUICK) if quick else name}.toml"
    )


def shipped_cases() -> tuple[ShippedCase, ...]:
    """All shipped cases: those that are full first, then the quick forms, by name."""
    folder = cases_folder()
    full = [(path.stem, path) for path in sorted(folder.glob("*.toml"))]
    quick = [(QUICK + path.stem, path) for path in sorted(folder.glob("quick/*.toml"))]
    return tuple(
        ShippedCase(name=name, path=path, about=first_sentence(path.read_text(encoding="utf-8")))
        for name, path in [*full, *quick]
    )


def first_sentence(text: str) -> str:
    """The first sentence of the comment at the top of a file, without its full stop."""
    lines = []
    for line in text.splitlines():
        if not line.startswith("#"):
            break
        lines.append(line.lstrip("# "))
    comment = " ".join(lines)
    match = _SENTENCE.match(comment)
    return match[1] if match else comment
