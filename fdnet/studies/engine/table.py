"""The table and the text of a study: a tidy CSV; by quantity and series what each level costs and where the knee is."""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from fdnet.atomic import write_text
from fdnet.errors import CaseError
from fdnet.studies.engine.draw import series_of
from fdnet.studies.engine.judge import Level, knee_sentence, levels
from fdnet.studies.engine.study import DONE, Panel, Row, Study, shown

COLUMNS = tuple(field.name for field in fields(Row))
_TEXT = ("series", "knob", "quantity", "status", "role", "run")


def write_rows(rows: Sequence[Row], path: Path) -> None:
    """The rows as CSV, floats with 9 digits, what is not known left empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([_cell(getattr(row, name)) for name in COLUMNS] for row in rows)
    write_text(path, text.getvalue())


def _cell(value: object) -> object:
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.9g}"
    return value


def read_rows(path: Path) -> list[Row]:
    """The rows of such a CSV. Raises CaseError when it is not one."""
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        if tuple(reader.fieldnames or ()) != COLUMNS:
            raise CaseError(
                f"{path}: columns {reader.fieldnames}, expected {list(COLUMNS)}; run fdnet study again"
            )
        return [_row(line) for line in reader]


def _row(line: Mapping[str, str]) -> Row:
    values: dict[str, Any] = {name: _value(name, line[name]) for name in COLUMNS}
    return Row(**values)


def _value(name: str, text: str) -> str | int | float:
    if name in _TEXT:
        return text
    if name == "seed":
        return int(text)
    try:
        return float(text) if text else float("nan")
    except ValueError:
        return text


def study_text(study: Study, rows: Sequence[Row]) -> str:
    """Markdown: the knee of every series in every panel or the study's own summary, its remarks, what was not done,
    tables of levels."""
    parts = [f"# {study.title}"]
    if knees := knee_lines(study, rows):
        parts.append("\n".join(f"- {line}" for line in knees))
    if study.summary:
        parts.append(study.summary(rows))
    if study.remarks:
        parts.append(study.remarks.strip())
    missing = missing_lines(rows)
    if missing:
        parts.append("Not done:\n\n" + "\n".join(f"- {line}" for line in missing))
    for panel in study.panels:
        for name in series_of(panel, rows):
            found = levels(rows, name, panel.quantity, cost=panel.cost)
            parts.append(f"**{panel.title}: {name}** ({panel.label})")
            if panel.cost == "value":
                parts.append(_value_table(panel, found))
            else:
                parts.append(_level_table(study, found, panel.cost))
    return "\n\n".join(parts) + "\n"


def knee_lines(study: Study, rows: Sequence[Row]) -> list[str]:
    """One sentence for every series of every panel; none where the study has a summary of its own."""
    lines: list[str] = []
    if study.summary:
        return lines
    for panel in study.panels:
        for name in series_of(panel, rows) if panel.cost != "value" else ():
            found = levels(rows, name, panel.quantity, cost=panel.cost)
            said = knee_sentence(found, default=study.defaults.get(name), unit=_unit(panel.cost))
            lines.append(f"{panel.title}, {name}: {said}.")
    return lines


def _level_table(study: Study, found: Sequence[Level], cost: str) -> str:
    lines = [
        f"| {study.knob_label} | runs | error | ± (95 %) | cost, {_unit(cost)} |",
        "|---|---|---|---|---|",
    ]
    for level in found:
        band = f"{level.half_width:.2g}" if level.half_width else "-"
        lines.append(
            f"| {shown(level.value)} | {level.runs} | {level.error:+.3g} | {band} | {level.cost:.3g} |"
        )
    return "\n".join(lines)


def _value_table(panel: Panel, found: Sequence[Level]) -> str:
    lines = [f"| {panel.knob} | {panel.label} |", "|---|---|"]
    return "\n".join(
        [*lines, *(f"| {shown(level.value)} | {level.error:.3g} |" for level in found)]
    )


def _unit(cost: str) -> str:
    return {"peak_memory_mb": "MB", "steps": "steps"}.get(cost, "s")


def missing_lines(rows: Sequence[Row]) -> list[str]:
    """Points that were refused, failed or exceeded a limit."""
    found = {
        f"{row.series}, {row.knob} {shown(row.value)}, seed {row.seed}: {row.status}"
        for row in rows
        if row.status != DONE
    }
    return sorted(found)
