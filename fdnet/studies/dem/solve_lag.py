"""How far a network that is solved now and then lags behind one that is solved at every update.

One invasion is followed. At each of its updates the network is solved for the deposit that is
there, and compared with the last solve that each threshold would have made. So every threshold
sees the same deposits, and no chance is in the differences.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.dem.invade_deck import FluidForces, Moment
from fdnet.dem.invasion import invade
from fdnet.dem.liggghts import Launch
from fdnet.network.fines.deposit import KeptDeposit
from fdnet.network.laws.section_archie import STEP as STEP_OF_ANALYSIS
from fdnet.network.laws.section_archie import KeptSections, measured_sections
from fdnet.run.fluid import NetworkFluid
from fdnet.run.network_flow import Carried, changed_share
from fdnet.scales.scales import invasion_scales
from fdnet.spheres.snapshot import Snapshot, one_line

THRESHOLDS = (0.05, 0.1, 0.15, 0.2, 0.3, 0.5)
"""Shares of the deposit by volume that may change before the network is solved anew."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LagRow:
    """One threshold over all updates with a deposit.

    Attributes:
        threshold: share of the deposit by volume that may change.
        updates: number of updates with a deposit.
        solves: at so many of them the network was solved.
        k_mean: mean of k over that of a network solved at every update, less 1.
        k_rms: root mean square of it.
        k_most: its largest size.
        flux_rms: root mean square of the difference of the fluxes of the pores over their clean
            ones, weighted by the clean flux.
    """

    threshold: float
    updates: int
    solves: int
    k_mean: float
    k_rms: float
    k_most: float
    flux_rms: float


@dataclass(slots=True, eq=False)
class LagOf:
    """The lag of one threshold, update by update."""

    threshold: float
    solved: Snapshot | None = None
    carried: Carried | None = None
    solves: int = 0
    k: list[float] = field(default_factory=list)
    flux: list[float] = field(default_factory=list)

    __repr__ = one_line

    def see(self, fines: Snapshot, now: Carried, weight: np.ndarray, *, anew: bool) -> None:
        """Take in an update: its deposit, and what the network solved for it carries."""
        if anew or self.carried is None or changed_share(self.solved, fines) > self.threshold:
            self.solved, self.carried, self.solves = fines, now, self.solves + 1
        self.k.append(self.carried.k_over_k0 / now.k_over_k0 - 1.0)
        self.flux.append(float(weight @ (self.carried.ratio - now.ratio) ** 2))

    def row(self) -> LagRow:
        """What all updates together say."""
        k = np.array(self.k)
        return LagRow(
            threshold=self.threshold,
            updates=len(k),
            solves=self.solves,
            k_mean=float(k.mean()),
            k_rms=float(np.sqrt(np.mean(k**2))),
            k_most=float(np.abs(k).max()),
            flux_rms=float(np.sqrt(np.mean(self.flux))),
        )


class WatchedFluid:
    """A `NetworkFluid` that answers as it always does, and is watched at each update."""

    def __init__(self, fluid: NetworkFluid, thresholds: Sequence[float]) -> None:
        self.fluid, self.lags = fluid, [LagOf(threshold) for threshold in thresholds]
        self.measured = fluid.measured
        self._sections: KeptSections | None = None
        self._deposit: KeptDeposit | None = None

    def forces(self, spheres: Snapshot, moment: Moment) -> FluidForces:
        """What acts on the fines of `spheres`, in their order."""
        answer, pack = self.fluid.forces(spheres, moment), self.fluid.pack
        deposit = self.fluid.renewal.deposit
        if deposit is not None and len(deposit.fines):
            fines, self._deposit = deposit.fines, deposit
            self._sections = pack.sections(fines, self._sections)
            now = pack.carried(self._sections.factor, deposit.in_pores)
            weight = pack.through / pack.through.sum()
            for lag in self.lags:
                lag.see(fines, now, weight, anew=moment.fresh)
        return answer

    def finer_sections(self) -> float:
        """k by the sections of the analysis over k by those of the loop, less 1, at the end."""
        deposit, pack, now = self._deposit, self.fluid.pack, self._sections
        if deposit is None or now is None:
            return 0.0
        finer = measured_sections(
            pack.network, deposit.fines, parts=pack.parts, step=STEP_OF_ANALYSIS
        )
        k, known = (pack.carried(one.factor, deposit.in_pores).k_over_k0 for one in (finer, now))
        return k / known - 1.0


def lag_rows(
    case: InvasionCase, grains: Snapshot, folder: Path, launch: Launch
) -> Iterator[dict[str, object]]:
    """One row for each of `THRESHOLDS`, from an invasion of `case` made in `folder`.

    `k_finer_sections` is the same in all rows, see `WatchedFluid.finer_sections`.
    """
    scales = invasion_scales(case)
    fluid = WatchedFluid(NetworkFluid(case=case, scales=scales, grains=grains), THRESHOLDS)
    invade(case, scales, grains, folder, launch, fluid=fluid)
    finer = {"k_finer_sections": fluid.finer_sections()}
    yield from (asdict(lag.row()) | finer for lag in fluid.lags)
