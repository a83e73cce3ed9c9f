"""Tables 3 to 11 of the thesis with our numbers next to its own, as Markdown.

Our numbers are means over seeds, with their 95 % band where there are three seeds or more.
Porosity and reductions of permeability are in per cent, as in the thesis; losses of porosity are
in points of per cent.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from validation.engine.bands import Sample, band
from validation.engine.markdown import NONE, as_told, markdown_table, with_band
from validation.thesis.compare.table_properties import (
    ENDED,
    IN_SETTINGS,
    OURS_ONLY,
    PROPERTIES,
    RUNS,
    thesis_number,
)
from validation.thesis.compare.trend_quantities import known, runs_of
from validation.thesis.numbers.examine import DEFAULT_PAIR, THESIS_PAIR
from validation.thesis.numbers.results import SECTIONS, ResultRow
from validation.thesis.numbers.values import TABLE3, ThesisSpecimen, thesis_of
from validation.thesis.runs.plan import SPECIMENS

LAWS: Mapping[str, tuple[str, str]] = {"thesis's laws": THESIS_PAIR, "fdnet's laws": DEFAULT_PAIR}


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """One table of the thesis, and the runs that are compared with it.

    Attributes:
        number: its number in the thesis, such as "Table 4".
        title: its subject.
        form: "settings" with one line a run, "properties" with one column a run, "sections" or
            "first section" with the permeability of sections.
        runs: the runs.
    """

    number: str
    title: str
    form: str
    runs: tuple[str, ...]


TABLES = (
    Table(number="Table 3", title="the nominal drag", form="settings", runs=(TABLE3,)),
    Table(number="Table 4", title="fines of one size", form="settings", runs=SPECIMENS[:6]),
    Table(number="Table 5", title="a spread of fine sizes", form="settings", runs=SPECIMENS[6:7]),
    Table(
        number="Table 6",
        title="a spread of grain and fine sizes",
        form="settings",
        runs=SPECIMENS[7:],
    ),
    Table(
        number="Table 7",
        title="specimen 1",
        form="properties",
        runs=("specimen1", "specimen1-7to8", "specimen1-1410"),
    ),
    Table(
        number="Table 8",
        title="permeability of specimen 1 by section",
        form="sections",
        runs=("specimen1", "specimen1-7to8", "specimen1-1410"),
    ),
    Table(
        number="Table 9",
        title="specimen 5",
        form="properties",
        runs=("specimen5", "specimen5-5to6"),
    ),
    Table(
        number="Table 10",
        title="permeability of specimen 5 by section",
        form="sections",
        runs=("specimen5", "specimen5-5to6"),
    ),
    Table(
        number="Table 11",
        title="specimen 8 (there called 7)",
        form="properties",
        runs=SPECIMENS[7:],
    ),
    Table(
        number="Figures 49, 58, 65, 69, 72",
        title="permeability of the first section",
        form="first section",
        runs=(TABLE3, *SPECIMENS),
    ),
)


def thesis_tables(rows: Sequence[ResultRow]) -> str:
    """All tables, each under its title."""
    return "\n\n".join(
        f"**{table.number}: {table.title}**\n\n{table_of(table, rows)}" for table in TABLES
    )


def table_of(table: Table, rows: Sequence[ResultRow]) -> str:
    """One table as Markdown."""
    return FORMS[table.form](table, rows)


def _settings(table: Table, rows: Sequence[ResultRow]) -> str:
    """One line a run; each property has a column of the thesis and one of ours."""
    properties = [one for one in PROPERTIES if one.name in IN_SETTINGS]
    header = ["run", "fine diameter, mm"]
    for one in properties:
        header += [one.name] if one.name in OURS_ONLY else [f"{one.name}, thesis", "ours"]
    lines = []
    for run in table.runs:
        thesis = _thesis(run)
        line = [run, _diameter(thesis)]
        for one in properties:
            ours = _ours(rows, run, one.ours, scale=one.scale)
            line += [ours] if one.name in OURS_ONLY else [one.thesis(thesis), ours]
        lines.append([*line, *_runs(rows, run)])
    return markdown_table([*header, RUNS, ENDED], lines)


def _properties(table: Table, rows: Sequence[ResultRow]) -> str:
    thesis = _thesis(table.runs[0])
    lines = [
        ["fine radius, mm", _range(thesis.fine_radius_mm), *(_radius(run) for run in table.runs)]
    ]
    for one in PROPERTIES:
        lines.append(
            [
                one.name,
                one.thesis(thesis),
                *(_ours(rows, run, one.ours, scale=one.scale) for run in table.runs),
            ]
        )
    for name, laws in LAWS.items():
        cells = [_ours(rows, run, lambda row: row.k_reduction, laws=laws) for run in table.runs]
        lines.append([f"permeability reduction, %, {name}", NONE, *cells])
    count, ended = zip(*(_runs(rows, run) for run in table.runs), strict=True)
    lines += [[RUNS, NONE, *count], [ENDED, NONE, *ended]]
    return markdown_table(["", "thesis", *table.runs], lines)


def _sections(table: Table, rows: Sequence[ResultRow]) -> str:
    """Reduction of permeability by section.

    Sections of all runs are cut out and under the thesis's laws; those of the first run are also
    in place, and under fdnet's laws.
    """
    first, *variants = table.runs
    columns: list[tuple[str, str, tuple[str, str], str]] = []
    for name, laws in LAWS.items():
        columns.append((f"{first}, {name}", first, laws, "k_reductions"))
        columns.append((f"{first}, {name}, in place", first, laws, "k_reductions_inplace"))
    columns += [(f"{run}, thesis's laws", run, THESIS_PAIR, "k_reductions") for run in variants]
    given = _thesis(first).section_reduction or ()
    lines = []
    for section in range(SECTIONS):
        cells = [
            _ours(rows, run, _section(field, section), laws=laws)
            for _, run, laws, field in columns
        ]
        lines.append(
            [
                f"{section}–{section + 1}",
                as_told(100 * given[section]) if section < len(given) else NONE,
                *cells,
            ]
        )
    lines.append([RUNS, NONE, *(_runs(rows, run)[0] for _, run, *_ in columns)])
    return markdown_table(
        ["depth, mm", "thesis, %", *(f"{name}, %" for name, *_ in columns)], lines
    )


def _section(field: str, at: int) -> Callable[[ResultRow], float]:
    return lambda row: getattr(row, field)[at]


def _first_section(table: Table, rows: Sequence[ResultRow]) -> str:
    """Reduction of permeability of the first section and of the whole specimen, by both pairs.

    The first section is cut out, and in place in the whole specimen.
    """
    parts: dict[str, Callable[[ResultRow], float]] = {
        "first section": lambda row: row.k_reductions[0],
        "in place": lambda row: row.k_reductions_inplace[0],
        "whole": lambda row: row.k_reduction,
    }
    columns = [
        (f"{part}, {name}, %", value, laws)
        for name, laws in LAWS.items()
        for part, value in parts.items()
    ]
    lines = []
    for run in table.runs:
        thesis = _thesis(run)
        given = thesis_number(thesis, "first_section_reduction", 100)
        if thesis.section_reduction is not None:
            given = as_told(100 * thesis.section_reduction[0])
        cells = [_ours(rows, run, value, laws=laws) for _, value, laws in columns]
        lines.append([run, given, *cells, _runs(rows, run)[0]])
    return markdown_table(
        ["run", "thesis, first section, %", *(name for name, *_ in columns), RUNS], lines
    )


FORMS: Mapping[str, Callable[[Table, Sequence[ResultRow]], str]] = {
    "settings": _settings,
    "properties": _properties,
    "sections": _sections,
    "first section": _first_section,
}


def _thesis(run: str) -> ThesisSpecimen:
    thesis = thesis_of(run)
    assert thesis is not None, run
    return thesis


def _ours(
    rows: Sequence[ResultRow],
    run: str,
    value: Callable[[ResultRow], float],
    *,
    laws: tuple[str, str] = THESIS_PAIR,
    scale: float = 100.0,
) -> str:
    """Mean of a value over the runs of that name, with its band from three runs on.

    The value is given in per cent unless another scale is set.
    """
    values = known([scale * value(row) for row in runs_of(rows, run, laws)])
    return with_band(band(Sample(values=values)))


def _runs(rows: Sequence[ResultRow], run: str) -> tuple[str, str]:
    """How many runs there are and how they ended, with numbers when they ended differently."""
    count = Counter(row.stop_reason.replace("_", " ") for row in runs_of(rows, run))
    words = [
        word if len(count) == 1 else f"{word} ({times})" for word, times in sorted(count.items())
    ]
    return str(count.total()), ", ".join(words) or NONE


def _range(ends: tuple[float, float] | None, scale: float = 1.0) -> str:
    return NONE if ends is None else "–".join(as_told(scale * end) for end in ends)


def _diameter(thesis: ThesisSpecimen) -> str:
    """Diameter of the fines in mm; some tables of the thesis give radii."""
    if thesis.fine_diameter_mm is not None:
        return as_told(thesis.fine_diameter_mm)
    return _range(thesis.fine_radius_mm, 2.0)


def _radius(run: str) -> str:
    """Radius of our fines in mm: that of Table 4, or the range of radii in a run's name."""
    thesis = _thesis(run)
    if thesis.fine_diameter_mm is None or "to" in run:
        return _range(thesis.fine_radius_mm)
    return as_told(thesis.fine_diameter_mm / 2)
