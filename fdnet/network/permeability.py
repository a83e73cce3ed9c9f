"""Permeability of a pack before and after fines: the whole network analysis of one specimen."""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from html import escape
from itertools import product
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from fdnet.case.tables import M2_PER_MD, AnalysisChoices, AnalysisKeys, with_visible_choices
from fdnet.errors import CaseError, Doubt, explained
from fdnet.names import ALL_SPHERES, AUTO, SECTION_ARCHIE, law_pairs
from fdnet.network.fines.occupancy import Occupancy
from fdnet.network.flow.flow import Flow
from fdnet.network.flow.sections import (
    Layers,
    Profile,
    Section,
    make_profile,
    make_sections,
    reduction,
    thin_slabs,
)
from fdnet.network.laws.damage import CLEAN
from fdnet.network.laws.named import LAWS
from fdnet.network.network import Network
from fdnet.network.specimen import (
    Invaded,
    as_snapshot,
    measure_specimen,
    pack_doubts,
    specimen_doubts,
)
from fdnet.network.states import Log, Measured, at_most_the_grains, few_throats, make_layers
from fdnet.spheres.snapshot import Array, Directions, Snapshot, frozen, sides_of

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Analysis(Invaded):
    """Permeability, porosity and fines of a specimen before and after damage, in SI units.

    P pores, T throats. "Damaged" is with the fines; without fines it equals "initial". When the
    grains moved, `network` and every value by pore or throat are of their final positions, while
    `k_initial` and the initial values of the sections are of their first positions. What invaded
    is `invaded_count`, `invaded_volume`, `invasion_depth`, `invasion_depth_p95` and
    `cake_thickness` of `Invaded`.

    Attributes:
        network: pores and throats of the grains.
        occupancy: what the fines fill of each pore and throat; None without fines.
        law: name of the conductance law.
        damage_law: name of the damage law that was asked for.
        damage_law_used: the one that `k_damaged` and the sections are from; None without fines.
        damage_law_other: name of the second damage law, of the network of the grains, where it
            was computed as well; else None. Values by pore and throat are then by it.
        k_damaged_other: permeability with fines by that law, m2; else None. The difference to
            `k_damaged` is a measure of the error.
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
        solver: method, residual and mass balance, the worst of all solves.
        copies: how often a periodic cell of a few grains was repeated along x, y and z; the
            network and the values by pore and throat are of all copies.
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


UNLIKELY = ("no-sand", "no-packing", "impossible-permeability", "outside-the-box")
"""Kinds of warnings that a wrong unit of length leads to; `analyse` says them aloud."""
APART = 1.25  # Ratio of two laws' permeabilities from which a warning says that they differ


def laws_apart(taken: tuple[str, float], other: tuple[str, float]) -> Iterator[str]:
    """A warning where the k (m2) of two laws, each with its name, differ by much."""
    (name, k), (second, k_second) = taken, other
    low, high = min(k, k_second), max(k, k_second)
    start = f"two ways of measuring the damage differ: {second} gives {k_second:.4g} m2"
    if low > 0 and high > APART * low:
        more = "above" if k_second > k else "below"
        yield Doubt(
            "laws-apart",
            f"{start}, {more} the {k:.4g} m2 of {name} (the larger is {high / low:.2f} times the "
            "smaller); take the difference as the error of the damaged permeability",
        )
    elif high > APART * low:
        yield Doubt("laws-apart", f"{start}, {name} {k:.4g} m2; one of them finds no open path")


@with_visible_choices
def analyse(
    spheres: Snapshot | tuple[Any, ...],
    damaged: Snapshot | None = None,
    *,
    periodic: Directions | None = None,
    axis: str = "x",
    options: AnalysisChoices | None = None,
    **choices: Unpack[AnalysisKeys],
) -> Analysis:
    """Permeability of a pack of grains, without and with the fines in it.

    `fdnet.permeability` is shorter for spheres in plain arrays.

    Args:
        spheres: grains and fines, or grains as arrays (points, radii) or (points, radii, box), m.
            When `damaged` is given, its grains before the invasion.
        damaged: the same grains, moved or not, and all fines. Without it, `spheres` holds the
            fines, or there are none.
        periodic: sides that repeat: letters such as "yz", three truth values (x, y, z), or one
            for all; without it those that the spheres know. The other sides of the box are walls;
            along the flow they are the inlet and the outlet.
        axis: direction of the flow, "x", "y" or "z". The result has it as its x, as
            `Snapshot.turned` does.
        options: choices of the analysis, for example `case.analysis`. Without it: one section,
            profile bins of a mean grain radius, fdnet's default laws.
        choices: single choices by name, in place of those of `options`: `sections` (a count, or
            edges in m), `law`, `damage_law`, `clogging_threshold`, `middle_band`,
            `throat_overlap`, `profile_bin_mm`, `walls`.

    Returns:
        Permeabilities (m2), porosities, sections, profile, network and flows. No open path is no
        error: the permeability is 0 and `warnings` gives the reason. A number that no sand has is
        also a warning of Python's: the unit of length is probably another one.

    Raises:
        CaseError: a choice is unknown or outside its range, or `spheres` cannot be used.
        NetworkError: the geometry is degenerate, or the grains of the two snapshots differ.
        FlowError: the solve fails its checks.

    Examples:
        Touching spheres of 1 mm on a simple cubic lattice (k = 0.00252 d^2, Zick and Homsy 1982):

        >>> import fdnet, numpy as np
        >>> lattice = 1e-3 * (np.indices((3, 3, 3)).reshape(3, -1).T + 0.5)
        >>> spheres = fdnet.Snapshot.from_arrays(lattice, 0.5e-3)
        >>> result = fdnet.analyse(spheres, periodic="xyz")
        >>> print(f"{result.k_initial:.2g} m2, porosity {result.porosity_initial:.3f}")
        2.5e-09 m2, porosity 0.476

    """
    chosen = _chosen(options, choices)
    pair = (chosen.law, chosen.damage_law)
    more: dict[str, Any] = {"periodic": periodic, "axis": axis, "options": chosen}
    result = next(compare(spheres, damaged, laws=[pair], **more))
    _say_aloud(result)
    return result


def _say_aloud(result: Analysis) -> None:
    """What is unlikely about a result as warnings of Python's, at the line that asked for it."""
    for one in result.warnings:
        if isinstance(one, Doubt) and one.kind in UNLIKELY:
            warnings.warn(explained(one), stacklevel=3)


@with_visible_choices
def compare(
    spheres: Snapshot | tuple[Any, ...],
    damaged: Snapshot | None = None,
    *,
    periodic: Directions | None = None,
    axis: str = "x",
    laws: Sequence[tuple[str, str]] | None = None,
    options: AnalysisChoices | None = None,
    **choices: Unpack[AnalysisKeys],
) -> Iterator[Analysis]:
    """The same pack under several pairs of laws; otherwise as `analyse`.

    What does not depend on the laws (tessellation, occupancy, porosity) is measured once, and the
    clean pack is solved once for each conductance law.

    Args:
        spheres, damaged, periodic, axis, options, choices: as for `analyse`.
        laws: pairs (law, damage law). Without it every law with every damage law, or with the
            chosen one where there are no fines.

    Yields:
        One `Analysis` (permeabilities in m2) for each pair, in their order; its `seconds` are
        those that this pair added.

    Raises:
        CaseError, NetworkError, FlowError: as `analyse`.

    Examples:
        >>> import fdnet, numpy as np
        >>> lattice = 1e-3 * (np.indices((3, 3, 3)).reshape(3, -1).T + 0.5)
        >>> spheres = fdnet.Snapshot.from_arrays(lattice, 0.5e-3)
        >>> pairs = [("thesis", "thesis"), ("lubrication", "section-archie")]
        >>> for result in fdnet.compare(spheres, periodic="xyz", laws=pairs):
        ...     print(f"{result.law}: {result.k_initial:.1e} m2")
        thesis: 1.4e-09 m2
        lubrication: 2.5e-09 m2
    """
    base, spheres = _chosen(options, choices), as_snapshot(spheres)
    damaged = None if damaged is None else as_snapshot(damaged, "damaged")
    around = sides_of(spheres, periodic)
    if axis != "x":
        spheres = replace(spheres, periodic=around).turned(axis)
        around = sides_of(spheres, None)
        damaged = None if damaged is None else damaged.turned(axis)
    if damaged is None and len(spheres.fines()):
        damaged = spheres
    if laws is None:
        laws = law_pairs() if damaged is not None else list(product(LAWS, [base.damage_law]))
    chosen = [base.changed(law=law, damage_law=damage_law) for law, damage_law in laws]
    log = Log()
    specimen = measure_specimen(spheres, damaged, periodic=around, choices=base, timed=log.timed)
    measured = Measured(specimen=specimen, log=log)
    for one in chosen:
        yield _analysis(measured, one)
        measured.log = Log()


# ---- One call for spheres in plain arrays.
THINNEST = 1e-3  # Least volume of spheres over that of their box that is no slip of units
_DIGITS: Any = {"index": False, "float_format": "{:.4g}".format}


@dataclass(frozen=True, slots=True, eq=False, kw_only=True, repr=False)
class Permeability:
    """What `fdnet.permeability` returns: numbers of a pack, along one axis or all three.

    Where all axes were asked for, permeabilities are arrays (3,) along x, y and z.

    Attributes:
        axis: "x", "y", "z" or "all".
        k_m2: permeability with the fines, m2.
        k_initial_m2: permeability without them, m2.
        porosity: with the fines, overlap counted once.
        porosity_initial: the same without them.
        law: name of the conductance law.
        damage_law: name of the damage law that was used; None without fines.
        sections: slabs across the flow, columns as in sections.csv; for all axes also `axis`.
        warnings: doubts about the numbers, each with what follows and what to do.
    """

    axis: str
    k_m2: float | Array
    k_initial_m2: float | Array
    porosity: float
    porosity_initial: float
    law: str
    damage_law: str | None
    sections: "pd.DataFrame"
    warnings: tuple[str, ...]

    @property
    def k_mD(self) -> float | Array:
        """Permeability with the fines, mD."""
        return self.k_m2 / M2_PER_MD

    def to_dict(self) -> dict[str, Any]:
        """All numbers as JSON knows them; the sections are a list of rows."""
        own = {one.name: getattr(self, one.name) for one in fields(self)} | {"k_mD": self.k_mD}
        own |= {"warnings": [*self.warnings], "sections": self.sections.to_dict("records")}
        return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in own.items()}

    def to_frame(self) -> "pd.DataFrame":
        """A row for each axis: permeabilities (m2 and mD) and porosities."""
        import pandas as pd

        names = ("k_m2", "k_mD", "k_initial_m2", "porosity", "porosity_initial")
        axes = list("xyz" if self.axis == "all" else self.axis)
        return pd.DataFrame({"axis": axes, **{name: getattr(self, name) for name in names}})

    def __str__(self) -> str:
        said = [f"warning: {one}" for one in self.warnings]
        return "\n".join([self._shown().to_string(**_DIGITS), *said])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        said = "".join(f"<p>Warning: {escape(one)}</p>" for one in self.warnings)
        return self._shown().to_html(**_DIGITS) + said

    def _shown(self) -> "pd.DataFrame":
        frame = self.to_frame()
        twice = [] if self.damage_law else ["k_initial_m2", "porosity_initial"]
        return frame.drop(columns=twice)


@with_visible_choices
def permeability(
    points: Any,
    radii: Any,
    box: Any,
    *,
    periodic: Directions = "xyz",
    axis: str = "x",
    units: str = "mm",
    kind: Any = None,
    **choices: Unpack[AnalysisKeys],
) -> Permeability:
    """Permeability of spheres in plain arrays; `fdnet permeability` gives the same of a file.

    Args:
        points, radii: (N, 3) centres and (N,) radii, or one radius for all.
        box: its three lengths from 0 on, (3, 2) bounds, six numbers x0, x1, y0, y1, z0, z1, or a
            (3, 3) cell whose sides lie along x, y and z, as ASE has it.
        periodic: sides that repeat: letters, True for all, or three truth values, as ASE's `pbc`.
            The other sides are walls, along the flow the inlet and the outlet.
        axis: direction of the flow, "x", "y" or "z", or "all" for the three.
        units: unit of points, radii and box: "m", "cm", "mm" or "um".
        kind: "grain" or "fine" of each sphere, (N,). Without it all are grains.
        choices: of the analysis, as for `analyse`: `sections`, `law`, `damage_law`, `walls` ...

    Returns:
        Permeability in m2 and mD, porosity, sections and warnings.

    Raises:
        CaseError: an argument cannot be used, or box and spheres cannot be in one unit.
        NetworkError, FlowError: as `analyse`.

    Examples:
        Touching spheres of 1 mm on a simple cubic lattice (k = 0.00252 d^2, Zick and Homsy 1982):

        >>> import fdnet, numpy as np
        >>> points = np.indices((3, 3, 3)).reshape(3, -1).T + 0.5
        >>> result = fdnet.permeability(points, 0.5, [3, 3, 3])
        >>> print(f"{result.k_m2:.3g} m2, {result.k_mD:.0f} mD, porosity {result.porosity:.3f}")
        2.52e-09 m2, 2551691 mD, porosity 0.476
    """
    if box is None:
        raise CaseError(f"box: missing, expected its three lengths, {units}")
    given = {"box": box, "periodic": periodic, "units": units}
    given |= {} if kind is None else {"kind": kind}
    spheres = Snapshot.from_arrays(points, radii, **given)
    _refuse_two_units(spheres)
    chosen, several = AnalysisChoices.of_pack(**choices), axis == "all"
    pair, results, said, rows = (chosen.law, chosen.damage_law), [], [], []
    for one in "xyz" if several else [axis]:
        result = next(compare(spheres.turned(one), options=chosen, laws=[pair]))
        _say_aloud(result)
        doubts = [*pack_doubts(spheres, one, chosen.walls), *result.warnings]
        said += [f"{one}: {text}" if several else text for text in map(explained, doubts)]
        results.append(result)
        rows += [({"axis": one} if several else {}) | slab.row() for slab in result.sections]
    import pandas as pd

    first = results[0]
    return Permeability(
        axis=axis,
        k_m2=frozen([one.k_damaged for one in results]) if several else first.k_damaged,
        k_initial_m2=frozen([one.k_initial for one in results]) if several else first.k_initial,
        porosity=first.porosity_damaged,
        porosity_initial=first.porosity_initial,
        law=first.law,
        damage_law=first.damage_law_used,
        sections=pd.DataFrame(rows),
        warnings=tuple(said),
    )


def _refuse_two_units(spheres: Snapshot) -> None:
    """Raise CaseError where the box is far too wide or narrow to be in the spheres' unit."""
    sides = np.ptp(spheres.box, axis=1)
    filled = 4 / 3 * np.pi * float(np.sum(spheres.radius**3)) / float(np.prod(sides))
    narrow = float(sides.max()) < float(spheres.radius.max(initial=0.0))
    if len(spheres) and (narrow or filled < THINNEST):
        reach = np.ptp(spheres.position, axis=0) + 2 * spheres.radius.max()
        wide, span = (" x ".join(f"{1e3 * one:.3g}" for one in it) for it in (sides, reach))
        raise CaseError(
            f"box: {wide} mm, but the spheres span {span} mm; expected box, points and radii in "
            "one unit; convert them and name it with units"
        )


def _chosen(options: AnalysisChoices | None, choices: AnalysisKeys) -> AnalysisChoices:
    return AnalysisChoices.of_pack(**choices) if options is None else options.changed(**choices)


def _analysis(measured: Measured, options: AnalysisChoices) -> Analysis:
    specimen, log, law, name = measured.specimen, measured.log, options.law, options.damage_law
    fines, porosity = specimen.fines, specimen.porosity
    clean, base = measured.clean(law), measured.base(law)
    whole = measured.all_spheres(options)
    of_grains = SECTION_ARCHIE if name in (AUTO, ALL_SPHERES) else name
    final, damage = measured.damaged(options, of_grains)
    k, slabs, flow = clean.k, clean.slabs, final.flow
    counts = dict(base.network.counts)
    counts["throats_not_conducting"] = int(np.sum(base.conductance == 0))
    if specimen.occupancy is not None and damage is not None:
        counts |= {**specimen.occupancy.counts, **damage.counts}
        counts["throats_blocked"] = int(specimen.occupancy.blocked.sum())
    counts["isolated_pores"] = final.flow.isolated_pores
    counts["spheres_dropped"] = specimen.inner_grains + specimen.inner_fines
    layers = None
    if whole is not None:
        log.warnings += [*whole.refused, *few_throats(whole.slabs.flows)]
        of_sections = None if specimen.moved else clean.slabs
        empty = specimen.empty_sections()
        whole, above = at_most_the_grains(whole, base.k, of_sections, specimen.edges, empty)
        counts |= above
        if above["all_spheres_above_grains"]:
            log.warnings.append(
                Doubt(
                    "light-damage",
                    "the damage is too light for the law all-spheres: its network gave more "
                    "permeability with the fines than that of the grains without them, so each "
                    "section is taken as at most the latter; "
                    f"{of_grains} gives {final.k:.4g} m2 with fines",
                )
            )
        k, slabs, flow = whole.k, whole.slabs, whole.flow
        log.warnings += laws_apart((ALL_SPHERES, k), (of_grains, final.k))
        if fines is not None and clean.halves is not None:
            layers = make_layers(clean, whole, 2.0 * float(fines.radius.mean()), specimen.depth)
    elif final is not clean:
        final = measured.with_fines_slabs(final, options, of_grains)
        k, slabs = final.k, final.slabs
    sections = make_sections(specimen.edges, porosity, (clean.slabs, slabs), specimen.depth)
    for which, one in (("k_initial", clean.flow), ("k_damaged", flow)):
        if one.reason:
            log.warnings.append(Doubt("no-open-path", f"{which} = 0: {one.reason}"))
    log.warnings += thin_slabs(sections, 2.0 * clean.network.grain_radius)
    log.warnings += specimen_doubts(specimen, clean.k)
    law_used = np.full(len(final.conductance), CLEAN) if damage is None else damage.law_used
    flows = [clean.flow, base.flow, final.flow, flow, *clean.slabs.flows, *slabs.flows]
    balances = [one.mass_balance for one in flows if one.mass_balance is not None]
    used = of_grains if whole is None else ALL_SPHERES
    return Analysis(
        network=base.network,
        occupancy=specimen.occupancy,
        law=law,
        damage_law=name,
        damage_law_used=used if fines is not None and len(fines) else None,
        damage_law_other=None if whole is None else of_grains,
        k_damaged_other=None if whole is None else final.k,
        conductance_initial=base.conductance,
        conductance_damaged=final.conductance,
        law_used=frozen(law_used),
        flow_initial=base.flow,
        flow_damaged=final.flow,
        k_initial=clean.k,
        k_damaged=k,
        k_moved=base.k if specimen.moved else None,
        k_reduction=reduction(clean.k, k),
        porosity_initial=porosity[0].mean,
        porosity_initial_error=porosity[0].standard_error,
        porosity_initial_sum=porosity[0].sum,
        porosity_damaged=porosity[1].mean,
        sections=sections,
        profile=make_profile(specimen.bins, porosity, specimen.depth),
        layers=layers,
        **asdict(specimen.invaded),
        solver={
            "method": flows[0].method,
            "residual": max(one.residual for one in flows),
            "mass_balance": max(balances) if balances else None,
        },
        copies=specimen.copies,
        counts=counts,
        warnings=tuple(log.warnings),
        seconds=log.seconds,
    )
