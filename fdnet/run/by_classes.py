"""The invasion by the fast model: size classes on the pore network, in place of LIGGGHTS.

It needs the finished pack alone. What the classes left is kept in invade/classes.npz; the tables
of the run folder follow from it. Fines are drawn as spheres at places in their pores: one for
each, or one for several of them where there would be more than `MOST_ROWS`.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.case.tables import InvasionChoices
from fdnet.classes.capture import SizeClasses, mud_classes
from fdnet.classes.deposit import PACKED, Deposits, Sieve, sieve_of, thickness_of_cake
from fdnet.classes.invasion import (
    ClassInvasion,
    Course,
    PackStateOf,
    bed_of,
    cake_permeability,
    cake_resistance,
    first_flow,
    flows_through,
    invade_classes,
    release_of,
)
from fdnet.dem.checkpoint import HISTORY, Checkpoint
from fdnet.errors import Doubt, FlowError, explained
from fdnet.files import replacing
from fdnet.names import SIZE_CLASSES
from fdnet.network.fines.occupancy import Occupancy, measure_occupancy, ratio
from fdnet.network.flow.flow import solve_flow
from fdnet.network.flow.sections import (
    Layers,
    inplace_permeability,
    layer_edges,
    plane_pressures,
    reduction,
    slab_permeability,
)
from fdnet.network.laws.deposit_resistances import grain_resistances
from fdnet.network.network import Network, build_network
from fdnet.report.tables import write_rows
from fdnet.run.finished import HISTORY_COLUMNS, FinishedRun
from fdnet.run.fluid import FLOW_COLUMNS
from fdnet.run.folder import digests_of
from fdnet.run.records import FinishedInvasion, finer_file
from fdnet.scales.flow import api_filtrate
from fdnet.scales.scales import InvasionScales, invasion_scales
from fdnet.spheres.snapshot import Array, Kind, Snapshot, frozen, resting

if TYPE_CHECKING:
    from fdnet.network.permeability import Analysis

STATE = "classes.npz"
MOST_ROWS = 20_000  # Spheres that stand for the fines of a run
FIRST_DRAWN = 10_000_000  # Numbers of these spheres begin here, behind those of LIGGGHTS
TRIES = 8  # Places tried for each of them; the one farthest from the grains is taken


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ClassModel:
    """A pack as the fast model sees it; `parcel` m3 is drawn as one sphere at least."""

    network: Network
    clean: Array
    sieve: Sieve
    classes: SizeClasses
    course: Course
    flow: PackStateOf
    parcel: float

    def counted(self, volumes: Array) -> "Counts":
        """Solids (3, C) m3 inside, passed and in the cake as counts, each rounded."""
        own = self.classes.volume
        parcel = max(self.parcel, float(volumes.sum()) / MOST_ROWS)
        per_row = np.maximum(np.ceil(parcel / own * (1.0 - 1e-9)), 1.0)
        invaded, passed, upstream = np.rint(volumes / own / per_row).astype(int)
        return Counts(per_row=per_row, invaded=invaded, passed=passed, upstream=upstream)


def class_model(
    case: InvasionCase, scales: InvasionScales, grains: Snapshot, network: Network | None = None
) -> ClassModel:
    """The model of a case. Raises NetworkError or FlowError where the pack has no flow.

    The `network` of the grains is built where it is not given.
    """
    choices = InvasionChoices() if case.invasion is None else case.invasion
    if network is None:
        network = build_network(grains, periodic=case.periodic, walls=case.analysis.walls)
    halves = grain_resistances(network)
    clean = 1.0 / halves.sum(axis=1)
    first = solve_flow(network, clean)
    if first.inflow <= 0:
        raise FlowError(
            "the pack has no open path from the face to the other end, and size classes move with "
            "the flow: make another pack by another seed, or a higher grains.porosity"
        )
    sieve = sieve_of(network, halves, first.throat_flux)
    below = case.fines.finest_m if case.with_classes else math.inf
    classes = mud_classes(case.fines, choices.classes, below=below)
    permeability = first.inflow * sieve.length / sieve.area
    return ClassModel(
        network=network,
        clean=clean,
        sieve=sieve,
        classes=classes,
        course=_course(case, scales, permeability, sieve.length),
        flow=flows_through(network, sieve, clean, first),
        parcel=case.fines.mean_volume_m3 if case.with_classes else 0.0,
    )


def _course(
    case: InvasionCase, scales: InvasionScales, permeability: float, length: float
) -> Course:
    """What drives and ends the invasion, as with spheres in a flow that follows the deposit."""
    drive = first_flow(case, scales, permeability)
    fines, run, physical = case.fines, case.run, scales.force_factor
    return Course(
        velocity=drive.velocity,
        resistance=length / permeability,
        rest=drive.rest,
        at_rate=case.drag.drive == "rate",
        cake_permeability=cake_permeability(case),
        duration=run.duration_s,
        plug_rate=run.plug_rate,
        plug_time=scales.plug_time * physical,
        cap_time=scales.cap_time * physical,
        supply=scales.supplied_count * fines.mean_volume_m3 / fines.curve.kept,
        sticking=0.0 if case.invasion is None else case.invasion.sticking,
        release=release_of(case),
        bed=bed_of(case, scales, drive.velocity),
    )


# ---- The stage: what it writes, and its record.
def write_class_invasion(model: ClassModel, folder: Path) -> dict[str, Any]:
    """Let the mud in, write what is left of it into `folder`, and return the stage's record."""
    end = invade_classes(model.sieve, model.classes, model.course, model.flow)
    folder.mkdir(parents=True, exist_ok=True)
    arrays = {one.name: getattr(end.solids, one.name) for one in fields(end.solids)}
    arrays |= {f"row_{key}": np.array([row[key] for row in end.rows]) for key in end.rows[0]}
    arrays |= {"kept": end.kept, "by_class": end.by_class}
    with replacing(folder / STATE) as part:
        np.savez_compressed(part, **arrays)
    counts = model.counted(end.by_class[-1])
    write_rows(folder / HISTORY, history_of(model.classes, end.by_class, counts.per_row))
    return {
        "method": "network",
        "stop_reason": end.stop_reason,
        "max_overlap": 0.0,
        "steps": len(end.rows) - 1,
        "dt_s": 0.0,
        "supplied": int(counts.supplied.sum()),
        "mass_missing": float(np.abs(end.solids.missing).max()),
        "warnings": [explained(one) for one in all_is_cake(model)],
        "ranks": 1,
        "files": digests_of(folder, [HISTORY, STATE]),
        "runs": [],
        "left_out": ["the motion of single fines: size classes on the pore network instead"],
    }


def all_is_cake(model: ClassModel) -> Iterator[str]:
    """Classes that no throat lets in, in words."""
    widest = float(model.sieve.passage.max())
    if np.any(wide := model.classes.low >= widest):
        own = model.classes
        yield Doubt(
            "all-is-cake",
            f"fines of {1e6 * own.low[wide].min():.3g} to {1e6 * own.high[wide].max():.3g} µm are "
            f"wider than every throat ({1e6 * widest:.3g} µm at most): but for what fills the "
            "pores of the face, all of it is cake",
        )


def read_classes(path: Path, last: Mapping[str, float] | None = None) -> ClassInvasion:
    """The end of an invasion; with `last`, the row of its last update, one beside spheres."""
    with np.load(path) as data:
        solids = Deposits(**{one.name: data[one.name] for one in fields(Deposits)})
        if last is None:
            columns = {name[4:]: data[name].tolist() for name in data.files if name[:4] == "row_"}
            rows, by_class = tuple(rows_of(columns)), data["by_class"]
        else:
            rows = (dict(last),)
            by_class = np.array([[solids.inside_by_class, solids.passed, solids.cake]])
        return ClassInvasion(solids=solids, kept=data["kept"], by_class=by_class, rows=rows)


def rows_of(columns: Mapping[str, Sequence[Any]]) -> list[dict[str, Any]]:
    """The rows of a table that is given by its columns."""
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


# ---- Volumes as counts of fines, and fines as spheres.
@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Counts:
    """Fines of each class (C), in rows of `per_row` fines."""

    per_row: Array  # (C,) fines that a row stands for
    invaded: Array  # (C,) rows inside the specimen
    passed: Array  # (C,) rows that left through the outlet
    upstream: Array  # (C,) rows before the face

    @property
    def supplied(self) -> Array:
        """(C,) rows of all."""
        return self.invaded + self.passed + self.upstream


def history_of(classes: SizeClasses, by_class: Array, per_row: Array) -> list[dict[str, int]]:
    """The counts of each step, as the deck of an invasion writes them."""
    counts = np.rint(by_class / classes.volume / per_row).astype(int).sum(axis=2)
    names, step = ("invaded", "passed", "upstream"), np.arange(len(counts))
    columns = {"chunk": step + 1, "step": step} | dict(zip(names, counts.T, strict=True))
    return rows_of({name: columns[name].tolist() for name in HISTORY_COLUMNS})


def spheres_at_the_end(
    case: InvasionCase, model: ClassModel, kept: ClassInvasion, counts: Counts
) -> Snapshot:
    """Fines at places in the pores and throats that hold them, and the cake before the face."""
    rng, solids = np.random.default_rng(case.seed), kept.solids
    network, sieve = model.network, model.sieve
    pores, position, radius = len(sieve.void), [], []
    for i, one in enumerate(counts.invaded):
        held = solids.in_pores[:, i] + solids.attached[:, i] + solids.carried[:, i]
        where = _dealt(np.concatenate([held, solids.in_throats[:, i]]), int(one))
        own = 0.5 * model.classes.diameter[i]
        inside = [
            _places(network, where[where < pores], own, rng),
            sieve.throat_place[where[where >= pores] - pores],
        ]
        position.append(_into_the_box(network, np.concatenate(inside)))
        position.append(_before(model, int(counts.upstream[i]), solids, rng))
        radius.append(np.full(int(one) + int(counts.upstream[i]), own))
    place = np.concatenate(position)
    fines = resting(place, np.concatenate(radius), network.box, Kind.FINE)
    return replace(fines, id=fines.id + FIRST_DRAWN)


def _into_the_box(network: Network, place: Array) -> Array:
    """Places (N, 3) m in the box: what a cut pore holds lies on its inner side."""
    low, high = network.box.T
    size, away = high - low, place - low
    away[:, 0] = size[0] - np.abs(size[0] - np.abs(away[:, 0]))
    away[:, 0] = np.clip(away[:, 0], 0.0, size[0] * (1.0 - 1e-9))
    away[:, 1:] %= size[1:]
    return low + away


def _dealt(held: Array, count: int) -> Array:
    """Places (count,) of rows dealt out by the volumes `held` (M,), in the order of the places."""
    if not count:
        return np.zeros(0, int)
    edges = np.cumsum(held) / held.sum() * count
    return np.minimum(np.searchsorted(edges, np.arange(count) + 0.5), len(held) - 1)


def _places(network: Network, groups: Array, radius: float, rng: np.random.Generator) -> Array:
    """A place (N, 3) m in a pore of each of `groups` (N,), away from its grains."""
    order = np.argsort(network.pore_group, kind="stable")
    group, volume = network.pore_group[order], network.pore_tetra_volume[order]
    first = np.searchsorted(group, groups)
    total = np.concatenate([[0.0], np.cumsum(volume)])
    end = np.searchsorted(group, groups, side="right")
    corner, own = network.pore_corner, network.pore_corner_radius
    best, place = np.full(len(groups), -np.inf), np.zeros((len(groups), 3))
    for _ in range(TRIES):
        at = total[first] + rng.random(len(groups)) * (total[end] - total[first])
        pore = order[np.clip(np.searchsorted(total, at, side="right") - 1, first, end - 1)]
        weight = rng.exponential(size=(len(groups), 4))
        weight /= weight.sum(axis=1, keepdims=True)
        tried = np.sum(weight[:, :, None] * corner[pore], axis=1)
        clear = np.linalg.norm(tried[:, None] - corner[pore], axis=2) - own[pore] - radius
        better = clear.min(axis=1) > best
        best[better], place[better] = clear.min(axis=1)[better], tried[better]
    return place


def _before(model: ClassModel, count: int, solids: Deposits, rng: np.random.Generator) -> Array:
    low, high = model.network.box.T
    place = low + rng.random((count, 3)) * (high - low)
    place[:, 0] = low[0] - (1e-6 + rng.random(count)) * thickness_of_cake(model.sieve, solids)
    return place


class Rested(NamedTuple):
    """Fines of one kind: where so many m3 rest in a specimen."""

    name: str  # of the kind
    concentration: float  # volume over that of the mud
    # depth, volume: (N,) m and m3, of each
    depth: Array
    volume: Array
    passed: float  # m3 that got through the specimen
    number: float  # of equal fines, or of pores, that would tell as much


def rested_classes(run: FinishedRun, case: InvasionCase) -> list[Rested]:
    """The size classes of a finished run, without what the fluid still carries."""
    model = class_model(case, invasion_scales(case), run.spheres("initial"))
    name = finer_file(run.manifest["invade"]["steps"]) if case.with_classes else STATE
    kept = read_classes(run.path / "invade" / name, {})
    solids = replace(kept.solids, carried=np.zeros_like(kept.solids.carried))
    volumes = np.array([solids.inside_by_class, solids.passed, 0.0 * solids.cake])
    counts = model.counted(volumes)
    x = spheres_at_the_end(case, model, replace(kept, solids=solids), counts).position[:, 0]
    places = np.concatenate([solids.in_pores + solids.attached, solids.in_throats])
    number = volumes[0] ** 2 / np.maximum(np.sum(places**2, axis=0), 1e-300)
    found, last = [], np.cumsum(counts.invaded)
    for i, (own, rows) in enumerate(zip(model.classes.diameter, counts.invaded, strict=True)):
        found.append(
            Rested(
                name=f"{1e6 * own:.3g} µm",
                concentration=float(model.classes.concentration[i]),
                depth=x[last[i] - rows : last[i]],
                volume=np.full(rows, volumes[0, i] / max(rows, 1)),
                passed=float(solids.passed[i]),
                number=min(float(number[i]), float(rows)),
            )
        )
    return found


# ---- The analysis of the specimen: that of its grains, with what the classes left.
def analysed_classes(
    model: ClassModel, kept: ClassInvasion, base: "Analysis", spheres: Snapshot
) -> "Analysis":
    """The analysis with the deposit of the classes; `base` is that without them.

    A permeability is that of `base` times what the classes leave of it in the network of grains.
    """
    network, sieve, fines = model.network, model.sieve, spheres.fines()
    raised = ratio(base.conductance_initial, base.conductance_damaged)
    before = sieve.halves * np.where(raised > 0, raised, 1.0)[:, None]
    halves = before / kept.kept
    raised = halves.sum(axis=1)
    factor = np.where(raised > 0, ratio(before.sum(axis=1), raised), 1.0)
    conductance = frozen(base.conductance_damaged * factor)
    flow = solve_flow(network, conductance)
    left = flow.inflow / base.flow_damaged.inflow if flow.inflow else 0.0
    k = base.k_damaged * left
    depth = fines.position[fines.position[:, 0] >= network.box[0, 0], 0] - network.box[0, 0]
    low = np.array([one.x_lo for one in base.sections])
    edges = np.append(low, base.sections[-1].x_hi)
    inplace = inplace_permeability(network, flow, edges, halves)
    first = inplace_permeability(network, base.flow_damaged, edges, before)
    filled, bins = _filled_by_depth(model, kept.solids), base.profile.edges
    profile = replace(
        base.profile,
        porosity_damaged=frozen(base.profile.porosity_damaged - _share(filled, bins, sieve)),
        fines_fraction=frozen(np.histogram(depth, bins)[0] / max(len(depth), 1)),
    )
    sections, count = [], np.histogram(depth, edges)[0]
    for one, damaged, intact, number, taken in zip(
        base.sections, inplace, first, count, _share(filled, edges, sieve), strict=True
    ):
        cut = [
            slab_permeability(network, g, (one.x_lo, one.x_hi))[0]
            for g in (base.conductance_damaged, conductance)
        ]
        after = one.k_damaged * min(cut[1] / cut[0] if cut[0] > 0 else 0.0, 1.0)
        sections.append(
            replace(
                one,
                porosity_damaged=one.porosity_damaged - float(taken),
                k_damaged=after,
                k_reduction=reduction(one.k_initial, after),
                k_damaged_inplace=one.k_damaged_inplace * float(damaged / intact),
                fines_count=int(number),
                fines_fraction=float(number / max(len(depth), 1)),
            )
        )
    thin = layer_edges(network.box, network.grain_radius / 2.0)
    thin = thin if base.layers is None else base.layers.edges
    three = ((base.flow_initial, sieve.halves), (base.flow_damaged, before), (flow, halves))
    drops = [-np.diff(plane_pressures(network, one, thin, side)) for one, side in three]
    values = [inplace_permeability(network, one, thin, side) for one, side in three]
    layers = base.layers or Layers(
        edges=frozen(thin),
        k_initial=frozen(values[0]),
        k_damaged=frozen(values[1]),
        drop_initial=frozen(drops[0]),
        drop_damaged=frozen(drops[1]),
        fines_count=frozen(np.zeros(len(thin) - 1, int)),
    )
    taken = float(_share(filled, edges[[0, -1]], sieve)[0])
    other, cake = base.k_damaged_other, thickness_of_cake(sieve, kept.solids)
    return replace(
        base,
        occupancy=_occupancy(model, kept, base.occupancy, spheres, factor),
        damage_law_used=base.damage_law_used or SIZE_CLASSES,
        k_damaged_other=None if other is None else other * left,
        conductance_damaged=conductance,
        law_used=frozen(np.where(factor < 1.0, SIZE_CLASSES, base.law_used)),
        flow_damaged=flow,
        k_damaged=k,
        k_reduction=reduction(base.k_initial, k),
        porosity_damaged=base.porosity_damaged - taken,
        sections=tuple(sections),
        profile=profile,
        layers=replace(
            layers,
            k_damaged=frozen(layers.k_damaged * ratio(values[2], values[1])),
            drop_damaged=frozen(layers.drop_damaged * ratio(drops[2], drops[1])),
            fines_count=frozen(np.histogram(depth, thin)[0]),
        ),
        invaded_count=len(depth),
        invaded_volume=base.invaded_volume + float(kept.solids.inside_by_class.sum()),
        invasion_depth=float(depth.max(initial=0.0)),
        invasion_depth_p95=float(np.quantile(depth, 0.95)) if len(depth) else 0.0,
        cake_thickness=base.cake_thickness + cake,
    )


def _filled_by_depth(model: ClassModel, solids: Deposits) -> tuple[Array, Array, Array]:
    """Solids m3 with the depths, m, between which each lies: that of its pore or throat."""
    sieve = model.sieve
    held = (solids.in_pores + solids.attached + solids.carried).sum(axis=1)
    volume = np.concatenate([held, solids.in_throats.sum(axis=1)])
    reach = 0.5 * np.cbrt(sieve.void)
    thin = np.minimum(*(reach[sieve.ends[:, side]] for side in (0, 1)))
    middle = np.concatenate([sieve.place[:, 0], sieve.throat_place[:, 0]])
    reach, start = np.concatenate([reach, thin]), float(model.network.box[0, 0])
    low = np.clip(middle - reach, start, start + sieve.length)
    high = np.clip(middle + reach, start, start + sieve.length)
    return volume, low, np.maximum(high, low + 1e-9 * sieve.length)


def _share(filled: tuple[Array, Array, Array], edges: Array, sieve: Sieve) -> Array:
    """Share (B,) of slabs between `edges` (B+1,) m that the solids take."""
    volume, low, high = filled
    below = [float(np.sum(volume * np.clip((x - low) / (high - low), 0.0, 1.0))) for x in edges]
    return np.diff(below) / (sieve.area * np.diff(edges))


def _occupancy(
    model: ClassModel,
    kept: ClassInvasion,
    base: Occupancy | None,
    spheres: Snapshot,
    factor: Array,
) -> Occupancy:
    """What the solids take of throats and pores; a throat with less than 1 % left is blocked."""
    network, sieve, solids = model.network, model.sieve, kept.solids
    if base is None:
        none = spheres.fines().where(np.zeros(len(spheres.fines()), bool))
        base = measure_occupancy(network, none)
    held = (solids.in_pores + solids.attached).sum(axis=1)
    surface = (solids.in_pores + solids.attached) @ (6.0 / model.classes.diameter)
    share = (
        network.pore_volume
        * network.pore_share
        / np.maximum(sieve.void, 1e-300)[network.pore_group]
    )
    whole = np.maximum(network.pore_share, 0.125)
    in_throats = solids.in_throats.sum(axis=1)
    number = solids.in_throats @ (1.0 / model.classes.volume)
    sizes = solids.in_throats @ (0.5 * model.classes.diameter / model.classes.volume)
    mean = ratio(sizes + base.throat_fine_radius * base.throat_fines, number + base.throat_fines)
    cylinder = np.pi * network.throat_radius**2 * network.throat_length
    solid = held[network.pore_group] * share / whole
    return replace(
        base,
        throat_solid_volume=frozen(base.throat_solid_volume + in_throats),
        throat_porosity=frozen(base.throat_porosity - ratio(in_throats, cylinder)),
        throat_fine_radius=frozen(mean),
        throat_fines=frozen(base.throat_fines + np.ceil(number - 1e-9).astype(int)),
        blocked=frozen(base.blocked | (factor < 0.01)),
        pore_solid_volume=frozen(base.pore_solid_volume + solid),
        pore_solid_surface=frozen(
            base.pore_solid_surface + surface[network.pore_group] * share / whole
        ),
        pore_porosity=frozen(base.pore_porosity - ratio(solid, network.pore_tetra_volume)),
        fines=spheres.fines(),
    )


# ---- A finished run of the fast model.
def finished_classes(
    case: InvasionCase, scales: InvasionScales, grains: Snapshot, folder: Path
) -> tuple[FinishedInvasion, ClassModel, ClassInvasion]:
    """The invasion in `folder`, with its model and what the classes left."""
    model, kept = class_model(case, scales, grains), read_classes(folder / STATE)
    counts = model.counted(kept.by_class[-1])
    fines = spheres_at_the_end(case, model, kept, counts)
    last = Checkpoint(
        chunk=len(kept.rows),
        step=len(kept.rows) - 1,
        upstream=int(counts.upstream.sum()),
        invaded=int(counts.invaded.sum()),
        passed=int(counts.passed.sum()),
        removed_upstream=0,
        most_crossed=0,
        quiet=0,
    )
    numbers = history_of(model.classes, kept.by_class, counts.per_row)
    rows = [
        {
            "time_s": row["time_s"],
            "physical_time_s": row["time_s"],
            "supplied_count": own["invaded"] + own["passed"] + own["upstream"],
            **{f"{name}_count": own[name] for name in ("invaded", "passed", "upstream")},
            "step": own["step"],
            **{name: row[name] for name in FLOW_COLUMNS if name in row},
        }
        for row, own in zip(kept.rows, numbers, strict=True)
    ]
    done = FinishedInvasion(
        case=case, scales=scales, history=(last,), damaged=grains.joined(fines), rows=tuple(rows)
    )
    return done, model, kept


def class_summary(case: InvasionCase, model: ClassModel, kept: ClassInvasion) -> dict[str, Any]:
    """The keys that the fast model adds to summary.json."""
    solids, last, own = kept.solids, kept.rows[-1], model.classes
    counts = model.counted(kept.by_class[-1])
    given, drop, api = model.course.cake_permeability, last["pressure_cake_Pa"], None
    if given is not None:
        viscosity, share = case.fluid.viscosity_Pa_s, case.fines.volume_fraction
        api = 1e6 * api_filtrate(given, viscosity=viscosity, solids=share, porosity=PACKED)
    columns = {
        "from_m": own.low,
        "to_m": own.high,
        "diameter_m": own.diameter,
        "concentration": own.concentration,
        "supplied_m3": solids.supplied,
        "inside_m3": solids.inside_by_class,
        "passed_m3": solids.passed,
        "cake_m3": solids.cake,
        "fines_per_row": counts.per_row.astype(int),
    }
    resistance = cake_resistance(given, model.sieve, solids, own)
    common = {
        "method": "network",
        "method_error": METHOD_ERROR,
        "classes": rows_of({name: one.tolist() for name, one in columns.items()}),
        "mass_missing": float(np.abs(solids.missing).max()),
        "rate_over_initial": last["rate_over_initial"],
        "filtrate_m3": last["filtrate_m3"],
        "api_filtrate_mL": api,
    }
    if case.with_classes:
        return common | {"method": "both", "cake_of_classes_1_m": resistance}
    return common | {
        "cake_resistance_share": drop / max(drop + last["pressure_pack_Pa"], 1e-300),
        "cake": _cake(model, kept, counts, resistance),
    }


def _cake(
    model: ClassModel, kept: ClassInvasion, counts: Counts, resistance: float
) -> dict[str, Any] | None:
    """The cake as the summary of any run has it; None where no solids stand before the face."""
    if not resistance:
        return None
    thickness = thickness_of_cake(model.sieve, kept.solids)
    return {
        "fines": int(counts.upstream.sum()),
        "thickness_m": thickness,
        "packed_thickness_m": thickness,
        "porosity": PACKED,
        "k_m2": thickness / resistance,
        "law": "given" if model.course.cake_permeability else "carman-kozeny",
        "resistance_1_m": resistance,
        "resistance_pack_1_m": model.course.resistance / max(kept.rows[-1]["k_over_k0"], 1e-300),
        "no_cake_yet": "",
    }


METHOD_ERROR = (
    "on the packs of five cases its first millimetre kept 1.05 to 1.7 times the permeability that "
    "LIGGGHTS's spheres left, and its 95 % depth was 0.69 to 1.1 times theirs "
    "(docs/theory/size_classes.md)"
)
"""By docs/validation/size_classes.csv: the least and the largest mean of a case."""
