"""The fluid that drives the fines of a case, where fdnet computes it while LIGGGHTS waits."""

from fdnet.case.case import InvasionCase
from fdnet.dem.fluid import Fluid
from fdnet.run.fluid.uniform import UniformCrowd
from fdnet.scales.scales import InvasionScales


def fluid_of(case: InvasionCase, scales: InvasionScales) -> Fluid | None:
    """The fluid of a coupled case; None where the deck holds the forces itself."""
    return UniformCrowd(case=case, scales=scales) if case.drag.coupled else None
