"""The cases of known permeability: each pack with its truth, its group, and who knew it when."""

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from fdnet.spheres.snapshot import Kind, Snapshot
from validation.truth.packs import MM, RADIUS, read_pack, snapshot, truth_folder

EQUAL, UNEQUAL, LATTICE, LOOSE = (
    "random, equal grains",
    "random, unequal grains",
    "touching lattices",
    "loose lattices",
)
LOOSE_SOLIDS = (0.45, 0.343, 0.216)
"""Volume fractions of the grains in the loose lattices, which are made in code."""
YES, NO, LATER = "yes", "no", "later"
KNOWN_BEFORE = "known_before.csv"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Case:
    """A periodic pack of known permeability, with the flow along its x axis.

    Attributes:
        name: letter of the pack and what it holds, then the axis of the flow unless it is x.
        group: `EQUAL`, `UNEQUAL`, `LATTICE` or `LOOSE`.
        pack: grains, and fines if there are any.
        k: permeability, m2.
        error: relative error of `k` as estimated from the grids of the resolved flow.
        ratio: `k` over the permeability of the grains alone; None without fines.
    """

    name: str
    group: str
    pack: Snapshot
    k: float
    error: float
    ratio: float | None

    @property
    def known_before(self) -> str:
        """Whether the author of the laws had looked at this truth before choosing them.

        "yes"; "no"; "later" where the truth was solved after the law had been committed; "" for
        loose lattices, which are not counted. Packs that the table does not name: "no".
        """
        return "" if self.group == LOOSE else _known_before().get(self.name, NO)


@cache
def _known_before() -> dict[str, str]:
    return {row["case"]: row["known_before"] for row in _rows(truth_folder() / KNOWN_BEFORE)}


def read_cases(tables: list[Path], folders: list[Path]) -> tuple[list[Case], list[str]]:
    """The cases of truth tables, and the pack files that no folder holds.

    Args:
        tables: files with the columns of `truth.csv`; the first row of a name counts.
        folders: where the pack files may lie. Loose lattices have no file and are made in code.
    """
    cases: dict[str, Case] = {}
    missing = []
    for row in (row for table in tables for row in _rows(table)):
        case = _loose(row) if not row["file"] else _stored(row, folders)
        if case is not None:
            cases.setdefault(case.name, case)
        elif row["file"]:
            missing.append(row["file"])
    return list(cases.values()), missing


def _rows(table: Path) -> Iterator[dict[str, str]]:
    with table.open(newline="") as file:
        yield from csv.DictReader(file)


def _stored(row: dict[str, str], folders: list[Path]) -> Case | None:
    path = next(
        (folder / row["file"] for folder in folders if (folder / row["file"]).exists()), None
    )
    if path is None:
        return None
    pack = read_pack(path)[0].turned(row["axis"])
    lattice = path.stem.startswith("lattice_")
    name = row["case"] if lattice else path.stem.removeprefix("pack")
    spread = np.ptp(pack.grains().radius) > 1e-3 * pack.grains().radius.mean()
    group = LATTICE if lattice else UNEQUAL if spread else EQUAL
    return _case(row, name if row["axis"] == "x" else f"{name} {row['axis']}", group, pack)


def _loose(row: dict[str, str]) -> Case | None:
    solid = row["case"].removeprefix("SC_")
    if solid not in map(str, LOOSE_SOLIDS):
        return None
    return _case(row, f"SC c = {solid}", LOOSE, simple_cubic(float(solid)))


def _case(row: dict[str, str], name: str, group: str, pack: Snapshot) -> Case:
    return Case(
        name=name,
        group=group,
        pack=pack,
        k=float(row["k_mm2"]) * MM**2,
        error=float(row["relative_error"].rstrip("%")) / 100.0,
        ratio=float(row["k_over_k0"]) if row["k_over_k0"] else None,
    )


def simple_cubic(solid: float, repeat: int = 3) -> Snapshot:
    """Simple cubic lattice of grains of the truth's radius at volume fraction `solid`."""
    edge = RADIUS * (4.0 / 3.0 * np.pi / solid) ** (1.0 / 3.0)
    place = (
        np.stack(np.meshgrid(*[np.arange(repeat)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        + 0.5
    )
    return snapshot(
        place * edge, np.full(repeat**3, RADIUS), repeat * edge, np.full(repeat**3, Kind.GRAIN)
    )
