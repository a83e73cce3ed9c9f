"""docs/accuracy.md from docs/accuracy.md.in and the committed tables."""

from collections.abc import Sequence
from pathlib import Path
from string import Template

from fdnet.files.atomic import write_text
from fdnet.network.laws.named import DEFAULT_LAW
from fdnet.studies.accuracy import boundary_tables, tables
from fdnet.studies.accuracy.benchmark_tables import benchmark_tables
from fdnet.studies.accuracy.figure import draw_accuracy
from fdnet.studies.accuracy.full_size import full_size_table
from fdnet.studies.accuracy.goals import DAMAGE_GOAL, GOALS
from fdnet.studies.accuracy.measurement import SIDE_KOZENY
from fdnet.studies.accuracy.numbers import page_numbers
from fdnet.studies.accuracy.results import Results, compute_results, read_results, write_results
from fdnet.studies.accuracy.rows import RULES
from fdnet.studies.accuracy.slabs import slab_summary
from fdnet.studies.engine.markdown import wrapped
from fdnet.studies.truth.cases import EQUAL, LOOSE, read_cases
from fdnet.studies.truth.packs import DATA, INDEPENDENT_TRUTH, LARGE_FINES_TRUTH


def write_accuracy(
    docs: Path, benchmark: Path, *, packs: Path, more: Sequence[Path], own: Path
) -> str:
    """Computes all results and writes tables, figure and page; returns the two main tables.

    Args:
        docs: folder of the page; tables and figure go to its folder `validation`.
        benchmark: table of the network benchmark.
        packs: folder of the packs and of the independent truth.
        more: further folders of packs.
        own: table of fdnet's own truth.
    """
    cases, missing = read_cases([packs / INDEPENDENT_TRUTH, own], [packs, *more])
    validation = docs / "validation"
    results = compute_results(cases, packs)
    write_results(results, validation)
    draw_accuracy(results.intact, results.damage, validation / "accuracy.png")
    write_text(docs / "accuracy.md", document(docs, benchmark, missing))
    damage = tables.damage_table(list(results.damage), absolute=False)
    return f"{tables.intact_summary(list(results.intact))}\n\n{damage}"


def document(docs: Path, benchmark: Path, missing: Sequence[str] = ()) -> str:
    """The text of the page, from the tables alone; `missing` packs are named in it."""
    validation = docs / "validation"
    results = read_results(validation)
    parts = page_numbers(results, validation) | page_tables(results, validation)
    parts["benchmark"] = benchmark_tables(benchmark, _own_errors(results))
    parts["missing"] = (
        f" Left out, because their files are not in the project: {', '.join(missing)}."
        if missing
        else ""
    )
    template = Template((docs / "accuracy.md.in").read_text(encoding="utf-8"))
    return wrapped(template.substitute(parts))


def page_tables(results: Results, validation: Path) -> dict[str, str]:
    """Every table by its name in docs/accuracy.md.in."""
    intact, damage = list(results.intact), list(results.damage)
    counted = [row for row in intact if row["group"] != LOOSE]
    return {
        "intact_table": tables.intact_table(intact),
        "intact_summary": tables.intact_summary(intact),
        "held_out_intact": tables.held_out(counted, ("series", DEFAULT_LAW), GOALS[EQUAL]),
        "choice_table": tables.choice_table(list(results.choices), intact),
        "damage_table": tables.damage_table(damage, absolute=False),
        "absolute_table": tables.damage_table(damage, absolute=True),
        "held_out_damage": tables.held_out(damage, RULES[2:], DAMAGE_GOAL),
        "large_fine_table": tables.large_fine_table(
            list(results.large_fines), DATA / LARGE_FINES_TRUTH
        ),
        "bed_table": tables.bed_table(list(results.beds)),
        "polydisperse_table": tables.polydisperse_table(list(results.polydisperse)),
        "deposit_slabs": slab_summary(list(results.slabs)),
        "full_size_table": full_size_table(validation),
        "tiled_table": boundary_tables.tiled_table(validation / "boundary_tiled.csv"),
        "slab_table": boundary_tables.slab_table(validation / "boundary_slabs.csv"),
        "walled_table": boundary_tables.walled_table(validation / "boundary_walled.csv"),
        "wall_truth_table": boundary_tables.wall_truth_table(validation / "wall_truth.csv"),
    }


def _own_errors(results: Results) -> dict[str, float]:
    """k by `SIDE_KOZENY` over truth by case, with fines where the pack has fines."""
    intact = {row["case"]: row[DEFAULT_LAW] for row in results.intact}
    return intact | {row["case"]: row[f"{SIDE_KOZENY}: k"] for row in results.damage}
