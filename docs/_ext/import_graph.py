"""The import graph of the package, drawn from the code.

    python docs/_ext/import_graph.py

writes `docs/import_graph.csv`, one row for each edge (who imports whom), and the picture
`docs/import_graph.svg`. One node is a folder of `fdnet`, or a module directly in it, or all
scripts, or the deck templates, which `fdnet.dem` reads as package data.
"""

import ast
import csv
import hashlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

Edge = tuple[str, str]
Place = tuple[float, float]
ROOT = Path(__file__).resolve().parents[2]
SCRIPTS, TEMPLATES, DOOR = "scripts", "liggghts_templates", "__init__"
NAMES = {DOOR: "import fdnet"}
"""What the picture calls a node, where that is not its name."""


def edges_of(root: Path) -> set[Edge]:
    """Pairs (importer, imported) of nodes; imports for type checkers alone do not count."""
    nodes = nodes_of(root)
    edges = set()
    for path, node in _files(root):
        for name in _imported(ast.parse(path.read_text("utf-8"))):
            other = _node_of(name, nodes)
            if other is not None and other != node:
                edges.add((node, other))
    return edges


def nodes_of(root: Path) -> set[str]:
    """Names of the folders and modules of the package, and of the scripts."""
    return {node for _, node in _files(root)}


def layers_of(nodes: set[str], edges: set[Edge]) -> dict[str, int]:
    """Layer of each node: 0 imports nothing, every other lies one above the highest it imports.

    Raises ValueError when the graph has a cycle.
    """
    layers: dict[str, int] = {}
    while len(layers) < len(nodes):
        ready = {
            node
            for node in nodes - set(layers)
            if all(other in layers for one, other in edges if one == node)
        }
        if not ready:
            raise ValueError(f"import cycle among {sorted(nodes - set(layers))}")
        for node in ready:
            below = [layers[other] for one, other in edges if one == node]
            layers[node] = 1 + max(below, default=-1)
    return layers


def _files(root: Path) -> Iterator[tuple[Path, str]]:
    """Every Python file with the node it belongs to; the package's own `__init__` is a node."""
    package = root / "fdnet"
    for path in sorted(package.rglob("*.py")):
        yield path, path.relative_to(package).with_suffix("").parts[0]
    for folder in (SCRIPTS, TEMPLATES):
        for path in sorted((root / folder).glob("*.py")):
            yield path, folder


def _imported(tree: ast.Module) -> Iterator[str]:
    skipped = {
        id(node)
        for test in ast.walk(tree)
        if isinstance(test, ast.If) and "TYPE_CHECKING" in ast.dump(test.test)
        for node in ast.walk(test)
    }
    for node in ast.walk(tree):
        if id(node) in skipped:
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Constant) and node.value == TEMPLATES:
            yield TEMPLATES


def _node_of(name: str, nodes: set[str]) -> str | None:
    """The node that a dotted name lies in; a name of the package itself is its `__init__`."""
    parts = name.split(".")
    if parts[0] != "fdnet":
        return TEMPLATES if parts[0] == TEMPLATES else None
    return parts[1] if len(parts) > 1 and parts[1] in nodes else DOOR


def write_csv(path: Path, edges: set[Edge]) -> None:
    """The edges, sorted, with the header importer,imported."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("importer", "imported"))
        writer.writerows(sorted(edges))


def read_csv(path: Path) -> set[Edge]:
    """The edges that `write_csv` wrote."""
    with path.open(newline="", encoding="utf-8") as file:
        return {(row["importer"], row["imported"]) for row in csv.DictReader(file)}


def counts_of(nodes: set[str], edges: set[Edge]) -> str:
    """For a title: how many nodes, layers and edges."""
    layers = 1 + max(layers_of(nodes, edges).values())
    return f"{len(nodes)} nodes, {layers} layers, {len(edges)} edges"


def draw_svg(path: Path, nodes: set[str], edges: set[Edge]) -> None:
    """Nodes by layer from the bottom up; an edge that others imply is thin."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    places = _places(nodes, edges)
    style = {"svg.hashsalt": "fdnet", "svg.fonttype": "none", "font.family": "sans-serif"}
    with matplotlib.rc_context(style):
        figure, axes = pyplot.subplots(figsize=(8, 7.2))
        for one, other in sorted(edges):
            _draw_edge(axes, places[one], places[other], plain=_implied(edges, one, other))
        for node in sorted(nodes):
            _draw_node(axes, node, places[node])
        across = [x for x, _ in places.values()]
        axes.set_xlim(min(across) - 1, max(across) + 1)
        axes.set_ylim(-0.5, 0.5 + max(y for _, y in places.values()))
        axes.set_axis_off()
        description = f"{counts_of(nodes, edges)} ({digest_of(edges)})"
        about = {"Date": None, "Creator": None, "Description": description}
        figure.savefig(path, metadata=about, bbox_inches="tight", transparent=True)
        pyplot.close(figure)


def digest_of(edges: set[Edge]) -> str:
    """A short hash of the edges, by which the picture says what it shows."""
    return hashlib.sha256(repr(sorted(edges)).encode()).hexdigest()[:12]


def _implied(edges: set[Edge], one: str, other: str) -> bool:
    """Whether a longer chain of imports leads from `one` to `other` too."""
    seen, waiting = set(), [below for above, below in edges if above == one and below != other]
    while waiting:
        node = waiting.pop()
        if node == other:
            return True
        if node not in seen:
            seen.add(node)
            waiting += [below for above, below in edges if above == node]
    return False


def _places(nodes: set[str], edges: set[Edge]) -> dict[str, Place]:
    """Position of each node: its layer upwards, sideways near what it imports."""
    layers = layers_of(nodes, edges)
    places: dict[str, Place] = {}
    for number in range(1 + max(layers.values())):
        row = sorted(node for node in nodes if layers[node] == number)
        middle = {node: [places[other][0] for one, other in edges if one == node] for node in row}
        row.sort(key=lambda node: (sum(middle[node]) / max(1, len(middle[node])), node))
        shift = 0.35 * (-1) ** number if len(row) % 2 else 0.0
        for index, node in enumerate(row):
            places[node] = (2.2 * (index - (len(row) - 1) / 2) + shift, float(number))
    return places


def _draw_node(axes: Any, node: str, place: Place) -> None:
    box = {"boxstyle": "round,pad=0.45", "facecolor": "#e8f1f5", "edgecolor": "#2a6f97"}
    text = NAMES.get(node, node)
    axes.text(*place, text, ha="center", va="center", fontsize=11, bbox=box, zorder=3)


def _draw_edge(axes: Any, start: Place, end: Place, *, plain: bool) -> None:
    """From the lower side of the importer's box to the upper side of the other's."""
    bend = 0.12 if start[1] - end[1] > 1 else 0.0
    arrow = {
        "arrowstyle": "-" if plain else "-|>",
        "color": "#c9d3d8" if plain else "#2a6f97",
        "linewidth": 0.7 if plain else 1.3,
        "shrinkA": 0,
        "shrinkB": 0,
        "connectionstyle": f"arc3,rad={bend}",
    }
    where = {"xy": (end[0], end[1] + 0.22), "xytext": (start[0], start[1] - 0.22)}
    axes.annotate("", zorder=1 if plain else 2, arrowprops=arrow, **where)


def main() -> int:
    """Write the table and the picture of this project's imports."""
    nodes, edges = nodes_of(ROOT), edges_of(ROOT)
    write_csv(ROOT / "docs" / "import_graph.csv", edges)
    draw_svg(ROOT / "docs" / "import_graph.svg", nodes, edges)
    print(f"docs/import_graph.csv, docs/import_graph.svg: {counts_of(nodes, edges)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
