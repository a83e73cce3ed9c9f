"""The cases of known permeability: packs with their truth, what they belong to, and what was known of them when."""

import csv
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fdnet.spheres.snapshot import Kind, Snapshot
from fdnet.studies.truth.packs import MM, RADIUS, read_pack, snapshot

EQUAL, UNEQUAL, LATTICE, LOOSE = (
    "random, equal grains",
    "random, unequal grains",
    "touching lattices",
    "loose lattices",
)
LOOSE_SOLIDS = (0.45, 0.343, 0.216)
# intact packs looked at before the law was chosen, by its author's account
SEEN = {
    "A_200_eps40",
    "B_200_eps36",
    "C_80_eps40",
    "E_80_eps30",
    "F_80_eps45",
    "G_100_radii12_eps38",
}
SEEN |= {"H_40_eps40", "I_80_eps45", "SC_touching", "BCC_touching", "FCC_touching"}
SEEN_DAMAGED = {
    "C_r10_d2",
    "C_r10_d5",
    "C_r10_d8",
    "C_r5_d2",
    "C_r5_d5",
    "C_r5_d8",
    "C_r5_half",
    "C_r5_half y",
}
SEEN_DAMAGED |= {"E_r5_d4", "F_r5_d10", "H_r5_d13", "H_r5_d20", "H_r5_half"}
# truth that was not in the table yet when the law was committed (85c004e intact, ebff107 damaged)
LATER = {"N_100_radii13_eps40", "H_r5_d17", "H_r5_d1", "H_r10_d10"}


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Case:
    """A periodic pack with the flow along its x axis: `k` m2 with relative `error`, and `ratio` = k / k intact where it
    holds fines."""

    name: str
    group: str
    pack: Snapshot
    k: float
    error: float
    ratio: float | None

    @property
    def known(self) -> str:
        """Whether its truth was looked at before the law was chosen: yes; no; later: solved after the law was
        committed; empty for loose lattices, which play no part in that count."""
        if self.group == LOOSE:
            return ""
        if self.name in LATER:
            return "later"
        return "yes" if self.name in (SEEN if self.ratio is None else SEEN_DAMAGED) else "no"


def read_cases(tables: list[Path], folders: list[Path]) -> tuple[list[Case], list[str]]:
    """Cases of the truth tables whose pack lies in one of `folders`, loose lattices made in code; and the files that
    rows name but no folder holds."""
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
    pack = turned(read_pack(path)[0], "xyz".index(row["axis"]))
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


def turned(pack: Snapshot, axis: int) -> Snapshot:
    """The pack with `axis` as x (a rotation)."""
    order = np.roll(np.arange(3), -axis)
    return replace(pack, position=pack.position[:, order], box=pack.box[order])


def all_grains(pack: Snapshot) -> Snapshot:
    """The same spheres, fines taken as grains."""
    return replace(pack, kind=np.full(len(pack), Kind.GRAIN))
