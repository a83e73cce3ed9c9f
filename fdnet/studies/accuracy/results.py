"""The results that the accuracy page is made from: computed once, kept as CSV, read back."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from fdnet.studies.accuracy.choices import choice_rows, refitted_series
from fdnet.studies.accuracy.deposits import bed_rows, large_fine_rows
from fdnet.studies.accuracy.rows import damaged_row, intact_row, polydisperse_rows
from fdnet.studies.accuracy.slabs import slab_rows
from fdnet.studies.accuracy.vanishing import vanishing_rows
from fdnet.studies.engine.csv_rows import DIGITS, read_named, write_named
from fdnet.studies.truth.cases import Case
from fdnet.studies.truth.slabs import LATER, NO, SLAB_FOLDER, YES

Row = dict[str, Any]
_TEXT = ("case", "group", "known_before", "choice", "tessellation")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Results:
    """Rows by column name; each field is the file `accuracy_FIELD.csv`.

    Attributes:
        intact: k of every law over truth, one row a case without fines.
        damage: k/k0 and k of every pair of laws over truth, one row a case with fines.
        polydisperse: k of every law over truth on unequal grains, in two tessellations.
        choices: k over truth of variants of the default law, one column a case.
        refit: k over truth of `series` refitted, with and without the pack itself.
        large_fines: k/k0 of every pair of laws with fines of a third of a grain.
        beds: k/k0 of every pair of laws with all pores full of fines, and of the bed.
        slabs: k/k0, k and k0 of every pair of laws over truth on slabs of real deposits.
        vanishing: what one fine changes of k by the network of all spheres, by its size.
    """

    intact: Sequence[Row]
    damage: Sequence[Row]
    polydisperse: Sequence[Row]
    choices: Sequence[Row]
    refit: Sequence[Row]
    large_fines: Sequence[Row]
    beds: Sequence[Row]
    slabs: Sequence[Row]
    vanishing: Sequence[Row]


def compute_results(cases: list[Case], folder: Path) -> Results:
    """All rows, in some five minutes; `folder` holds the packs that deposits are made in."""
    intact = [case for case in cases if case.ratio is None]
    return Results(
        intact=[intact_row(case) for case in intact],
        damage=[damaged_row(case) for case in cases if case.ratio is not None],
        polydisperse=polydisperse_rows(cases),
        choices=choice_rows(intact),
        refit=refitted_series(cases),
        large_fines=large_fine_rows(folder),
        beds=bed_rows(folder),
        slabs=slab_rows(SLAB_FOLDER, (YES, NO, LATER)),
        vanishing=vanishing_rows(folder),
    )


def write_results(results: Results, folder: Path) -> None:
    """One file for each field."""
    for field in fields(Results):
        path = folder / f"accuracy_{field.name}.csv"
        write_named(path, getattr(results, field.name), digits=DIGITS)


def read_results(folder: Path) -> Results:
    """The results from their files."""
    return Results(
        **{
            field.name: [_row(line) for line in read_named(folder / f"accuracy_{field.name}.csv")]
            for field in fields(Results)
        }
    )


def _row(line: Mapping[str, str]) -> Row:
    return {name: text if name in _TEXT else _number(text) for name, text in line.items()}


def _number(text: str) -> int | float:
    try:
        return int(text)
    except ValueError:
        return float(text)
