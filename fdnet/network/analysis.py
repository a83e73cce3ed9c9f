"""What the analysis of a specimen gives."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from fdnet.network.fines.occupancy import Occupancy
from fdnet.network.flow.depth import Layers
from fdnet.network.flow.flow import Flow
from fdnet.network.flow.sections import Profile, Section
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Analysis:
    """Permeability, porosity and fines of a specimen before and after damage, in SI units.

    P pores, T throats. "Damaged" is with the fines; without fines it equals "initial". When the
    grains moved, `network` and every value by pore or throat are of their final positions, while
    `k_initial` and the initial values of the sections are of their first positions.

    Attributes:
        network: pores and throats of the grains.
        occupancy: what the fines fill of each pore and throat; None without fines.
        law: name of the conductance law.
        damage_law: name of the damage law that was asked for.
        damage_law_used: the one that `k_damaged` and the sections are from, where "auto" was asked
            for the one that it took; None without fines.
        damage_law_other: name of the second damage law, of the network of the grains, where it
            was computed as well; else None. Values by pore and throat are then by it.
        k_damaged_other: permeability with fines by that law, m2; else None. The difference to
            `k_damaged` is a measure of the error. It is by the network alone, also where
            `k_initial` is by resolved flow in part.
        conductance_initial: (T,) clean conductance of each throat, m3 (flux times viscosity over
            pressure drop).
        conductance_damaged: (T,) the same with fines, m3.
        law_used: (T,) text, which rule of the damage law applied.
        flow_initial: pressures and fluxes without fines.
        flow_damaged: pressures and fluxes with fines.
        k_initial: permeability without fines, m2.
        k_damaged: permeability with fines, m2.
        k_moved: permeability of the moved grains without fines, m2; None when no grain moved.
        k_reduction: 1 - k_damaged / k_initial; None where k_initial is 0.
        porosity_initial: porosity without fines, overlap of spheres counted once.
        porosity_initial_error: standard error of `porosity_initial`.
        porosity_initial_sum: porosity without fines from the plain sum of the spheres' volumes.
        porosity_damaged: porosity with fines, overlap of spheres counted once.
        sections: slabs across the flow, each with its own permeability and porosity.
        profile: porosity and fines in finer bins of depth.
        layers: permeability and pressure drop of thin layers of the first millimetre; None unless
            the network of all spheres was solved.
        invaded_count: number of fines centred in the specimen.
        invaded_volume: their volume, m3.
        invasion_depth: depth of the deepest of them, m.
        invasion_depth_p95: depth above which 95 % of them lie, m.
        cake_thickness: thickness of the cake upstream of the formation face, m.
        solver: method, residual and mass balance, the worst of all solves.
        copies: how often a periodic cell of a few grains was repeated along x, y and z, so that it
            can be tessellated. The network and the values by pore and throat are of all copies.
        counts: how many pores, throats and spheres were closed, replaced or left out, by reason.
        warnings: doubts about the result, in words.
        seconds: run time of each step of the analysis, s.
    """

    network: Network
    occupancy: Occupancy | None
    law: str
    damage_law: str
    damage_law_used: str | None
    damage_law_other: str | None
    k_damaged_other: float | None
    conductance_initial: Array
    conductance_damaged: Array
    law_used: Array
    flow_initial: Flow
    flow_damaged: Flow
    k_initial: float
    k_damaged: float
    k_moved: float | None
    k_reduction: float | None
    porosity_initial: float
    porosity_initial_error: float
    porosity_initial_sum: float
    porosity_damaged: float
    sections: tuple[Section, ...]
    profile: Profile
    layers: Layers | None
    invaded_count: int
    invaded_volume: float
    invasion_depth: float
    invasion_depth_p95: float
    cake_thickness: float
    solver: Mapping[str, str | float | None]
    copies: tuple[int, int, int]
    counts: Mapping[str, int]
    warnings: tuple[str, ...]
    seconds: Mapping[str, float]

    def __repr__(self) -> str:
        pores, throats = len(self.network.pore_radius), len(self.network.throat_radius)
        return (
            f"Analysis(k_initial={self.k_initial:.4g} m2, k_damaged={self.k_damaged:.4g} m2, "
            f"porosity={self.porosity_initial:.4f} -> {self.porosity_damaged:.4f}, "
            f"{pores} pores, {throats} throats, {len(self.sections)} sections, "
            f"law={self.law}, damage_law={self.damage_law_used or self.damage_law})"
        )


APART = 1.25
"""Ratio of two laws' permeabilities from which a warning says that they differ."""


def laws_apart(taken: tuple[str, float], other: tuple[str, float]) -> Iterator[str]:
    """A warning where the k (m2) of two laws, each with its name, differ by much."""
    (name, k), (second, k_second) = taken, other
    low, high = min(k, k_second), max(k, k_second)
    if high <= APART * low:
        return
    start = f"two ways of measuring the damage differ: {second} gives {k_second:.4g} m2"
    if low > 0:
        more = "above" if k_second > k else "below"
        yield (
            f"{start}, {more} the {k:.4g} m2 of {name} (the larger is {high / low:.2f} times the "
            "smaller); take the difference as the error of the damaged permeability"
        )
    else:
        yield f"{start}, {name} {k:.4g} m2; one of them finds no open path"


def worst_solve(flows: Sequence[Flow]) -> dict[str, str | float | None]:
    """Method of the first solve, and the worst residual and mass balance of all."""
    balances = [flow.mass_balance for flow in flows if flow.mass_balance is not None]
    return {
        "method": flows[0].method,
        "residual": max(flow.residual for flow in flows),
        "mass_balance": max(balances) if balances else None,
    }
