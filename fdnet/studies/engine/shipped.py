"""The case files that come with fdnet."""

from importlib.resources import files
from pathlib import Path

from fdnet.errors import CaseError

QUICK = "quick-"


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
