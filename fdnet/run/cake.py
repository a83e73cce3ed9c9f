"""The cake and the filtrate.

The external cake: porosity and permeability by depth, and its share of the resistance.

The resistance of a bed of thickness h and permeability k is h / k, 1/m; that of slices in series
is their sum. k comes from the network of the cake's own spheres where there are enough of them,
and from Carman's and Kozeny's eps^3 d^2 / (180 (1 - eps)^2) of each slice in any case. Their
constant is that of packed beds: the permeability of a cake is that of its packed slices, and a
cake with too few of these has none.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fdnet.errors import FlowError, NetworkError
from fdnet.network.specimen import cake_of
from fdnet.network.states import Log, Sides, cut_out, measure_all_spheres
from fdnet.scales.flow import carman_kozeny
from fdnet.spheres.geometry import measure_porosity
from fdnet.spheres.snapshot import Array, Snapshot, one_line

ENOUGH, THICK = 100, 3.0
"""Fewest fines of a cake that a network resolves, and least thickness in mean diameters of one
that has a permeability."""
MOST = 20_000
"""Most fines of a cake that is resolved: the network of more takes minutes."""
PACKED = 0.7
"""Porosity up to which a slice is a packed bed: above it Carman's and Kozeny's constant of 5 is
low by more than a sixth (5.8 for spheres at 0.7, 7.2 at 0.8, 11.3 at 0.9; Happel and Brenner 1965,
Low Reynolds number hydrodynamics, table 8-4.2)."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Cake:
    """The cake in B slices of a mean diameter, from its front to the formation face.

    Attributes:
        edges: (B+1,) m, x; the last is the face.
        count: (B,) number of fines centred in the slice.
        porosity: (B,) void over volume.
        diameter: (B,) m, Sauter mean of these fines.
        k_kozeny: (B,) m2, by Carman and Kozeny; inf in an empty slice, too high in a loose one.
        k_network: (B,) m2, in place in the network of the cake; None where it is not resolved.
        unresolved: why not, in words; "" where it is.
    """

    edges: Array
    count: Array
    porosity: Array
    diameter: Array
    k_kozeny: Array
    k_network: Array | None
    unresolved: str

    __repr__ = one_line

    @property
    def thickness(self) -> float:
        """Of the whole cake, m."""
        return float(self.edges[-1] - self.edges[0])

    @property
    def packed(self) -> Array:
        """(B,) whether the slice is a packed bed."""
        return self.porosity <= PACKED

    @property
    def packed_thickness(self) -> float:
        """Of the packed slices together, m."""
        return float(np.sum(np.diff(self.edges)[self.packed]))

    @property
    def packed_permeability(self) -> float | None:
        """By Carman and Kozeny, m2, of the packed slices in series; None where `too_thin`."""
        if self.too_thin:
            return None
        resistance = np.sum((np.diff(self.edges) / self.k_kozeny)[self.packed])
        return self.packed_thickness / float(resistance)

    @property
    def too_thin(self) -> str:
        """Why the cake has no permeability of its own, in words; "" where it has one."""
        layers = self.packed_thickness / float(np.average(self.diameter, weights=self.count))
        if layers >= THICK:
            return ""
        if not self.packed.any():
            return "loose all through, without a permeability of its own"
        return (
            f"packed for {layers:.1f} diameters of a fine, too thin for a permeability of its own "
            f"({THICK:g} are needed)"
        )

    def resistance(self, permeability: Array) -> float:
        """Of the slices in series, 1/m."""
        with np.errstate(divide="ignore"):
            return float(np.sum(np.diff(self.edges) / permeability))


def measure_cake(spheres: Snapshot, sides: Sides) -> Cake | None:
    """The cake of `spheres`, grains and fines; None where no fine upstream touches the pack."""
    face = float(spheres.box[0, 0])
    cake = cake_of(spheres, sides.periodic)
    if not len(cake):
        return None
    thickness = face - float(np.min(cake.position[:, 0] - cake.radius))
    mean = 2.0 * float(np.mean(cake.radius))
    slices = max(1, math.ceil(thickness / mean - 0.5))
    edges = face - thickness * np.linspace(1.0, 0.0, slices + 1)
    edges[-1] = face
    reaching = spheres.where(spheres.position[:, 0] >= face).joined(cake)
    bed = cut_out(reaching, (float(edges[0]), face), (False, *sides.periodic[1:]))
    porosity = measure_porosity(bed, periodic=sides.periodic, edges=edges).profile
    where = np.clip(np.searchsorted(edges, cake.position[:, 0], "right") - 1, 0, slices - 1)
    cube, square = (np.bincount(where, cake.radius**power, slices) for power in (3, 2))
    diameter = np.full(slices, float(np.sum(cake.radius**3) / np.sum(cake.radius**2)))
    diameter = 2.0 * np.divide(cube, square, out=diameter, where=square > 0)
    resolved, unresolved = _resolved(bed, edges, sides, fines=len(cake), layers=thickness / mean)
    kozeny = [
        carman_kozeny(void, d) if void < 1.0 else math.inf
        for void, d in zip(porosity, diameter, strict=True)
    ]
    return Cake(
        edges=edges,
        count=np.bincount(where, minlength=slices),
        porosity=porosity,
        diameter=diameter,
        k_kozeny=np.array(kozeny),
        k_network=resolved,
        unresolved=unresolved,
    )


def _resolved(
    bed: Snapshot, edges: Array, sides: Sides, *, fines: int, layers: float
) -> tuple[Array | None, str]:
    """Permeability (B,) m2 of the slices in place in the network of the bed, or why not."""
    missed = []
    if fines < ENOUGH:
        missed.append(f"has {fines} fines, and a network needs {ENOUGH}")
    if fines > MOST:
        missed.append(f"has {fines} fines, and a network takes {MOST}")
    if layers < THICK:
        missed.append(f"is {layers:.1f} diameters of a fine thick, and a network needs {THICK:g}")
    if missed:
        return None, f"the cake {' and '.join(missed)}"
    around = replace(sides, periodic=(False, *sides.periodic[1:]))
    try:
        state = measure_all_spheres(bed, edges[[0, -1]], sides=around, log=Log()).state
    except (NetworkError, FlowError) as error:
        return None, f"the cake makes no network: {error}"
    from fdnet.network.flow.sections import inplace_permeability

    return inplace_permeability(state.network, state.flow, edges, state.halves), ""


def cake_rows(cake: Cake) -> list[dict[str, Any]]:
    """The slices as cake.csv names their values, from the face outwards."""
    order = range(len(cake.count))[::-1]
    return [
        {
            "x_lo_m": float(cake.edges[i]),
            "x_hi_m": float(cake.edges[i + 1]),
            "fines_count": int(cake.count[i]),
            "porosity": float(cake.porosity[i]),
            "sauter_diameter_m": float(cake.diameter[i]),
            "k_kozeny_m2": float(cake.k_kozeny[i]) if cake.packed[i] else None,
            "k_network_m2": None if cake.k_network is None else float(cake.k_network[i]),
        }
        for i in order
    ]


def resistance_share(cake: float, pack: float) -> float:
    """R_cake / (R_cake + R_pack) of two beds in series; 0 where the pack lets nothing through."""
    return cake / (cake + pack) if math.isfinite(pack) else 0.0


def cake_summary(
    cake: Cake | None, pack: float, *, flow: float | None = None
) -> Mapping[str, Any]:
    """The keys that the cake adds to summary.json; `pack` is the resistance of the pack, 1/m.

    `flow` is the cake's share of the resistance by the flow itself, where that follows the
    deposit; else the share is by the network of the cake, or by Carman and Kozeny.
    """
    if cake is None:
        return {"cake_resistance_share": flow or 0.0, "cake": None}
    kozeny, k, packed = cake.resistance(cake.k_kozeny), cake.packed_permeability, cake.packed
    network = None if cake.k_network is None else cake.resistance(cake.k_network)
    thick = np.diff(cake.edges)[packed]
    porosity = float(np.average(cake.porosity[packed], weights=thick)) if packed.any() else None
    shares = {
        "flow": flow,
        "network": None if network is None else resistance_share(network, pack),
        "kozeny": resistance_share(kozeny, pack),
    }
    by = next(name for name, share in shares.items() if share is not None)
    table = {
        "fines": int(cake.count.sum()),
        "slices": len(cake.count),
        "packed_thickness_m": cake.packed_thickness,
        "porosity": porosity,
        "k_kozeny_m2": k,
        "k_network_m2": cake.thickness / network if network else None,
        "resistance_kozeny_1_m": kozeny,
        "resistance_network_1_m": network,
        "resistance_pack_1_m": pack if math.isfinite(pack) else None,
        "share_kozeny": shares["kozeny"],
        "share_network": shares["network"],
        "share_by": by,
        "unresolved": cake.unresolved,
        "too_thin": cake.too_thin,
    }
    bed = {
        "thickness_m": cake.thickness,
        "porosity": porosity,
        "k_carman_kozeny_m2": k,
        "resistance_1_m": kozeny,
    }
    return {
        "cake_resistance_share": shares[by],
        "cake_by_depth": table,
        "cake": None if k is None else bed,
    }


# ------------------------------------------------------------------------------------------------
# The filtrate over time: a cake that grows at constant pressure, fitted and extrapolated.
#
# Each volume of filtrate leaves its solids on the cake, so the resistance of the cake is as the
# volume V per area: dV/dt = dp / (mu (R + alpha V)). Its integral is quadratic in V,
#
#     t = a V^2 + b V + c,  a = mu alpha / (2 dp),  b = mu R / dp,  c = 0
#
# (Ruth 1935). Late in time V goes as sqrt(t / a), the line of the API's filtration tests, which
# name a spurt 2 V(7.5 min) - V(30 min), where that line meets t = 0 (API RP 13I).


HALF_HOUR = 1800.0
"""s; the API's filter press runs for 30 minutes."""
FEWEST, FALLEN, MISFIT, CAKE_SHARE = 8, 0.5, 0.02, 0.5
"""What a fit needs: so many points, a last rate below this share of the first, an rms misfit of
at most this share of the whole time, and at the end at least this share of the resistance in the
cake, for the law is the cake's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Filtration:
    """t = a V^2 + b V + c of a filtrate V per area.

    Attributes:
        a: s/m2.
        b: s/m.
        c: s.
        misfit: rms difference of the times over the whole time.
        until: s, last time of the data.
        unsupported: why nothing may be extrapolated, in words; "" where it may.
    """

    a: float
    b: float
    c: float
    misfit: float
    until: float
    unsupported: str

    def volume(self, time: float) -> float:
        """Filtrate per area, m, at `time` s."""
        root = self.b**2 + 4.0 * self.a * (time - self.c)
        return (np.sqrt(root) - self.b) / (2.0 * self.a)

    @property
    def half_hour(self) -> float:
        """Filtrate per area at 30 minutes, m3/m2: an extrapolation."""
        return self.volume(HALF_HOUR)

    @property
    def intercept(self) -> float:
        """2 V(7.5 min) - V(30 min), m3/m2; below 0 where the pack itself holds back."""
        return 2.0 * self.volume(HALF_HOUR / 4.0) - self.half_hour

    @property
    def spurt(self) -> float:
        """The spurt, m3/m2: the intercept, or 0 where that is below 0."""
        return max(0.0, self.intercept)


def cake_share(updates: Sequence[Mapping[str, float]]) -> float | None:
    """Share of the last drop of pressure that the cake takes up; None where no flow says it."""
    last = updates[-1] if updates else {}
    drop = last.get("pressure_cake_Pa", 0.0) + last.get("pressure_pack_Pa", 0.0)
    return last["pressure_cake_Pa"] / drop if drop > 0 else None


def fit_filtration(time: Array, volume: Array, cake_share: float = 1.0) -> Filtration | None:
    """The fit to filtrate per area (N,) m at `time` (N,) s; None with fewer than four points.

    `cake_share` is the share of the last drop of pressure that the cake takes up. The fit is least
    squares in t. Nothing is extrapolated from a history whose rate hardly fell, that
    is not curved as a growing cake's, or that the formula does not meet.
    """
    time, volume = np.asarray(time, float), np.asarray(volume, float)
    use = np.concatenate([[True], np.diff(volume) > 0]) if len(volume) else np.zeros(0, bool)
    time, volume = time[use], volume[use]
    if len(time) < 4:
        return None
    whole, scale = float(time[-1] - time[0]), float(np.ptp(volume))
    unit = volume / scale
    columns = np.stack([unit**2, unit, np.ones_like(unit)], axis=1)
    (a, b, c), *_ = np.linalg.lstsq(columns, time, rcond=None)
    misfit = float(np.sqrt(np.mean((columns @ (a, b, c) - time) ** 2)) / whole)
    rates = np.diff(volume) / np.diff(time)
    rate, unsupported = float(rates[-1] / rates[0]), ""
    if len(time) < FEWEST:
        unsupported = f"{len(time)} points of the history; {FEWEST} are needed"
    elif rate > FALLEN:
        unsupported = f"the rate only fell to {rate:.2f} of the first; below {FALLEN:g} is needed"
    elif cake_share < CAKE_SHARE:
        unsupported = (
            f"the cake has {100 * cake_share:.0f} % of the resistance of cake and pack, at least "
            f"{100 * CAKE_SHARE:g} % is needed: the pack shapes the history"
        )
    elif a / scale**2 <= 0:
        unsupported = "the history is not curved as that of a growing cake"
    elif misfit > MISFIT:
        unsupported = (
            f"t is not quadratic in V: the misfit is {100 * misfit:.2g} % of the time, at most "
            f"{100 * MISFIT:g} % is needed"
        )
    return Filtration(
        a=float(a / scale**2),
        b=float(b / scale),
        c=float(c),
        misfit=misfit,
        until=float(time[-1]),
        unsupported=unsupported,
    )
