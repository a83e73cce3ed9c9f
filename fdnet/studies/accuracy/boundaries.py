"""What walls and cut planes do to the permeability, and how fast that fades with size.

`tiled`: periodic packs tiled 1, 2, 3 times and cut as a box with walls in y and z, or in x, y and
z, over the periodic pack; with the grains centred inside alone, and with those that reach in.
`slabs`: slabs of 1, 2, ... grain diameters cut out of the periodic pack.
`walled`: packs made by LIGGGHTS between walls, with side walls that slip and that hold the fluid,
over the k of their own inner part. The law is the default one; seeds stand in the rows.
"""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.case.file import case_from
from fdnet.dem.binary import find_binary
from fdnet.dem.liggghts import Launch
from fdnet.dem.packing import make_pack
from fdnet.network.flow.flow import Flow
from fdnet.network.flow.slabs import plane_pressures, slab_permeability, whole_permeability
from fdnet.network.laws.named import DEFAULT_LAW, LAWS
from fdnet.network.network import WALLS, Network, build_network
from fdnet.scales.darcy import carman_kozeny
from fdnet.scales.scales import scales_of
from fdnet.spheres.images import make_images
from fdnet.spheres.porosity import measure_porosity
from fdnet.spheres.snapshot import Array, Snapshot, resting
from fdnet.studies.truth.packs import read_pack, tiled

Row = dict[str, Any]
SIDES = {
    "periodic": (True, True, True),
    "walls y z": (True, False, False),
    "walls x y z": (False, False, False),
}


def solved(
    pack: Snapshot, periodic: tuple[bool, bool, bool], walls: str = "slip"
) -> tuple[Network, Flow, float]:
    """Network, flow and k (m2) of a pack."""
    network = build_network(pack, periodic=periodic, walls=walls)
    k, flow = whole_permeability(network, LAWS[DEFAULT_LAW](network))
    return network, flow, k


def with_neighbours(pack: Snapshot, periodic: tuple[bool, bool, bool]) -> Snapshot:
    """A periodic pack and those of its images that reach in across sides that become walls."""
    margin = np.where(periodic, np.nan, float(pack.radius.max()))
    images = make_images(
        pack.position, pack.box, periodic=(True,) * 3, margin=margin, tolerance=0.0
    )
    return resting(images.position, pack.radius[images.owner], pack.box, pack.kind[images.owner])


def tiled_rows(packs: Sequence[Path], tiles: int) -> Iterator[Row]:
    """k of walled boxes over the periodic k, for packs tiled 1 to `tiles` times."""
    for path in packs:
        pack = read_pack(path)[0].grains()
        reference = solved(pack, SIDES["periodic"])[2]
        for times in range(1, tiles + 1):
            for sides, periodic in list(SIDES.items())[1:]:
                big = tiled(pack, np.full(3, times))
                diameters = float(np.ptp(big.box[0]) / (2 * big.radius.mean()))
                for grains, cut in (
                    ("centred inside", big),
                    ("reaching in", with_neighbours(big, periodic)),
                ):
                    k = solved(cut, periodic)[2]
                    yield {
                        "pack": path.stem,
                        "tiles": times,
                        "grains": len(big),
                        "width_diameters": diameters,
                        "sides": sides,
                        "cut": grains,
                        "k_m2": k,
                        "k_over_periodic": k / reference,
                    }


def slab_rows(packs: Sequence[Path], places: int) -> Iterator[Row]:
    """k of cut-out slabs over the periodic k, at `places` depths of each thickness."""
    for path in packs:
        pack = tiled(read_pack(path)[0].grains(), np.full(3, 2))
        network, _, reference = solved(pack, SIDES["periodic"])
        conductance, length = LAWS[DEFAULT_LAW](network), float(np.ptp(pack.box[0]))
        diameter = 2 * float(pack.radius.mean())
        for thick in range(1, int(length / 2 / diameter) + 1):
            starts = (np.arange(places) + 0.5) / places * (0.5 * length)
            ratios = [
                slab_permeability(network, conductance, (start, start + thick * diameter))[0]
                / reference
                for start in starts
            ]
            yield {
                "pack": path.stem,
                "thickness_diameters": thick,
                "slabs": places,
                "mean_k_over_periodic": float(np.mean(ratios)),
                "least": min(ratios),
                "most": max(ratios),
                "series_mean": float(1 / np.mean(1 / np.array(ratios))),
            }


def walled_rows(counts: Sequence[int], rim: float, *, porosity: float, seed: int) -> Iterator[Row]:
    """k of LIGGGHTS packs between walls over that of their inner part.

    Args:
        counts: numbers of grains, one for each pack.
        rim: grain diameters left out at every side.
        porosity: of the whole pack.
        seed: of the packing.
    """
    binary = find_binary()
    for count in counts:
        edge = (count * 4 / 3 * np.pi * 0.25**3 / (1 - porosity)) ** (1 / 3)
        case = case_from(
            {
                "name": f"walled_{count}",
                "seed": seed,
                "box": {"size_mm": [edge] * 3, "sides": "walls"},
                "grains": {"radius_mm": 0.25, "porosity": porosity},
                "fines": {"radius_mm": 0.05, "count": 1},
                "fluid": {},
            }
        )
        with tempfile.TemporaryDirectory() as folder:
            pack = make_pack(
                case, scales_of(case), Path(folder) / "pack", Launch(binary=binary)
            ).grains
        yield {"grains": len(pack), "seed": seed, "width_diameters": edge / 0.5} | walled_row(
            pack, rim
        )


def walled_row(pack: Snapshot, rim: float) -> dict[str, float]:
    """k of a pack between walls over that of its inner part, for both kinds of wall."""
    diameter = 2.0 * float(pack.radius.mean())
    core = pack.box + rim * diameter * np.array([1, -1])
    whole, inside = (
        measure_porosity(replace(pack, box=box), periodic=(False,) * 3).mean
        for box in (pack.box, core)
    )
    row = {"porosity": whole, "porosity_inner": inside}
    for walls in WALLS:
        network, flow, k = solved(pack, SIDES["walls x y z"], walls)
        inner = inner_permeability(network, flow, core)
        name = walls.replace("-", "_")
        row |= {f"k_{name}_m2": k, f"k_inner_{name}_m2": inner, f"k_over_inner_{name}": k / inner}
    return row | {
        "inner_over_carman_kozeny": inner / carman_kozeny(inside, diameter),
        "k_over_carman_kozeny": k / carman_kozeny(whole, diameter),
    }


def inner_permeability(network: Network, flow: Flow, core: Array) -> float:
    """k (m2) of the part within `core` (3, 2) m.

    It is the volume mean of the flux along x over the mean pressure gradient.
    """
    ends = network.throat_ends
    along = np.diff(ends[:, :, 0], axis=1)[:, 0]
    share = np.ones(len(along))
    for axis in range(3):
        start, end = np.sort(ends[:, :, axis], axis=1).T
        span = np.maximum(end - start, 1e-12 * network.grain_radius)
        share = share * np.clip(
            (np.minimum(end, core[axis, 1]) - np.maximum(start, core[axis, 0])) / span, 0.0, 1.0
        )
    velocity = float(np.sum(flow.throat_flux * along * share) / np.prod(np.ptp(core, axis=1)))
    high, low = plane_pressures(network, flow, core[0])
    return velocity * float(np.ptp(core[0])) / float(high - low)
