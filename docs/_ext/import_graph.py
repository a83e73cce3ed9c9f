"""The import graph of the package, drawn from the code.

    python docs/_ext/import_graph.py

writes `docs/import_graph.csv` (one row for each edge: who imports whom) and `docs/import_graph.svg`
next to it. A folder of `fdnet` is one node, so is a module directly in it, and so are the scripts.
"""

import ast
import csv
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

Edge = tuple[str, str]
ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = "scripts"


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
    for path in sorted((root / SCRIPTS).glob("*.py")):
        yield path, SCRIPTS


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


def _node_of(name: str, nodes: set[str]) -> str | None:
    """The node that a dotted name lies in; a name of the package itself is its `__init__`."""
    parts = name.split(".")
    if parts[0] != "fdnet":
        return None
    return parts[1] if len(parts) > 1 and parts[1] in nodes else "__init__"


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
