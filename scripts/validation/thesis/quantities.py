"""What is measured on each run, and on its first millimetre.

FIELDS holds sizes of each pore or throat of the first millimetre, SINGLES numbers of that
section, which the thesis examines in section 3.3 (Shi 2011).
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import binomtest

from fdnet.names import ALL_SPHERES, DEFAULT_LAW
from fdnet.network.flow.sections import reduction
from fdnet.network.laws.damage import CLOGGING, DEPOSITION
from fdnet.network.network import Network
from fdnet.network.permeability import Analysis, compare
from fdnet.spheres.snapshot import Array
from validation.thesis import published as known
from validation.thesis.runs import Planned, State

MM, SECTIONS = 1e-3, 8


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """The state of one run, and its analyses by the thesis's laws and by fdnet's own."""

    item: Planned
    state: State
    thesis: Analysis
    own: Analysis

    @property
    def depth(self) -> Array:
        """(F,) m, depth of each fine centred in the specimen."""
        low, high = self.state.damaged.box[0]
        x = self.state.damaged.fines().position[:, 0]
        return x[(x >= low) & (x < high)] - low


def examine(item: Planned, state: State) -> Run:
    """Analyse a state with the sections and bins of its case."""
    laws = [("thesis", "thesis"), (DEFAULT_LAW, ALL_SPHERES)]
    how: Any = {"periodic": state.case.periodic, "options": state.case.analysis}
    return Run(item, state, *compare(state.grains, state.damaged, laws=laws, **how))


def share(part: Array, weights: Any = 1.0) -> float:
    """Share (by weight) of the values (N,) that are true; nan where there are none."""
    weights = np.broadcast_to(weights, part.shape)
    total = float(np.sum(weights))
    return float(np.sum(weights[part])) / total if total > 0 else math.nan


# ---- Numbers of a whole run: results.csv.
def deep_near_wall(run: Run) -> float:
    """Share of the fines beyond 1 mm centred within a mean grain radius of a side wall."""
    box, place = run.state.damaged.box, run.state.damaged.fines().position
    place = place[(place[:, 0] >= box[0, 0] + MM) & (place[:, 0] < box[0, 1])]
    to_wall = np.minimum(place - box[:, 0], box[:, 1] - place)[:, 1:].min(axis=1)
    near = to_wall < run.state.case.grains.mean_radius_m
    return math.nan if any(run.state.case.periodic) else share(near)


def result_rows(run: Run) -> list[dict[str, Any]]:
    """Rows of results.csv, one for each pair of laws; NAME_1 to NAME_8 are those of the sections.

    Porosity counts overlap once; shares of fines are by number; reductions are 1 - k/k0, of slabs
    cut out and in place. Counts of the thesis are for specimens of its size alone.
    """
    return [_row(run, analysis) for analysis in (run.thesis, run.own)]


def _row(run: Run, a: Analysis) -> dict[str, Any]:
    depth, end, told = run.depth, run.state.ending, known.thesis_of(run.item.id)
    counts = {} if run.item.group == "quick" else told
    inplace = [reduction(one.k_initial_inplace, one.k_damaged_inplace) for one in a.sections]
    first = a.sections[0]
    return {
        "id": run.item.id,
        "seed": run.item.seed,
        "digest": run.state.case.digest(),
        "law": a.law,
        "damage_law": a.damage_law,
        "porosity_initial": a.porosity_initial,
        "porosity_damaged": a.porosity_damaged,
        "porosity_loss_first_mm": first.porosity_initial - first.porosity_damaged,
        "invaded_count": a.invaded_count,
        "count_first_mm": int(np.sum(depth < MM)),
        "invasion_depth_mm": 1e3 * a.invasion_depth,
        "invasion_depth_p95_mm": 1e3 * a.invasion_depth_p95,
        "mean_depth_mm": 1e3 * float(depth.mean()) if len(depth) else math.nan,
        "fraction_first_0p25mm": share(depth < 0.25 * MM),
        "fraction_first_mm": share(depth < MM),
        "fraction_beyond_0p5mm": share(depth >= 0.5 * MM),
        "fraction_deep_near_wall": deep_near_wall(run),
        "k_reduction": a.k_reduction,
        **_numbered("k_reduction", [one.k_reduction for one in a.sections]),
        **_numbered("k_reduction_inplace", inplace),
        "k_initial_m2": a.k_initial,
        "k_damaged_m2": a.k_damaged,
        "throats": len(a.network.throat_radius),
        "throats_blocked": 0 if a.occupancy is None else int(a.occupancy.blocked.sum()),
        "supplied_count": end["supplied"],
        "passed_count": end["passed"],
        "cake_thickness_mm": 1e3 * a.cake_thickness,
        "stop_reason": end["stop_reason"],
        "time_ms": 1e3 * end["steps"] * end["dt_s"],
        "seconds": float(end["seconds"]),
        "pack_seconds": float(end["pack_seconds"]),
        "max_overlap": float(end["max_overlap"]),
        "thesis_damaged_porosity": told.get("damaged_porosity", [math.nan])[0],
        "thesis_depth_mm": float(told.get("invaded_depth_mm", math.nan)),
        "thesis_invaded_count": float(counts.get("invaded_count", math.nan)),
        **_numbered("thesis_k_reduction", known.reductions(told)),
        "thesis_fraction_first_bin": told.get("fraction_first_bin", math.nan),
        "thesis_fraction_beyond_0p5mm": told.get("fraction_beyond_0p5mm", math.nan),
        "thesis_face_porosity_loss": told.get("face_porosity_loss", math.nan),
        "thesis_count_first_mm": float(counts.get("count_first_mm", math.nan)),
    }


def _numbered(name: str, values: Sequence[float | None]) -> dict[str, float]:
    filled = [*values, *[None] * SECTIONS][:SECTIONS]
    return {f"{name}_{i}": math.nan if v is None else v for i, v in enumerate(filled, 1)}


# ---- The first millimetre: statistics.csv.
WHOLE = "pores of four grains, throats between two such"
CUT = "with those cut by a face, by the part inside"


class Section(NamedTuple):
    """Pores (P) and throats (T) of a run, weighted for the first millimetre by WHOLE or CUT: 1 for
    one that counts whole and 0 for one elsewhere; `throat_depth` is that of its middle, m."""

    run: Run
    network: Network
    fines: Any
    weight: Mapping[str, Array]
    throat_depth: Array


def first_section(run: Run, reading: str) -> Section:
    """The pores and throats centred within 1 mm of the face; facets within one polyhedron are no
    throats. WHOLE counts pores of four grains of the specimen and throats between two such; CUT
    also those cut by its faces, each by the part inside, which together fill the section."""
    network, face = run.thesis.network, run.thesis.network.box[0, 0]
    group = network.pore_group[network.throat_pores]
    depth = network.throat_ends[:, :, 0].mean(axis=1)
    pore = network.pore_position[:, 0] < face + MM
    throat = (depth < face + MM) & (group[:, 0] != group[:, 1])
    pores, throats = network.pore_share, network.throat_share
    if reading == WHOLE:
        pores = (network.pore_share == 1.0).astype(float)
        throats = pores[network.throat_pores].all(axis=1).astype(float)
    weight = {"pore": np.where(pore, pores, 0.0), "throat": np.where(throat, throats, 0.0)}
    return Section(run, network, run.thesis.occupancy, weight, depth - face)


POROSITY = "porosity of throats with fines"
FIELDS: Mapping[str, tuple[str, str, Callable[[Section], Array]]] = {
    "pore radius": ("mm", "pore", lambda s: 1e3 * s.network.pore_radius),
    "throat radius": ("mm", "throat", lambda s: 1e3 * s.network.throat_radius),
    "throat length": ("mm", "throat", lambda s: 1e3 * s.network.throat_length),
    "pore volume": ("mm3", "pore", lambda s: 1e9 * s.network.pore_volume),
    "volume of the inscribed sphere of a pore": (
        "mm3",
        "pore",
        lambda s: 4e9 / 3.0 * np.pi * s.network.pore_radius**3,
    ),
    "pore volume with fines": (
        "mm3",
        "pore",
        lambda s: 1e9 * (s.network.pore_volume - s.fines.pore_solid_volume),
    ),
    "throat depth": ("mm", "throat", lambda s: 1e3 * s.throat_depth),
    POROSITY: ("", "throat", lambda s: s.fines.throat_porosity),
    "conductance": ("mm3", "throat", lambda s: 1e9 * s.run.thesis.conductance_initial),
    "conductance with fines": ("mm3", "throat", lambda s: 1e9 * s.run.thesis.conductance_damaged),
}
"""Quantities of each pore or throat: unit, whose weight counts, values."""


def weighted(section: Section, name: str) -> tuple[Array, Array]:
    """Values of one of FIELDS and their weights; POROSITY counts throats with fines alone."""
    _, of, values = FIELDS[name]
    counted = section.fines.throat_fines > 0 if name == POROSITY else 1.0
    return values(section), section.weight[of] * counted


def within(values: Array, between: tuple[float, float]) -> Array:
    """Whether each value (N,) lies in [low, high); a low end of 0 also takes in what overlap puts
    below it, and a high end of 1, a porosity's, what is at it."""
    low, high = between[0] or -math.inf, between[1] if between[1] != 1.0 else math.inf
    return np.asarray((values >= low) & (values < high))


def _of_throats(part: Callable[[Any], Array]) -> Callable[[Section], float]:
    return lambda s: share(part(s.fines), s.weight["throat"])


def _filled(section: Section, what: str) -> float:
    """Volume of fines, mm3. A fine counts in every throat that it reaches, for throats overlap."""
    solid = getattr(section.fines, f"{what}_solid_volume")
    return 1e9 * float(np.sum(section.weight[what] * solid))


def _free(section: Section, what: str) -> float:
    """Share of throats' cylinders, or of pore bodies, that no fine fills."""
    network = section.network
    cylinders = np.pi * network.throat_radius**2 * network.throat_length
    volume = cylinders if what == "throat" else network.pore_volume
    return 1.0 - _filled(section, what) / (1e9 * float(np.sum(section.weight[what] * volume)))


def _mean_porosity(section: Section) -> float:
    values, weights = weighted(section, POROSITY)
    return float(np.average(values, weights=weights))


def _in_throats(section: Section) -> float:
    return _filled(section, "throat") / (_filled(section, "throat") + _filled(section, "pore"))


SINGLES: Mapping[str, tuple[str, Callable[[Section], float]]] = {
    "throats without fines": ("share", _of_throats(lambda fines: fines.throat_fines == 0)),
    "throats with fines": ("share", _of_throats(lambda fines: fines.throat_fines > 0)),
    "throats blocked": ("share", _of_throats(lambda fines: fines.blocked)),
    "throats of radius 0": (
        "count",
        lambda s: float(np.sum((s.weight["throat"] > 0) & (s.network.throat_radius == 0))),
    ),
    "mean porosity of throats with fines": ("", _mean_porosity),
    "overall throat porosity": ("", lambda s: _free(s, "throat")),
    "overall pore-body porosity": ("", lambda s: _free(s, "pore")),
    "volume of fines in throats": ("mm3", lambda s: _filled(s, "throat")),
    "volume of fines in pore bodies": ("mm3", lambda s: _filled(s, "pore")),
    "share of throats in the volume of fines": ("share", _in_throats),
}
"""Numbers of a section, with their units."""


def measure(section: Section, quantity: str, between: known.Between) -> tuple[float, str]:
    """One of SINGLES with its unit, or the share of one of FIELDS in a range."""
    if between is None:
        unit, value = SINGLES[quantity]
        return value(section), unit
    values, weights = weighted(section, quantity)
    return share(within(values, between), weights), "share"


def statistics(run: Run) -> Iterator[dict[str, Any]]:
    """Rows of statistics.csv: every quantity that the thesis has for any specimen, by the readings
    WHOLE and CUT. Those of the section's grains tessellated alone, the thesis's own reading, were
    made by an earlier script."""
    wanted = dict.fromkeys(known.key_of(one) for one in known.published()["statistic"])
    for reading in (WHOLE, CUT):
        section = first_section(run, reading)
        for quantity, between in wanted:
            words, (ours, unit) = quantity, measure(section, quantity, between)
            if between is not None:
                words += f" {between[0]:g} to {between[1]:g} {FIELDS[quantity][0]}"
            one = known.statistics_of(run.item.id).get((quantity, between), {})
            row = {"id": run.item.id, "seed": run.item.seed, "source": one.get("source", "")}
            row |= {"quantity": words.strip(), "ours": ours, "thesis": one.get("value", math.nan)}
            row |= {"sense": one.get("sense", ""), "unit": unit}
            yield row | {"note": "; ".join(filter(None, (reading, one.get("note"))))}


# ---- Where fines sit in throats (Shi 2011, Figures 56 and 57): deposition.csv.
def fines_in_class(section: Section, between: tuple[float, float]) -> Mapping[str, Array]:
    """The K pairs of a fine and a throat of porosity in [low, high) that it reaches.

    `distance` of the fine's centre from the axis over the throat's radius, `volume` m3 of it
    within the throat, `weight` and index of the `throat`.
    """
    fines, weight = section.fines, section.weight["throat"]
    use = (within(fines.throat_porosity, between) & (weight > 0))[fines.pair_throat]
    throat = fines.pair_throat[use]
    pairs = {"distance": fines.pair_distance[use], "volume": fines.pair_volume[use]}
    return pairs | {"weight": weight[throat], "throat": throat}


def deposition(run: Run) -> Iterator[dict[str, Any]]:
    """Rows of deposition.csv: shares of the fines by place, for classes of throat porosity.

    `law` is by the thesis's rule: deposition where most fines are nearer the wall or beyond it.
    `decided` tells whether the 95 % interval of that share, of independent fines, leaves out 1/2.
    """
    section = first_section(run, WHOLE)
    for claim in known.published()["deposition"]:
        told = claim if run.item.name.startswith("specimen5") else {}
        fines = fines_in_class(section, claim["throat_porosity"])
        near, far = fines["distance"] < 0.5, fines["distance"] > 1.0
        parts = {"nearer_axis": near, "nearer_wall": ~near & ~far, "beyond_wall": far}
        weight, total = fines["weight"], float(np.sum(fines["weight"]))
        shares = {name: share(part, weight) for name, part in parts.items()}
        for name, part in parts.items():
            shares[f"{name}_volume"] = share(part, weight * fines["volume"])
        wall, low, high = 1.0 - shares["nearer_axis"], math.nan, math.nan
        if total:  # Wilson 1927, J. Am. Stat. Assoc. 22, 209
            low, high = binomtest(round(wall * total), int(total)).proportion_ci(method="wilson")
        least, most = claim["throat_porosity"]
        row = {"id": run.item.id, "seed": run.item.seed, "low": least, "high": most, "whole": True}
        row["throats"] = float(np.sum(section.weight["throat"][np.unique(fines["throat"])]))
        row |= {"fines": total, **shares, "wall_low": low, "wall_high": high}
        row["law"] = "" if not total else DEPOSITION if wall > 0.5 else CLOGGING
        row |= {"decided": low > 0.5 or high < 0.5, "nearer": told.get("nearer", "")}
        row |= {"thesis": told.get("value", math.nan), "sense": told.get("sense", "")}
        yield row | {"source": claim["source"]}
