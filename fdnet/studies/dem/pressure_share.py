"""What a deposit takes of the drop of pressure: by the network, and by resolved Stokes flow."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from fdnet.network.field.field import velocity_field
from fdnet.run.finished import open_run
from fdnet.run.network_flow import Renewal, pack_flow
from fdnet.spheres.snapshot import Snapshot


@dataclass(frozen=True, slots=True, kw_only=True)
class ShareRow:
    """One deposit on one grid. Shares are those of the drop of pressure times the area.

    Attributes:
        run: name of the folder of the run.
        fines: number of fines wholly within the pack, all taken as standing.
        cells: of the resolved flow, across a mean grain.
        share_network: that the network gives to the fines.
        share_resolved: that the resolved flow gives to them.
        k_over_k0_network: permeability left by the network.
        k_over_k0_resolved: by the resolved flow, with and without the fines on the same grid.
    """

    run: str
    fines: int
    cells: float
    share_network: float
    share_resolved: float
    k_over_k0_network: float
    k_over_k0_resolved: float


def share_rows(runs: Sequence[Path], cells: Sequence[float]) -> Iterator[dict[str, object]]:
    """One row for each finished run and each number of cells. Raises what `open_run` raises."""
    for path in runs:
        run = open_run(path)
        case, grains = run.case, run.spheres().grains()
        fines = _within(run.spheres().fines(), case.size_m[0])
        pack = pack_flow(grains, case.periodic, case.analysis.walls)
        carried, _ = Renewal(pack).of(fines, anew=True)
        on_fines = float(carried.pressed.groups[:, 0].sum())
        for across in cells:
            clean = velocity_field(grains, periodic=case.periodic, cells=across)
            damaged = velocity_field(grains, periodic=case.periodic, fines=fines, cells=across)
            resolved = float(damaged.fine_force[:, 0].sum())
            row = ShareRow(
                run=path.name,
                fines=len(fines),
                cells=across,
                share_network=on_fines / (on_fines + float(carried.pressed.grains[0])),
                share_resolved=resolved / (resolved + float(damaged.grain_force[:, 0].sum())),
                k_over_k0_network=carried.k_over_k0,
                k_over_k0_resolved=clean.resistance / damaged.resistance,
            )
            yield asdict(row)


def _within(fines: Snapshot, length: float) -> Snapshot:
    """The fines of a pack of `length` m that no face cuts."""
    x = fines.position[:, 0]
    return fines.where(np.minimum(x, length - x) > fines.radius)
