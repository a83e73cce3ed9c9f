"""How far the permeability by each law is from resolved Stokes flow: rows, tables and figure.

Packs are periodic cubes, with fines at random places on the grains or without fines. Slabs are cut
out of specimens that LIGGGHTS packed and invaded. Rows hold model over truth, so that 1 is right.
Where the damage law "auto" is meant, the rows are those of "all-spheres", which it takes here.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.files import replacing
from fdnet.names import ALL_SPHERES, DEFAULT_LAW, SECTION_ARCHIE
from fdnet.network.fines.occupancy import Occupancy, measure_occupancy
from fdnet.network.flow.flow import Flow
from fdnet.network.flow.sections import Section, whole_permeability
from fdnet.network.laws.named import DAMAGE_LAWS, LAWS
from fdnet.network.network import Network, build_network
from fdnet.network.permeability import Analysis, compare
from fdnet.network.states import FEW_THROATS, all_conductances, cut_out
from fdnet.run.finished import open_run
from fdnet.spheres.snapshot import Array, Snapshot
from validation.engine.csv_rows import DIGITS, read_named, write_named
from validation.engine.markdown import markdown_table
from validation.engine.palette import BLUE, GREEN, NEARLY_BLACK, ORANGE, RED
from validation.truth.cases import EQUAL, LATER, LATTICE, LOOSE, UNEQUAL, Case, read_cases
from validation.truth.made_packs import made_deposit
from validation.truth.packs import DATA, LARGE_FINES_TRUTH, MM, RADIUS, truth_tables
from validation.truth.slabs import SLAB_FOLDER, SLAB_TRUTH, read_specimen

Row = dict[str, Any]
ARCHIE, FINEST = f"{DEFAULT_LAW} + {SECTION_ARCHIE}", f"{DEFAULT_LAW} + {ALL_SPHERES}"
PAIRS = ("thesis + thesis", "thesis + thesis-code", ARCHIE)
"""The pairs of a conductance law and a damage law of the throats between grains."""
ALL_PAIRS = (*PAIRS, FINEST)
"""These, and the network of all spheres."""
PACKS, SLABS, FULL_SIZE = "accuracy_packs.csv", "accuracy_slabs.csv", "accuracy_full_size.csv"
THROATS = "throats"
"""Number of throats that carry the flow through grains and fines (`Flow.carrying_throats`)."""
FINE_CLASSES = {"3 to 4": (0.0, 4.5), "5 to 6": (4.5, 7.0), "8 to 10": (7.0, np.inf)}
"""Size ratio D/d, the mean radius of the grains over that of the fines."""
EDGES_MM = (0.0, 0.5, 1.0, 2.0)
"""Where the sections of runs of full size begin, mm from the face."""
WHOLE = "whole"
PERIODIC = (True, True, True)


def network_of(pack: Snapshot) -> Network:
    """The network of the grains of a periodic pack."""
    return build_network(pack.grains(), periodic=PERIODIC, walls="slip")


def permeability(network: Network, conductance: Array) -> float:
    """k (m2) along x of a network with `conductance` (T,) m3."""
    return whole_permeability(network, conductance)[0]


def law_of(pair: str) -> str:
    """The conductance law of a pair of laws."""
    return pair.split(" + ", maxsplit=1)[0]


def by_law(network: Network, law: str) -> float:
    """k (m2) of the grains by a conductance law."""
    return permeability(network, LAWS[law](network))


def by_pair(network: Network, occupancy: Occupancy, pair: str) -> float:
    """k (m2) with fines by one of `PAIRS`."""
    law, damage_law = pair.split(" + ")
    damaged = DAMAGE_LAWS[damage_law](network, occupancy, LAWS[law](network))
    return permeability(network, damaged.conductance)


def by_all_spheres(pack: Snapshot, periodic: Any = PERIODIC) -> tuple[float, Flow]:
    """k (m2) by the network of all spheres that runs take, and its flow."""
    network = build_network(pack, periodic=periodic, walls="slip")
    return whole_permeability(network, all_conductances(network))


def size_ratio(spheres: Snapshot) -> float:
    """Mean radius of the grains over that of the fines."""
    return float(spheres.grains().radius.mean() / spheres.fines().radius.mean())


def pack_rows(cases: Iterable[Case]) -> Iterator[Row]:
    """k0 of packs without fines by every law; k and k/k0 of packs with fines by `ALL_PAIRS`."""
    for case in cases:
        row: Row = {
            "case": case.name,
            "group": case.group,
            "size_ratio": np.nan if case.ratio is None else size_ratio(case.pack),
            "grains": len(case.pack.grains()),
            "fines": len(case.pack.fines()),
            THROATS: np.nan,
            "k_true_m2": case.k,
            "truth_error": case.error,
            "known_before": case.known_before,
            "k_over_k0": np.nan if case.ratio is None else case.ratio,
        }
        network = network_of(case.pack)
        k0 = {law: by_law(network, law) for law in LAWS}
        true_k0 = case.k if case.ratio is None else case.k / case.ratio
        row |= {f"{law}: k0": k0[law] / true_k0 for law in LAWS}
        k = dict.fromkeys(ALL_PAIRS, np.nan)
        if case.ratio is not None:
            occupancy = measure_occupancy(network, case.pack.fines())
            k = {pair: by_pair(network, occupancy, pair) for pair in PAIRS}
            k[FINEST], flow = by_all_spheres(case.pack)
            row[THROATS] = flow.carrying_throats
        for pair in ALL_PAIRS:
            row[f"{pair}: k"] = k[pair] / case.k
            row[pair] = row[f"{pair}: k"] / row[f"{law_of(pair)}: k0"]
        yield row


def large_fines(folder: Path = DATA) -> Iterator[Case]:
    """Pack H with fines of a third of a grain, which are made and not stored."""
    for line in read_named(folder / LARGE_FINES_TRUTH):
        lost = float(line["case"].rpartition("_d")[2]) / 100.0
        asked = {"seed": 408, "intact": "packH_40_eps40", "fine": RADIUS / 3.0, "lost": lost}
        yield Case(
            name=line["case"].removeprefix("pack"),
            group=EQUAL,
            pack=made_deposit(asked, folder)[0],
            k=float(line["k_mm2"]) * MM**2,
            error=float(line["relative_error"].rstrip("%")) / 100.0,
            ratio=float(line["k_over_k0"]),
        )


def slab_rows(folder: Path = SLAB_FOLDER) -> Iterator[Row]:
    """k0, k and k/k0 of every slab in the table of `folder`, by `ALL_PAIRS`.

    The slabs are sections of their specimens, cut out with the pressure held on both planes.
    """
    for line in read_named(folder / SLAB_TRUTH):
        spheres = read_specimen(folder / line["file"])
        planes = float(line["x_lo_mm"]) * MM, float(line["x_hi_mm"]) * MM
        slab = cut_out(spheres, planes, (False, True, True))
        k0, k = (float(line[f"{name}_mm2"]) * MM**2 for name in ("k0", "k"))
        row: Row = {
            "case": line["slab"],
            "size_ratio": size_ratio(spheres),
            "grains": len(spheres.grains()),
            "fines": len(slab.fines()),
            THROATS: by_all_spheres(slab, "yz")[1].carrying_throats,
            "k_true_m2": k,
            "truth_error": float(line["relative_error"].rstrip("%")) / 100.0,
            "known_before": line["known_before"],
            "k_over_k0": float(line["k_over_k0"]),
        }
        for pair, section in zip(ALL_PAIRS, _sections(spheres, planes), strict=True):
            row[f"{law_of(pair)}: k0"] = section.k_initial / k0
            row[f"{pair}: k"] = section.k_damaged / k
            row[pair] = section.k_damaged / section.k_initial / row["k_over_k0"]
        yield row


def _sections(spheres: Snapshot, planes: tuple[float, float]) -> Iterator[Section]:
    """The section between the planes by each of `ALL_PAIRS`."""
    edges = np.unique([*spheres.box[0], *planes]).tolist()
    pairs = [(law, damage) for law, damage in (pair.split(" + ") for pair in ALL_PAIRS)]
    for result in compare(spheres, periodic="yz", sections=edges, laws=pairs):
        yield next(section for section in result.sections if section.x_lo == planes[0])


def full_size_rows(runs: Iterable[Path]) -> Iterator[Row]:
    """Sections of finished runs: k/k0 by all spheres, and k by `SECTION_ARCHIE` over it.

    No grid resolves a specimen of thousands of grains and fines. "cut out" has the pressure held
    on both planes of a section, "in place" is from the pressures of the whole. A row `WHOLE` is of
    the whole specimen, which has no two ways.
    """
    names = (ALL_SPHERES, SECTION_ARCHIE)
    for path in runs:
        run = open_run(path)
        edges = [*(MM * one for one in EDGES_MM), run.case.size_m[0]]
        laws = [(DEFAULT_LAW, name) for name in names]
        results: list[Analysis] = list(
            compare(run.spheres(), periodic=run.case.periodic, laws=laws, sections=edges)
        )
        whole, other = results
        for one, own in zip(whole.sections, other.sections, strict=True):
            yield {
                "case": path.name,
                "section": f"{one.x_lo / MM:g} to {one.x_hi / MM:g} mm",
                "k_over_k0": one.k_damaged / one.k_initial,
                SECTION_ARCHIE: own.k_damaged / one.k_damaged,
                f"{SECTION_ARCHIE}: in place": own.k_damaged_inplace / one.k_damaged_inplace,
            }
        last = {
            "case": path.name,
            "section": WHOLE,
            "k_over_k0": whole.k_damaged / whole.k_initial,
        }
        ratio = other.k_damaged / whole.k_damaged
        yield last | {SECTION_ARCHIE: ratio, f"{SECTION_ARCHIE}: in place": ratio}


def write_accuracy(validation: Path) -> str:
    """Computes packs and slabs, writes their tables and the figure, returns the page's tables."""
    stored = read_cases(truth_tables(), [DATA])[0]
    write_named(validation / PACKS, list(pack_rows([*stored, *large_fines()])), digits=DIGITS)
    write_named(validation / SLABS, list(slab_rows()), digits=DIGITS)
    draw_accuracy(read_rows(validation / SLABS), validation / "accuracy.png")
    return page_tables(validation)


def write_full_size(runs: Sequence[Path], validation: Path) -> str:
    """Writes the table of `runs`, returns the page's tables."""
    write_named(validation / FULL_SIZE, list(full_size_rows(runs)), digits=DIGITS)
    return page_tables(validation)


def read_rows(path: Path) -> list[Row]:
    """The rows of a written table; what is a number is read as one."""
    return [{name: _number(text) for name, text in line.items()} for line in read_named(path)]


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def page_tables(validation: Path) -> str:
    """The tables of docs/accuracy.md, from the written files."""
    packs, slabs = read_rows(validation / PACKS), read_rows(validation / SLABS)
    full = read_rows(validation / FULL_SIZE)
    return "\n\n".join(
        [slab_table(slabs), intact_table(packs), deposit_table(packs), full_size_table(full)]
    )


def slab_table(rows: Sequence[Row]) -> str:
    """k/k0 of the slabs by `ALL_PAIRS`, and k0 and k by the default, by size ratio and throats."""
    columns = {pair: pair for pair in ALL_PAIRS if pair != PAIRS[1]}
    columns |= {f"{FINEST}: k": "k itself, all-spheres", f"{DEFAULT_LAW}: k0": "k0, lubrication"}
    return _classes(_slab_classes(rows), "D/d", columns)


def _slab_classes(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """The slabs by size ratio and throats, all of them, and those put aside."""
    some: list[tuple[str, Callable[[Row], bool]]] = [
        (name, lambda row, span=span: span[0] <= row["size_ratio"] < span[1])  # type: ignore[misc]
        for name, span in FINE_CLASSES.items()
    ]
    some += [("all", lambda row: True), ("put aside", lambda row: row["known_before"] == LATER)]
    return {
        f"{name}; {words}": [
            row for row in rows if among(row) and (row[THROATS] >= FEW_THROATS) == many
        ]
        for name, among in some
        for words, many in ((f"{FEW_THROATS} throats or more", True), ("fewer", False))
    }


def intact_table(rows: Sequence[Row]) -> str:
    """k0 of the packs without fines by every law, by kind of pack."""
    groups = (EQUAL, UNEQUAL, LATTICE, LOOSE)
    intact = [row for row in rows if not row["fines"]]
    classes = {name: [row for row in intact if row["group"] == name] for name in groups}
    return _classes(classes, "grains alone", {f"{law}: k0": law for law in LAWS})


def deposit_table(rows: Sequence[Row]) -> str:
    """k/k0 of the packs whose fines lie at random, by size ratio."""
    deposits = [row for row in rows if row["fines"]]
    classes = {
        f"{number:.0f}": [row for row in deposits if round(row["size_ratio"]) == number]
        for number in sorted({round(row["size_ratio"]) for row in deposits})
    }
    columns = {pair: pair for pair in ALL_PAIRS} | {f"{FINEST}: k": "k itself, all-spheres"}
    return _classes(classes, "D/d", columns)


def full_size_table(rows: Sequence[Row]) -> str:
    """`SECTION_ARCHIE` over all spheres by depth: the span over the runs."""
    lines = []
    for section in dict.fromkeys(row["section"] for row in rows):
        of = [row for row in rows if row["section"] == section]
        spans = (
            " to ".join(f"{pick(row[name] for row in of):.2f}" for pick in (min, max))
            for name in ("k_over_k0", SECTION_ARCHIE)
        )
        lines.append([section, str(len(of)), *spans])
    header = ["section", "runs", "k/k0, all-spheres", f"k, {SECTION_ARCHIE} over all-spheres"]
    return markdown_table(header, lines)


def _classes(classes: dict[str, list[Row]], label: str, columns: dict[str, str]) -> str:
    """rms of ln and the worst ratio of some columns, one line for each class of rows."""
    lines = [
        [name, str(len(of)), *(summary(row[column] for row in of) for column in columns)]
        for name, of in classes.items()
        if of
    ]
    return markdown_table([label, "cases", *columns.values()], lines)


def summary(ratios: Iterable[float]) -> str:
    """Root mean square of ln(model / truth), and the ratio furthest from 1.

    From a half on, the root mean square is given as the factor that it stands for.
    """
    logs = np.log(np.array(list(ratios)))
    worst = float(np.exp(logs[np.argmax(np.abs(logs))]))
    rms = float(np.sqrt(np.mean(logs**2)))
    words = f"{100 * rms:.1f} %" if rms < 0.5 else f"factor {np.exp(rms):.1f}"
    return f"{words}, {worst:.{3 if worst < 2 else 1}f}"


def draw_accuracy(slabs: Sequence[Row], path: Path) -> None:
    """Left: k/k0 of the slabs over truth against their throats. Right: model against truth."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(12, 5.2), constrained_layout=True)
    for (name, span), colour in zip(FINE_CLASSES.items(), (ORANGE, GREEN, BLUE), strict=True):
        of = [row for row in slabs if span[0] <= row["size_ratio"] < span[1]]
        throats = [row[THROATS] for row in of]
        left.plot(throats, [row[FINEST] for row in of], "o", ms=4, color=colour, label=name)
    left.axvline(FEW_THROATS, color=NEARLY_BLACK, lw=0.8, ls=":")
    left.axhline(1.0, color=NEARLY_BLACK, lw=0.8)
    left.set(xscale="log", xlabel="throats that carry the flow", ylabel="k/k0, model over truth")
    left.set_title("all-spheres, by size ratio D/d", fontsize=10)
    true = np.array([row["k_over_k0"] for row in slabs])
    for pair, colour, marker in zip(
        (PAIRS[0], ARCHIE, FINEST), (RED, BLUE, NEARLY_BLACK), "vso", strict=True
    ):
        model = true * np.array([row[pair] for row in slabs])
        right.plot(true, model, marker, ms=4, color=colour, label=pair, alpha=0.8)
    right.plot([true.min(), 1], [true.min(), 1], color=NEARLY_BLACK, lw=0.8)
    right.set(xscale="log", yscale="log", xlabel="true k/k0", ylabel="k/k0 by the law")
    right.set_title("slabs of deposits that LIGGGHTS made", fontsize=10)
    for axes in (left, right):
        axes.grid(lw=0.3)
        axes.legend(fontsize=8)
    with replacing(path) as part:
        figure.savefig(part, dpi=110)
    plt.close(figure)
