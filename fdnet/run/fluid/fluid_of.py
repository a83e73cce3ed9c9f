"""The fluid that drives the fines of a case, where fdnet computes it while LIGGGHTS waits."""

from fdnet.case.case import InvasionCase
from fdnet.dem.fluid import Fluid
from fdnet.run.fluid.network_fluid import NetworkFluid
from fdnet.run.fluid.uniform import UniformCrowd
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.snapshot import Snapshot


def fluid_of(case: InvasionCase, scales: InvasionScales, grains: Snapshot) -> Fluid | None:
    """The fluid of a coupled case; None where the deck holds the forces itself."""
    if case.drag.field == "network":
        return NetworkFluid(case=case, scales=scales, grains=grains)
    return UniformCrowd(case=case, scales=scales) if case.drag.coupled else None
