"""fdnet: formation damage from the grains up.

    import fdnet

    fdnet.permeability(points, radii, box)        plain arrays in mm: k_m2, k_mD, porosity
    run = fdnet.run_case("cases/quick.toml")      the whole story of one specimen, in a run folder
    run = fdnet.open_run("runs/quick")            the same run later
    run.k_damaged_mD, run.lost, run.plot()        its numbers, tables, spheres and network
    runs = fdnet.open_runs("runs/mine-8")         an ensemble: mean, band, by_depth()

Spheres from files are `read_spheres`, step by step it is `build_network`, `measure_occupancy` and
`solve_flow`, many runs are `ensemble`, `sweep` and `compare_runs`; `core_flood` and
`well_invasion` carry a run to a core and a well. Every error is an `FdnetError`.
`dir(fdnet)` lists what is public; the packages of fdnet are its inside and may change.
Importing fdnet loads nothing heavy; a name is loaded when it is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fdnet.campaign.api import compare_runs as compare_runs
    from fdnet.campaign.api import ensemble as ensemble
    from fdnet.campaign.api import open_runs as open_runs
    from fdnet.campaign.api import sweep as sweep
    from fdnet.case.case import Case as Case
    from fdnet.case.case import InvasionCase as InvasionCase
    from fdnet.case.file import case_from as case_from
    from fdnet.case.file import read_case as read_case
    from fdnet.errors import CaseError as CaseError
    from fdnet.errors import DeckError as DeckError
    from fdnet.errors import DumpError as DumpError
    from fdnet.errors import FdnetError as FdnetError
    from fdnet.errors import FlowError as FlowError
    from fdnet.errors import LiggghtsError as LiggghtsError
    from fdnet.errors import MechanicsError as MechanicsError
    from fdnet.errors import NetworkError as NetworkError
    from fdnet.formation.scale_up import core_flood as core_flood
    from fdnet.formation.scale_up import hand_up as hand_up
    from fdnet.formation.scale_up import well_invasion as well_invasion
    from fdnet.mechanics.of_case import elastic_moduli as elastic_moduli
    from fdnet.mechanics.of_case import triaxial_test as triaxial_test
    from fdnet.network.field.field import velocity_field as velocity_field
    from fdnet.network.fines.occupancy import measure_occupancy as measure_occupancy
    from fdnet.network.flow.flow import solve_flow as solve_flow
    from fdnet.network.laws.named import DAMAGE_LAWS as DAMAGE_LAWS
    from fdnet.network.laws.named import LAWS as LAWS
    from fdnet.network.network import build_network as build_network
    from fdnet.network.permeability import analyse as analyse
    from fdnet.network.permeability import compare as compare
    from fdnet.network.permeability import permeability as permeability
    from fdnet.run.finished import open_run as open_run
    from fdnet.run.pipeline import run_case as run_case
    from fdnet.spheres.readers import read_spheres as read_spheres
    from fdnet.spheres.snapshot import Snapshot as Snapshot

    __version__: str

# Public names, by the module that they come from.
_HOMES = {
    "fdnet.case.case": "Case InvasionCase",
    "fdnet.case.file": "case_from read_case",
    "fdnet.run.pipeline": "run_case",
    "fdnet.run.finished": "open_run",
    "fdnet.campaign.api": "open_runs ensemble sweep compare_runs",
    "fdnet.formation.scale_up": "core_flood hand_up well_invasion",
    "fdnet.spheres.snapshot": "Snapshot",
    "fdnet.spheres.readers": "read_spheres",
    "fdnet.network.permeability": "permeability analyse compare",
    "fdnet.network.network": "build_network",
    "fdnet.network.fines.occupancy": "measure_occupancy",
    "fdnet.network.flow.flow": "solve_flow",
    "fdnet.network.field.field": "velocity_field",
    "fdnet.mechanics.of_case": "elastic_moduli triaxial_test",
    "fdnet.network.laws.named": "LAWS DAMAGE_LAWS",
    "fdnet.errors": "FdnetError CaseError DeckError LiggghtsError DumpError NetworkError "
    "FlowError MechanicsError",
}
_HOME = {name: home for home, names in _HOMES.items() for name in names.split()}
__all__ = ["__version__", *_HOME]  # noqa: PLE0604


if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """Load a public name at its first use, or find the version."""
        if name == "__version__":
            from importlib.metadata import version

            value = version("fdnet")
        elif name in _HOME:
            value = getattr(import_module(_HOME[name]), name)
        else:
            raise AttributeError(f"module 'fdnet' has no attribute {name!r}")
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    """The public names."""
    return sorted(__all__)
