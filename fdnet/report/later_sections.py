"""Sections that a command adds to a report after the run, in places that its page keeps."""

from pathlib import Path

from fdnet.errors import CaseError
from fdnet.files.atomic import write_text


def put_section(report: Path, name: str, section: str) -> bool:
    """Put a section into the place `name` of a page; a page without the place stays as it is.

    Returns whether the page has the place. Raises CaseError where the page is no text in UTF-8.
    """
    begin, end = f"<!-- {name} begins -->", f"<!-- {name} ends -->"
    try:
        text = report.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise CaseError(
            f"{report}: cannot be read as a page ({error}), and the section on {name} is not in "
            "it; write it anew with --stages report --force (the numbers are kept)"
        ) from error
    before, has_begin, rest = text.partition(begin)
    _, has_end, after = rest.partition(end)
    if has_begin and has_end:
        write_text(report, f"{before}{begin}\n{section}\n{end}{after}")
    return bool(has_begin and has_end)
