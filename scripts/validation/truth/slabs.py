"""Slabs of deposits that LIGGGHTS made, for the Stokes truth: their names and files."""

import re
from dataclasses import dataclass
from pathlib import Path

from fdnet.errors import CaseError
from fdnet.spheres.readers import read_spheres
from fdnet.spheres.snapshot import KIND_NAMES, Kind, Snapshot
from validation.truth.packs import DATA, MM

SLAB_FOLDER = DATA / "slabs"
SLAB_GRIDS, SLAB_TRUTH, SLAB_SPECIMENS = "grids.csv", "truth.csv", "specimens.csv"
YES, NO, LATER = "yes", "no", "later"


@dataclass(frozen=True, slots=True, kw_only=True)
class Slab:
    """A slab of a specimen, across the flow.

    Attributes:
        name: of the slab in the tables.
        specimen: name of the sphere file, without its suffix.
        x_lo_mm: where it begins; the formation face is at 0.
        x_hi_mm: where it ends.
        cells: of the grids on which it is solved, on its longest edge.
        known_before: "yes" where the laws may have been shaped on its truth; "no" where it was put
            aside before the laws that "auto" took for it were last touched; "later" where it was
            put aside before any of the laws were.
    """

    name: str
    specimen: str
    x_lo_mm: float
    x_hi_mm: float
    cells: tuple[int, ...]
    known_before: str


def read_specimen(path: Path) -> Snapshot:
    """The spheres of a specimen's file, m, with its box; y and z are periodic.

    Fines upstream of the face have x below 0.

    Raises:
        CaseError: the first line does not give the box.
    """
    first = re.match(r"# box ([0-9.]+) x ([0-9.]+) x ([0-9.]+) mm", path.read_text())
    if not first:
        raise CaseError(f"{path}:1: expected '# box LENGTH x WIDTH x HEIGHT mm'")
    box = [(0.0, float(edge)) for edge in first.groups()]
    return read_spheres(path, units="mm", box=box)


def write_specimen(path: Path, spheres: Snapshot, note: str) -> None:
    """Writes a specimen's file in mm with 7 significant digits, `note` in its first line."""
    size = " x ".join(f"{edge / MM:.9g}" for edge in spheres.box[:, 1])
    names = {int(kind): name for name, kind in KIND_NAMES.items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w") as file:
        file.write(
            f"# box {size} mm from 0, y and z periodic, flow along x; lengths in mm; {note}\n"
            "x,y,z,radius,kind\n"
        )
        for place, radius, kind in zip(
            spheres.position / MM, spheres.radius / MM, spheres.kind, strict=True
        ):
            numbers = ",".join(f"{value:.7g}" for value in (*place, radius))
            file.write(f"{numbers},{names[Kind(int(kind))]}\n")
