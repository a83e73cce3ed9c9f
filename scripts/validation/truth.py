"""The packs and slabs of known permeability, read from one file, `truth.npz`.

The file holds spheres (as whole numbers of digits, so every value of the tables that they came
from is kept to the last digit) and tables of text:

- `packs`: permeability of periodic packs and lattices; its columns are those of `Case`;
- `slabs`: the same of slabs cut out of specimens that LIGGGHTS packed and invaded (`Slab`);
- `pack_grids`, `slab_grids`: every grid that was solved, from which the values are extrapolated;
- `recipes`, `specimens`: what a pack is made of, and the keys of a specimen's case.

`known_before` is "yes" where the author of the laws had seen the value before choosing them, "no"
where it was put aside before the laws that "auto" took for it were last touched, and "later" where
it was put aside before any of the laws were.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fdnet.errors import CaseError
from fdnet.spheres.snapshot import Array, Kind, Snapshot, resting

MM = 1e-3
RADIUS = 0.5
"""Mean radius of the grains of the packs, mm."""
FILE = Path(__file__).with_suffix(".npz")
EQUAL, UNEQUAL = "random, equal grains", "random, unequal grains"
LATTICE, LOOSE = "touching lattices", "loose lattices"
GROUPS = EQUAL, UNEQUAL, LATTICE, LOOSE
YES, LATER = "yes", "later"
GRAINS, DEPOSIT = "grains", "deposit"
"""What is solid in a row of `slab_grids`: the grains alone, or the fines too."""
SLAB_NUMBERS = ("x_lo_mm", "x_hi_mm", "k0_mm2", "k_mm2", "k_over_k0")
Rows = list[dict[str, str]]


class Case(NamedTuple):
    """A periodic pack of known permeability `k` (m2), with the flow along its x axis.

    Its `name` is that of the table and the axis of the flow unless it is x; `group` is one of the
    four above. `error` is relative; `ratio` is `k` over that of the grains alone, None without
    fines. `known_before` is "" for loose lattices, which are not counted.
    """

    name: str
    group: str
    pack: Snapshot
    k: float
    error: float
    ratio: float | None
    known_before: str


class Slab(NamedTuple):
    """A slab of a specimen between two `planes` (x in m) of constant pressure.

    `k0` and `k` (m2) are without and with the deposit, `ratio` is `k` over `k0`, and `error` the
    relative error of `ratio`. The formation face is at 0.
    """

    name: str
    specimen: str
    planes: tuple[float, float]
    k0: float
    k: float
    ratio: float
    error: float
    known_before: str


@cache
def _stored(path: Path) -> Mapping[str, Array]:
    if not path.exists():
        raise CaseError(f"{path} is not there: it comes with the source of fdnet")
    with np.load(path) as file:
        return dict(file)


def names(path: Path = FILE) -> list[str]:
    """The names of all packs and specimens."""
    return [str(name) for name in _stored(path)["name"]]


def read_table(name: str, path: Path = FILE) -> Rows:
    """The rows of a table, as text by column."""
    header, *rows = _stored(path)[f"table {name}"].tolist()
    return [dict(zip(header, row, strict=True)) for row in rows]


def read_pack(name: str, path: Path = FILE) -> Snapshot:
    """The spheres of a pack or specimen, m, with its box.

    Packs repeat along all axes, specimens along y and z; fines upstream of the formation face of
    a specimen have x below 0.
    """
    stored = _stored(path)
    which = names(path).index(name)
    part = slice(*stored["first"][which : which + 2])
    lengths = stored["digits"][part] / 10.0 ** stored["decimals"][part] * MM
    box = np.stack([np.zeros(3), stored["edge_mm"][which] * MM], axis=1)
    kind = np.where(stored["fine"][part], Kind.FINE, Kind.GRAIN)
    return resting(lengths[:, :3], lengths[:, 3], box, kind)


def write_truth(path: Path, packs: Mapping[str, Snapshot], tables: Mapping[str, Rows]) -> None:
    """Writes the file anew, lengths in mm with nine significant digits.

    Every row of a table has the columns of its first.
    """
    digits, decimals = zip(*(_digits(pack) for pack in packs.values()), strict=True)
    kept: dict[str, Any] = {
        "name": np.array(list(packs)),
        "edge_mm": np.array([np.round(pack.box[:, 1] / MM, 9) for pack in packs.values()]),
        "first": np.cumsum([0, *map(len, packs.values())]),
        "digits": np.concatenate(digits),
        "decimals": np.concatenate(decimals),
        "fine": np.concatenate([pack.kind == Kind.FINE for pack in packs.values()]),
    }
    for name, rows in tables.items():
        kept[f"table {name}"] = np.array([list(rows[0]), *(list(row.values()) for row in rows)])
    part = path.with_suffix(".part.npz")
    np.savez_compressed(part, **kept)
    part.replace(path)


def _digits(pack: Snapshot) -> tuple[Array, Array]:
    """Whole numbers (N, 4) and how many of their digits are decimals, of lengths in mm."""
    lengths = np.column_stack([pack.position, pack.radius]) / MM
    texts = [f"{value:.9g}" for value in lengths.ravel()]
    short = [np.format_float_positional(float(text), trim="-") for text in texts]
    decimals = [len(text.partition(".")[2]) for text in short]
    whole = [round(float(text) * 10.0**count) for text, count in zip(texts, decimals, strict=True)]
    shape = lengths.shape
    return np.array(whole, np.int32).reshape(shape), np.array(decimals, np.uint8).reshape(shape)


def percent(text: str) -> float:
    """A share from a cell such as 0.3%."""
    return float(text.rstrip("%")) / 100.0


def cases(only: Sequence[str] = ()) -> Iterator[Case]:
    """The packs of known permeability, or those with the names `only`; loose lattices first."""
    for row in read_table("packs"):
        name, group = row["name"], row["group"]
        if not name or (only and name not in only):
            continue
        loose = group == LOOSE
        pack = simple_cubic(float(name.split()[-1])) if loose else read_pack(row["spheres"])
        ratio = float(row["k_over_k0"]) if row["k_over_k0"] else None
        k, error = float(row["k_mm2"]) * MM**2, percent(row["relative_error"])
        yield Case(name, group, pack.turned(row["axis"]), k, error, ratio, row["known_before"])


def slabs(only: Sequence[str] = ()) -> Iterator[Slab]:
    """The slabs of known permeability, or those with the names `only`."""
    for row in read_table("slabs"):
        if not only or row["slab"] in only:
            low, high, k0, k, ratio = (float(row[name]) for name in SLAB_NUMBERS)
            planes, error = (low * MM, high * MM), percent(row["relative_error"])
            truth = (k0 * MM**2, k * MM**2, ratio, error, row["known_before"])
            yield Slab(row["slab"], row["specimen"], planes, *truth)


def simple_cubic(solid: float, repeat: int = 3) -> Snapshot:
    """Simple cubic lattice of grains of `RADIUS` at volume fraction `solid`."""
    edge = RADIUS * MM * (4.0 / 3.0 * np.pi / solid) ** (1.0 / 3.0)
    place = np.indices((repeat,) * 3).reshape(3, -1).T + 0.5
    return resting(place * edge, RADIUS * MM, np.array([[0.0, repeat * edge]] * 3))


def tiled(
    pack: Snapshot, times: Sequence[int], share: float, rng: np.random.Generator
) -> Snapshot:
    """`times` (3,) copies of a periodic pack along the axes, each sphere of them moved at random.

    Spheres move by up to `share` of their radius along each axis.
    """
    size = np.ptp(pack.box, axis=1)
    steps = np.indices(times).reshape(3, -1).T[:, None]
    position = (pack.position + steps * size).reshape(-1, 3)
    radius, kind = np.tile(pack.radius, len(steps)), np.tile(pack.kind, len(steps))
    low, whole = pack.box[:, 0], np.array(times) * size
    moved = position + share * radius[:, None] * rng.uniform(-1, 1, position.shape)
    box = np.stack([low, low + whole], axis=1)
    return resting(low + (moved - low) % whole, radius, box, kind)
