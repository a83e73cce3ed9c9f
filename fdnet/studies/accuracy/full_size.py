"""The laws of the throats between grains against the network of all spheres, at full size.

No grid resolves a specimen of thousands of grains and fines. There the network of all spheres,
which resolved flow has judged on slabs, is what these laws are compared with.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from fdnet.case.names import ALL_SPHERES, DEFAULT_DAMAGE_LAW, DEFAULT_LAW, SECTION_ARCHIE, UPSCALED
from fdnet.network.analysis import Analysis
from fdnet.network.permeability import compare
from fdnet.run.open_run import open_run
from fdnet.studies.accuracy.goals import ratio
from fdnet.studies.engine.csv_rows import DIGITS, read_named, write_named
from fdnet.studies.engine.markdown import markdown_table
from fdnet.studies.truth.packs import MM

Row = dict[str, Any]
FULL_SIZE = "accuracy_full_size.csv"
EDGES_MM = (0.0, 0.5, 1.0, 2.0)
"""Where sections begin, mm from the face; the last one reaches to the outlet."""
WHOLE = "whole"
TWO_SCALE = (DEFAULT_DAMAGE_LAW, SECTION_ARCHIE, UPSCALED)


def full_size_rows(runs: Iterable[Path]) -> list[Row]:
    """k/k0 by all spheres, and k of `TWO_SCALE` over it, of the sections of finished `runs`.

    "cut out" has the pressure held on both planes of a section, "in place" is from the pressures
    of the whole. A row `WHOLE` is of the whole specimen, which has no two ways.
    """
    rows: list[Row] = []
    for path in runs:
        run = open_run(path)
        edges = [*(MM * one for one in EDGES_MM), run.case.size_m[0]]
        names = (ALL_SPHERES, *TWO_SCALE)
        results = list(
            compare(
                run.spheres(),
                periodic=run.case.periodic,
                laws=[(DEFAULT_LAW, name) for name in names],
                sections=edges,
            )
        )
        rows += _rows(path.name, dict(zip(names, results, strict=True)))
    return rows


def _rows(case: str, by_law: dict[str, Analysis]) -> list[Row]:
    whole = by_law[ALL_SPHERES]
    rows = []
    for number, section in enumerate(whole.sections):
        row: Row = {
            "case": case,
            "section": f"{section.x_lo / MM:g} to {section.x_hi / MM:g} mm",
            "k_over_k0": section.k_damaged / section.k_initial,
        }
        for law in TWO_SCALE:
            own = by_law[law].sections[number]
            row[law] = own.k_damaged / section.k_damaged
            row[f"{law}: in place"] = own.k_damaged_inplace / section.k_damaged_inplace
        rows.append(row)
    k = {law: result.k_damaged / whole.k_damaged for law, result in by_law.items()}
    last = {"case": case, "section": WHOLE, "k_over_k0": whole.k_damaged / whole.k_initial}
    return [
        *rows,
        last | {name: k[law] for law in TWO_SCALE for name in (law, f"{law}: in place")},
    ]


def write_full_size(runs: Sequence[Path], validation: Path) -> str:
    """Writes the table of `runs` to the folder `validation`, and gives it as Markdown."""
    write_named(validation / FULL_SIZE, full_size_rows(runs), digits=DIGITS)
    return full_size_table(validation)


def full_size_table(validation: Path) -> str:
    """Of the written table, the first section and the whole of each run: law over all spheres."""
    columns = [column for law in TWO_SCALE for column in (law, f"{law}: in place")]
    rows = read_named(validation / FULL_SIZE)
    lines = [
        [row["case"], row["section"], ratio(float(row["k_over_k0"]))]
        + [ratio(float(row[column])) for column in columns]
        for row in rows
        if row["section"] in (rows[0]["section"], WHOLE)
    ]
    return markdown_table(["run", "section", "k/k0, all spheres", *columns], lines)


def full_size_numbers(validation: Path) -> dict[str, str]:
    """What the laws make of the first half-millimetre and of the whole, over all spheres."""
    rows = read_named(validation / FULL_SIZE)
    face, whole = rows[0]["section"], WHOLE
    return {
        f"full_size_{part}_{key}": _span(rows, section, law)
        for part, section in (("face", face), ("whole", whole))
        for key, law in zip(("kozeny", "archie", "local"), TWO_SCALE, strict=True)
    } | {"full_size_runs": str(sum(row["section"] == whole for row in rows))}


def _span(rows: Sequence[dict[str, str]], section: str, law: str) -> str:
    ratios = sorted(float(row[law]) for row in rows if row["section"] == section)
    return f"{ratios[0]:.2f} to {ratios[-1]:.2f}"
