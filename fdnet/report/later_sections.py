"""Sections that a command adds to a report after the run, in places that its page keeps."""

from pathlib import Path

from fdnet.files.atomic import write_text


def put_section(report: Path, name: str, section: str) -> None:
    """Put a section into the place `name` of a page; a page without the place stays as it is."""
    begin, end = f"<!-- {name} begins -->", f"<!-- {name} ends -->"
    text = report.read_text(encoding="utf-8")
    before, has_begin, rest = text.partition(begin)
    _, has_end, after = rest.partition(end)
    if has_begin and has_end:
        write_text(report, f"{before}{begin}\n{section}\n{end}{after}")
