"""Tables of the page on the thesis that are made from result rows."""

from collections.abc import Callable, Iterable, Mapping, Sequence

from fdnet.scales.scales import scales_of
from validation.engine.bands import Sample, band
from validation.engine.markdown import NONE, figure, markdown_table, with_band
from validation.thesis.compare.trend_quantities import known, runs_of
from validation.thesis.numbers.examine import DEFAULT_PAIR
from validation.thesis.numbers.results import ResultRow
from validation.thesis.numbers.values import thesis_of
from validation.thesis.runs.plan import (
    REASONS,
    SCAN_SEEDS,
    SPECIMENS,
    VARIANTS,
    Planned,
    planned,
)

Rows = Sequence[ResultRow]
Value = Callable[[ResultRow], float]
THESIS_LOSS, DEFAULT_LOSS = "k lost, first mm, thesis's laws, %", "fdnet's laws, %"
COLUMNS: Mapping[str, tuple[float, Value]] = {
    "invaded fines": (1, lambda row: row.invaded_count),
    "in the first mm": (1, lambda row: row.count_first_mm),
    "passed through": (1, lambda row: row.passed_count),
    "porosity lost, first mm, points": (100, lambda row: row.porosity_loss_first_mm),
    "mean depth, mm": (1, lambda row: row.mean_depth_mm),
    "depth of 95 %, mm": (1, lambda row: row.invasion_depth_p95_mm),
}
"""Columns of the tables of runs: factor and value from a result row."""


def mean(rows: Rows, value: Value, scale: float = 1) -> str:
    """Mean of a value over seeds, with its 95 % band from three seeds on."""
    return with_band(band(Sample(values=known([scale * value(row) for row in rows]))))


def first_section_losses(rows: Rows, run: str) -> list[str]:
    """Loss of permeability of the first section in per cent, by the thesis's and fdnet's laws."""
    pairs = (runs_of(rows, run), runs_of(rows, run, DEFAULT_PAIR))
    return [mean(seeds, lambda row: row.k_reductions[0], 100) for seeds in pairs]


def endings(rows: Rows) -> str:
    """The reasons for which the runs ended, each once."""
    return ", ".join(dict.fromkeys(row.stop_reason for row in rows))


def compared(rows: Rows, runs: Iterable[tuple[str, str]]) -> str:
    """One line for each (run, words) that has rows: counts, depths and loss of permeability."""
    header = ["run", "seeds", *COLUMNS, THESIS_LOSS, DEFAULT_LOSS, "ended by"]
    lines = []
    for run, words in runs:
        seeds = runs_of(rows, run)
        if seeds:
            numbers = [mean(seeds, value, scale) for scale, value in COLUMNS.values()]
            losses = first_section_losses(rows, run)
            lines.append([words, str(len(seeds)), *numbers, *losses, endings(seeds)])
    return markdown_table(header, lines)


def overview(rows: Rows) -> str:
    """The specimens in one table: counts, depth, porosity and the first section's permeability."""
    header = [
        "specimen",
        "fine diameter, mm",
        "invaded fines",
        "depth of 95 %, mm",
        "porosity lost, first mm, points",
        "whole specimen, points",
        "thesis, whole, points",
        "k lost, first mm, thesis, %",
        "by the thesis's laws, %",
        "by fdnet's laws, %",
        "ended by",
    ]
    return markdown_table(header, [_overview_line(rows, run) for run in SPECIMENS])


def _overview_line(rows: Rows, run: str) -> list[str]:
    seeds, thesis = runs_of(rows, run), thesis_of(run)
    assert thesis is not None
    assert thesis.porosity_loss is not None
    given = thesis.reductions[:1]
    return [
        run.removeprefix("specimen"),
        _diameter(run),
        mean(seeds, lambda row: row.invaded_count),
        mean(seeds, lambda row: row.invasion_depth_p95_mm),
        mean(seeds, lambda row: row.porosity_loss_first_mm, 100),
        mean(seeds, lambda row: row.porosity_initial - row.porosity_damaged, 100),
        figure(100 * thesis.porosity_loss, digits=1),
        f"{100 * given[0]:.0f}" if given else NONE,
        *first_section_losses(rows, run),
        endings(seeds),
    ]


def _diameter(run: str) -> str:
    """Diameter of the case's fines in mm."""
    fines = Planned(case=run, group="").load().fines
    return "–".join(f"{2e3 * radius:.3g}" for radius in sorted(set(fines.radius_range_m)))


def costs(rows: Rows) -> str:
    """Supply, simulated time and computing time of the runs at full scale."""
    header = (
        "run",
        "seed",
        "supplied",
        "invaded",
        "passed through",
        "ended by",
        "simulated, ms",
        "travel of the fluid, mm",
        "beyond 1 mm and near a wall, %",
        "invasion, s",
        "packing, s",
        "largest overlap, %",
    )
    lines = []
    for run in (*SPECIMENS, *VARIANTS):
        velocity = scales_of(Planned(case=run, group="").load()).interstitial_velocity
        for row in runs_of(rows, run):
            counts = (row.seed, row.supplied_count, row.invaded_count, row.passed_count)
            numbers = [row.time_ms, row.time_ms * velocity, 100 * row.fraction_deep_near_wall]
            numbers += [row.seconds, row.pack_seconds, 100 * row.max_overlap]
            lines.append([run, *map(str, counts), row.stop_reason, *map(figure, numbers)])
    return markdown_table(header, lines)


def scan(rows: Rows, group: str) -> str:
    """The runs of a scan by case and value; the unchanged case stands first."""
    items = {item.id: item for item in planned(quick=False) if item.group == group}
    rows = [row for row in rows if row.seed <= SCAN_SEEDS]
    runs: list[tuple[str, str]] = []
    for case in dict.fromkeys(item.case for item in items.values()):
        changed = [item for item in items.values() if item.case == case]
        runs += [(case, f"{case}, unchanged"), *((item.id, item.id) for item in changed)]
    return compared(rows, runs)


def reasons(rows: Rows) -> str:
    """Specimen 1, and the changes that might let more fines in."""
    return compared(
        rows,
        [
            ("specimen1", "specimen 1"),
            *((f"specimen1 {setting}", setting) for setting in REASONS),
            ("specimen1-7to8", "radii 0.07 to 0.08 mm"),
            ("specimen1-1410", "1,410 grains"),
        ],
    )


def quick_forms(rows: Rows) -> str:
    """The quick forms of all specimens and variants."""
    return compared(rows, [(f"quick-{run}", run) for run in (*SPECIMENS, *VARIANTS)])
