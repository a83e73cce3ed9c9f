"""Imports point down, and each outside library has one door."""

import ast
from pathlib import Path

import pytest

LAYERS = [
    ["errors"],
    ["atomic", "snapshot"],
    ["case_parts", "contacts"],
    ["case_rules"],
    ["case"],
    ["case_file", "contact_law"],
    ["time_step"],
    ["scales"],
    ["cost", "network"],
    ["scale_table"],
    ["dem", "report"],
    ["progress", "run_folder", "summary_text"],
    ["summary", "outputs", "records"],
    ["pipeline"],
    ["permeability_command"],
    ["studies"],
    ["cli"],
]
SIDEWAYS = {
    ("network", "network"),
    ("dem", "dem"),
    ("report", "report"),
    ("studies", "studies"),
    ("snapshot", "atomic"),
}
DOORS = {
    "jinja2": {"dem/deck", "report/html", "studies"},
    "subprocess": {"dem/liggghts", "report/vtk"},
    "pandas": {"dem/dump", "report/tables", "report/spheres"},
    "pyvista": {"report/vtk", "report/render"},
    "matplotlib": {"report/figures", "report/side_view", "studies/draw", "studies/thesis/draw_canvas"},
    "PIL": {"studies/thesis/draw_canvas"},
    "numba": {"network/compiled"},
    "pymetis": {"network/solver"},
    "pyamg": {"network/solver", "studies/solver_peers"},
    "pydantic": {"case", "case_parts", "case_file"},
    "tomli_w": {"case"},
    "rich": {"progress"},
}


def modules(root: Path) -> dict[str, ast.Module]:
    package = root / "fdnet"
    return {
        str(path.relative_to(package).with_suffix("")): ast.parse(path.read_text())
        for path in sorted(package.rglob("*.py"))
    }


def imported(tree: ast.Module) -> set[str]:
    """Names imported anywhere in the module, except under `if TYPE_CHECKING`."""
    skipped = {
        id(node)
        for test in ast.walk(tree)
        if isinstance(test, ast.If) and "TYPE_CHECKING" in ast.dump(test.test)
        for node in ast.walk(test)
    }
    found = set()
    for node in ast.walk(tree):
        if id(node) in skipped:
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative import"
            found.add(node.module or "")
    return found


def layer(name: str) -> int:
    return next(i for i, names in enumerate(LAYERS) if name in names)


def test_imports_point_down(root):
    for module, tree in modules(root).items():
        own = module.split("/")[0]
        if own == "__init__":
            continue
        for name in imported(tree):
            if name.startswith("fdnet."):
                other = name.split(".")[1]
                below = layer(other) < layer(own)
                assert below or (own, other) in SIDEWAYS, f"fdnet/{module}.py imports {name}"


def test_each_library_has_its_door(root):
    for module, tree in modules(root).items():
        for name in imported(tree):
            library = name.split(".")[0]
            if library in DOORS:
                assert any(module == door or module.startswith(f"{door}/") for door in DOORS[library]), (
                    f"fdnet/{module}.py imports {library}"
                )


def test_the_network_half_never_imports_the_dem_half(root):
    for module, tree in modules(root).items():
        if module.startswith("network/"):
            assert not any(name.startswith(("fdnet.dem", "fdnet.report")) for name in imported(tree)), module


@pytest.mark.parametrize("limit", [300])
def test_files_stay_readable(root, limit):
    for path in [*(root / "fdnet").rglob("*.py"), *(root / "scripts").glob("*.py")]:
        assert len(path.read_text().splitlines()) <= limit, path


def test_functions_stay_readable(root):
    """Long constructors, one argument a line, are the reason for 55 and not 40."""
    for module, tree in modules(root).items():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                length = (node.end_lineno or 0) - node.lineno + 1
                assert length <= 55, f"fdnet/{module}.py: {node.name} has {length} lines"
