"""Tables 3 to 11 of the thesis with our numbers beside its own, as markdown.

Ours are means over seeds with their 95 % band where there are three or more; porosity, its losses and reductions of
permeability in per cent, as the thesis tells them, and as points of porosity.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from fdnet.studies.engine.bands import Sample, band
from fdnet.studies.engine.markdown import NONE, as_told, markdown_table, with_band
from fdnet.studies.thesis.compare.table_properties import (
    ENDED,
    IN_SETTINGS,
    OURS_ONLY,
    PROPERTIES,
    RUNS,
    told_number,
)
from fdnet.studies.thesis.compare.trend_quantities import known, runs_of
from fdnet.studies.thesis.numbers.examine import DEFAULT_PAIR, THESIS_PAIR
from fdnet.studies.thesis.numbers.results import SECTIONS, ResultRow
from fdnet.studies.thesis.numbers.values import TABLE3, ThesisSpecimen, thesis_of
from fdnet.studies.thesis.runs.plan import SPECIMENS

LAWS: Mapping[str, tuple[str, str]] = {"thesis's laws": THESIS_PAIR, "fdnet's laws": DEFAULT_PAIR}


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """One table of the thesis and the `runs` beside it: "settings" one line a run, "properties" one column a run,
    "sections" one line a section."""

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
    """All of them, each under its title."""
    return "\n\n".join(
        f"**{table.number}: {table.title}**\n\n{table_of(table, rows)}" for table in TABLES
    )


def table_of(table: Table, rows: Sequence[ResultRow]) -> str:
    """One table as markdown."""
    return FORMS[table.form](table, rows)


def _settings(table: Table, rows: Sequence[ResultRow]) -> str:
    """Two columns each, the thesis's and ours; sizes and initial porosity as told."""
    told = [one for one in PROPERTIES if one.name in IN_SETTINGS]
    header = ["run", "fine diameter, mm"]
    for one in told:
        header += [one.name] if one.name in OURS_ONLY else [f"{one.name}, thesis", "ours"]
    lines = []
    for run in table.runs:
        thesis = _thesis(run)
        line = [run, _diameter(thesis)]
        for one in told:
            ours = _ours(rows, run, one.ours, scale=one.scale)
            line += [ours] if one.name in OURS_ONLY else [one.told(thesis), ours]
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
                one.told(thesis),
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
    """Cut-out sections of all runs under the thesis's laws; of the first run also under fdnet's, and in place."""
    first, *variants = table.runs
    columns: list[tuple[str, str, tuple[str, str], str]] = []
    for name, laws in LAWS.items():
        columns.append((f"{first}, {name}", first, laws, "k_reductions"))
        columns.append((f"{first}, {name}, in place", first, laws, "k_reductions_inplace"))
    columns += [(f"{run}, thesis's laws", run, THESIS_PAIR, "k_reductions") for run in variants]
    told = _thesis(first).section_reduction or ()
    lines = []
    for section in range(SECTIONS):
        cells = [
            _ours(rows, run, _section(field, section), laws=laws)
            for _, run, laws, field in columns
        ]
        lines.append(
            [
                f"{section}–{section + 1}",
                as_told(100 * told[section]) if section < len(told) else NONE,
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
    """Reduction of the first section, cut out and in place, and of the whole specimen, under both pairs of laws."""
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
        told = told_number(thesis, "first_section_reduction", 100)
        if thesis.section_reduction is not None:
            told = as_told(100 * thesis.section_reduction[0])
        cells = [_ours(rows, run, value, laws=laws) for _, value, laws in columns]
        lines.append([run, told, *cells, _runs(rows, run)[0]])
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
    """Mean over the runs of that name, in per cent unless another scale is asked for; its band from three runs on."""
    values = known([scale * value(row) for row in runs_of(rows, run, laws)])
    return with_band(band(Sample(values=values)))


def _runs(rows: Sequence[ResultRow], run: str) -> tuple[str, str]:
    """How many there are and how they ended, with how many each way when not all alike."""
    count = Counter(row.stop_reason.replace("_", " ") for row in runs_of(rows, run))
    words = [
        word if len(count) == 1 else f"{word} ({times})" for word, times in sorted(count.items())
    ]
    return str(count.total()), ", ".join(words) or NONE


def _range(ends: tuple[float, float] | None, scale: float = 1.0) -> str:
    return NONE if ends is None else "–".join(as_told(scale * end) for end in ends)


def _diameter(thesis: ThesisSpecimen) -> str:
    """As diameters throughout, though some tables give radii."""
    if thesis.fine_diameter_mm is not None:
        return as_told(thesis.fine_diameter_mm)
    return _range(thesis.fine_radius_mm, 2.0)


def _radius(run: str) -> str:
    """Of our fines: Table 4's size, in the variants named by a range the radii of the tables that give one."""
    thesis = _thesis(run)
    if thesis.fine_diameter_mm is None or "to" in run:
        return _range(thesis.fine_radius_mm)
    return as_told(thesis.fine_diameter_mm / 2)
