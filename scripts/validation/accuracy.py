"""How far the permeability by each law is from resolved Stokes flow: the chapter `accuracy`.

Rows hold model over truth, so that 1 is right. Packs are periodic cubes, with fines at random
places on the grains or without fines; slabs are cut out of specimens that LIGGGHTS packed and
invaded (`validation.truth`). A pair is a law of the throats and a law of the damage; where the
damage law "auto" is meant, the rows are those of "all-spheres", which it takes here.
"""

import argparse
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd

from fdnet.files import path_option, replacing
from fdnet.names import ALL_SPHERES, DEFAULT_LAW, SECTION_ARCHIE
from fdnet.network.fines.occupancy import Occupancy, measure_occupancy
from fdnet.network.flow.flow import Flow
from fdnet.network.flow.sections import whole_permeability
from fdnet.network.laws.named import DAMAGE_LAWS, LAWS
from fdnet.network.network import Network, build_network
from fdnet.network.permeability import compare
from fdnet.network.states import FEW_THROATS, all_conductances, cut_out
from fdnet.run.finished import open_run
from fdnet.run.stokes_sections import ACROSS_A_FINE, stokes_sections
from fdnet.spheres.snapshot import Snapshot
from validation import truth
from validation.truth import Case, Slab

Row = dict[str, Any]
ARCHIE, FINEST = f"{DEFAULT_LAW} + {SECTION_ARCHIE}", f"{DEFAULT_LAW} + {ALL_SPHERES}"
PAIRS = ("thesis + thesis", "thesis + thesis-code", ARCHIE)
"""The pairs of a conductance law and a damage law of the throats between grains."""
ALL_PAIRS = (*PAIRS, FINEST)
"""These, and the network of all spheres."""
FOLDER = Path(__file__).resolve().parents[2] / "docs" / "validation"
PACKS, SLABS, FIGURE = "accuracy_packs.csv", "accuracy_slabs.csv", "accuracy.png"
SECTIONS = "stokes_sections.csv"
THROATS = "throats"
"""Number of throats that carry the flow through grains and fines (`Flow.carrying_throats`)."""
SIZES = {"3 to 4": (0.0, 4.5), "5 to 6": (4.5, 7.0), "8 to 10": (7.0, np.inf)}
"""Size ratio D/d, the mean radius of the grains over that of the fines."""
LIGHT = 0.9
"""k/k0 from which on the damage of a slab is light."""
ALL_AXES = (True, True, True)


def network_of(pack: Snapshot) -> Network:
    """The network of the grains of a periodic pack."""
    return build_network(pack.grains(), periodic=ALL_AXES, walls="slip")


def law_of(pair: str) -> str:
    """The conductance law of a pair of laws."""
    return pair.split(" + ", maxsplit=1)[0]


def by_law(network: Network, law: str) -> float:
    """k (m2) of the grains by a conductance law."""
    return whole_permeability(network, LAWS[law](network))[0]


def by_pair(network: Network, occupancy: Occupancy, pair: str) -> float:
    """k (m2) with fines by one of `PAIRS`."""
    law, damage_law = pair.split(" + ")
    damaged = DAMAGE_LAWS[damage_law](network, occupancy, LAWS[law](network))
    return whole_permeability(network, damaged.conductance)[0]


def by_all_spheres(pack: Snapshot, periodic: Any = ALL_AXES) -> tuple[float, Flow]:
    """k (m2) by the network of all spheres that runs take, and its flow."""
    network = build_network(pack, periodic=periodic, walls="slip")
    return whole_permeability(network, all_conductances(network))


def size_ratio(spheres: Snapshot) -> float:
    """Mean radius of the grains over that of the fines."""
    return float(spheres.grains().radius.mean() / spheres.fines().radius.mean())


def pack_row(case: Case) -> Row:
    """k0 of a pack by every law, and with fines k and k/k0 by `ALL_PAIRS`, over the truth."""
    filled = case.ratio is not None
    row: Row = {
        "case": case.name,
        "group": case.group,
        "size_ratio": size_ratio(case.pack) if filled else np.nan,
        "grains": len(case.pack.grains()),
        "fines": len(case.pack.fines()),
        THROATS: np.nan,
        "k_true_m2": case.k,
        "truth_error": case.error,
        "known_before": case.known_before,
        "k_over_k0": case.ratio if filled else np.nan,
    }
    network = network_of(case.pack)
    true_k0 = case.k / case.ratio if case.ratio else case.k
    row |= {f"{law}: k0": by_law(network, law) / true_k0 for law in LAWS}
    k = dict.fromkeys(ALL_PAIRS, np.nan)
    if filled:
        occupancy = measure_occupancy(network, case.pack.fines())
        k = {pair: by_pair(network, occupancy, pair) for pair in PAIRS}
        k[FINEST], flow = by_all_spheres(case.pack)
        row[THROATS] = flow.carrying_throats
    for pair in ALL_PAIRS:
        row[f"{pair}: k"] = k[pair] / case.k
        row[pair] = row[f"{pair}: k"] / row[f"{law_of(pair)}: k0"]
    return row


def slab_row(slab: Slab) -> Row:
    """k0, k and k/k0 of a slab by `ALL_PAIRS`, over the truth.

    A slab is a section of its specimen, cut out with the pressure held on both planes.
    """
    spheres = truth.read_pack(slab.specimen)
    part = cut_out(spheres, slab.planes, (False, True, True))
    row: Row = {
        "case": slab.name,
        "size_ratio": size_ratio(spheres),
        "grains": len(spheres.grains()),
        "fines": len(part.fines()),
        THROATS: by_all_spheres(part, "yz")[1].carrying_throats,
        "k_true_m2": slab.k,
        "truth_error": slab.error,
        "known_before": slab.known_before,
        "k_over_k0": slab.ratio,
    }
    edges = np.unique([*spheres.box[0], *slab.planes]).tolist()
    laws = [(law, damage) for law, damage in (pair.split(" + ") for pair in ALL_PAIRS)]
    results = compare(spheres, periodic="yz", sections=edges, laws=laws)
    for pair, result in zip(ALL_PAIRS, results, strict=True):
        section = next(one for one in result.sections if one.x_lo == slab.planes[0])
        row[f"{law_of(pair)}: k0"] = section.k_initial / slab.k0
        row[f"{pair}: k"] = section.k_damaged / slab.k
        row[pair] = section.k_damaged / section.k_initial / slab.ratio
    return row


def tables(folder: Path) -> str:
    """The tables of docs/evidence/accuracy.md in Markdown, from the written files."""
    packs, cut = pd.read_csv(folder / PACKS), pd.read_csv(folder / SLABS)
    ratio, many = cut["size_ratio"], cut[THROATS] >= FEW_THROATS
    classes = {name: cut[(low <= ratio) & (ratio < high)] for name, (low, high) in SIZES.items()}
    for name, among in (("all", ratio > 0), ("put aside", cut["known_before"] == truth.LATER)):
        classes[f"{name}; {FEW_THROATS} throats or more"] = cut[among & many]
        classes[f"{name}; fewer"] = cut[among & ~many]
    classes[f"k/k0 above {LIGHT:g}"] = cut[cut["k_over_k0"] > LIGHT]
    laws = {PAIRS[0]: "thesis", ARCHIE: SECTION_ARCHIE, FINEST: ALL_SPHERES}
    k = {f"{FINEST}: k": f"k, {ALL_SPHERES}"}
    slab_columns = laws | k | {f"{DEFAULT_LAW}: k0": "k0"}
    intact, filled = packs[packs["fines"] == 0], packs[packs["fines"] > 0]
    kinds = {name: intact[intact["group"] == name] for name in truth.GROUPS}
    filled_by = {f"{size:.0f}": of for size, of in filled.groupby(filled["size_ratio"].round())}
    return "\n\n".join(
        [
            _table("D/d", classes, slab_columns),
            _table("grains alone", kinds, {f"{law}: k0": law for law in LAWS}),
            _table("D/d", filled_by, laws | k),
        ]
    )


def _table(label: str, classes: Mapping[str, pd.DataFrame], columns: Mapping[str, str]) -> str:
    """Number of cases and `summary` of some columns, one line for each class of rows."""
    lines = [[label, "cases", *columns.values()], ["---"] * (2 + len(columns))]
    for name, of in classes.items():
        if len(of):
            lines.append([name, str(len(of)), *(summary(of[column]) for column in columns)])
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def summary(ratios: Iterable[float]) -> str:
    """Root mean square of ln(model / truth), and the ratio furthest from 1.

    From a half on, the root mean square is given as the factor that it stands for.
    """
    logs = np.log(np.array(list(ratios)))
    worst = float(np.exp(logs[np.argmax(np.abs(logs))]))
    rms = float(np.sqrt(np.mean(logs**2)))
    words = f"{100 * rms:.1f} %" if rms < 0.5 else f"factor {np.exp(rms):.1f}"
    return f"{words}, {worst:.{3 if worst < 2 else 1}f}"


def draw(folder: Path) -> None:
    """Signed error of k/k0 of every slab by two laws, against k/k0 and against its throats."""
    mpl.use("Agg")
    import matplotlib.pyplot as plt

    cut = pd.read_csv(folder / SLABS)
    figure, panels = plt.subplots(2, 1, figsize=(6.4, 7.2), constrained_layout=True)
    for axes, against in zip(panels, ("k_over_k0", THROATS), strict=True):
        for pair, colour, marker in ((ARCHIE, "#D55E00", "s"), (FINEST, "#0072B2", "o")):
            error, law = 100.0 * (cut[pair] - 1.0), pair.split(" + ")[1]
            axes.plot(cut[against], error, marker, ms=4, color=colour, alpha=0.7, label=law)
        axes.axhline(0.0, color="#1A1A1A", lw=0.8)
        axes.set(xscale="log", ylabel="error of k/k0, %")
        axes.grid(lw=0.3)
    panels[1].axvline(FEW_THROATS, color="#1A1A1A", lw=0.8, ls=":")
    panels[0].set(xlabel="k/k0 by resolved flow")
    panels[1].set(xlabel="throats that carry the flow")
    panels[0].legend()
    with replacing(folder / FIGURE) as part:
        figure.savefig(part, dpi=110)
    plt.close(figure)


def section_row(folder: Path) -> Row:
    """The first section of a finished run by resolved flow and by the network (`fdnet stokes`)."""
    case = open_run(folder).case
    (section,) = stokes_sections(folder, across=ACROSS_A_FINE, follow=print)
    return {"case": case.name, "seed": case.seed, "sides": case.box.sides} | dict(section)


def write(rows: Iterable[Row], path: Path) -> None:
    """A table of rows with nine significant digits."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as part:
        pd.DataFrame(list(rows)).to_csv(part, index=False, float_format="%.9g", na_rep="nan")


def main(arguments: Sequence[str]) -> int:
    """The command `python scripts/validation.py accuracy`."""
    about = "Every law against resolved flow, on all packs and slabs."
    parser = argparse.ArgumentParser("validation.py accuracy", description=about)
    parser.add_argument("--quick", action="store_true", help="two packs and two slabs")
    parser.add_argument("--out", type=path_option, help="where to write (docs/validation)")
    parser.add_argument("--draw", action="store_true", help="figure and tables of what is written")
    runs = "first sections of finished runs by resolved flow, alone"
    parser.add_argument("--runs", type=path_option, nargs="+", metavar="RUN", help=runs)
    asked = parser.parse_args(arguments)
    folder = asked.out or (Path("runs/accuracy") if asked.quick else FOLDER)
    if asked.runs:
        write(map(section_row, asked.runs), folder / SECTIONS)
        return 0
    if not asked.draw:
        quick = asked.quick
        packs = truth.cases(["SC_touching", "C_r5_d2", "E_80_eps30"] if quick else [])
        cut = truth.slabs(["slabO_r5_light", "slabE_r3"] if quick else [])
        write(map(pack_row, packs), folder / PACKS)
        write(map(slab_row, cut), folder / SLABS)
    draw(folder)
    print(tables(folder))
    return 0
