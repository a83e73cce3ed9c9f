"""The table and the text of a study: a CSV file of its rows, and Markdown of its levels."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from validation.engine.csv_rows import parsed, read_csv, write_flat
from validation.engine.draw import series_of
from validation.engine.knee import knee_sentence
from validation.engine.levels import Level, levels
from validation.engine.markdown import bullets, markdown_table, wrapped
from validation.engine.study import DONE, Panel, Row, Study, shown

COLUMNS = tuple(field.name for field in fields(Row))
_TEXT = ("series", "knob", "quantity", "status", "role", "run")
_KNEES = """The list names the cheapest good setting for each quantity and series, with its
error and what it costs. A setting is good when its error, band included, is at most twice the
least one."""
_UNITS = {"peak_memory_mb": "MB", "steps": "steps"}


def write_rows(rows: Sequence[Row], path: Path) -> None:
    """The rows as CSV, floats with 9 digits; what is not known is left empty."""
    write_flat(path, Row, rows)


def read_rows(path: Path) -> list[Row]:
    """The rows of such a file.

    Raises:
        CaseError: the file has other columns.
    """
    return [_row(dict(zip(COLUMNS, line, strict=True))) for line in read_csv(path, list(COLUMNS))]


def _row(line: Mapping[str, str]) -> Row:
    values: dict[str, Any] = {name: _value(name, line[name]) for name in COLUMNS}
    return Row(**values)


def _value(name: str, text: str) -> str | int | float:
    if name in _TEXT:
        return text
    try:
        return parsed(text, int if name == "seed" else float)
    except ValueError:
        return text


def study_text(study: Study, rows: Sequence[Row]) -> str:
    """The Markdown of a study.

    It holds one sentence for every series of every panel (or the study's own summary), the points
    that were not done, and a table of the levels of each series. A study with a page of its own
    has that.
    """
    if study.page:
        return wrapped(study.page(rows))
    parts = [f"# {study.title}"]
    if study.summary:
        parts += [f"The table shows what each {study.knob_label} costs and saves."]
        parts.append(study.summary(rows))
    elif knees := knee_lines(study, rows):
        parts += [_KNEES, bullets(knees)]
    if missing := missing_lines(rows):
        parts.append(f"Not done:\n\n{bullets(missing)}")
    for panel in study.panels:
        for name in series_of(panel, rows):
            of_series = levels(rows, name, panel.quantity, cost=panel.cost)
            parts.append(f"**{panel.title}: {name}** ({panel.label})")
            if panel.cost == "value":
                parts.append(_value_table(panel, of_series))
            else:
                parts.append(_level_table(study, of_series, panel.cost))
    return wrapped("\n\n".join(parts) + "\n")


def knee_lines(study: Study, rows: Sequence[Row]) -> list[str]:
    """One sentence for every series of every panel; none where the study has its own summary."""
    if study.summary:
        return []
    lines = []
    for panel in study.panels:
        for name in series_of(panel, rows) if panel.cost != "value" else ():
            sentence = knee_sentence(
                levels(rows, name, panel.quantity, cost=panel.cost),
                default=study.defaults.get(name),
                unit=_UNITS.get(panel.cost, "s"),
            )
            lines.append(f"{panel.title}, {name}: {sentence}.")
    return lines


def _level_table(study: Study, of_series: Sequence[Level], cost: str) -> str:
    header = [
        study.knob_label, "runs", "error", "± (95 %)", f"cost, {_UNITS.get(cost, 's')}"
    ]  # fmt: skip
    lines = [
        [
            shown(level.value),
            str(level.runs),
            f"{level.error:+.3g}",
            f"{level.half_width:.2g}" if level.half_width else "-",
            f"{level.cost:.3g}",
        ]
        for level in of_series
    ]
    return markdown_table(header, lines)


def _value_table(panel: Panel, of_series: Sequence[Level]) -> str:
    return markdown_table(
        [panel.knob, panel.label],
        [[shown(level.value), f"{level.error:.3g}"] for level in of_series],
    )


def missing_lines(rows: Sequence[Row]) -> list[str]:
    """Points that were refused, failed or exceeded a limit, each with its status."""
    lines = {
        f"{row.series}, {row.knob} {shown(row.value)}, seed {row.seed}: {row.status}"
        for row in rows
        if row.status != DONE
    }
    return sorted(lines)
