"""Imports point down, each outside library has one door, each public name one place."""

import ast
import sys
from functools import cache
from pathlib import Path

import pytest

from fdnet.case.file import known_keys

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))
import count

LAYERS = [
    *(["errors", "names"], ["files"], ["sizes", "statistics"], ["spheres", "case"]),
    *(["scales", "network"], ["mechanics", "classes"], ["dem", "report"], ["run"]),
    *(["campaign", "formation"], ["commands"], ["cli"], ["__main__"]),
]
"""Rooms of the package from the bottom up; a room imports from lower lines only."""
NETWORK_LAYERS = [
    *(["geometry", "compiled"], ["stokes"], ["field"], ["tessellation"], ["network"], ["nodes"]),
    *(["fines", "flow"], ["laws", "specimen"], ["states"], ["permeability"], ["warm_up"]),
]
ROOMS = {
    "fdnet": LAYERS,
    "fdnet.campaign": [["plan"], ["engine", "result"], ["page"], ["api"]],
    "fdnet.formation": [["model"], ["scale_up"]],
    "fdnet.network": NETWORK_LAYERS,
}
DOORS = {
    "jinja2": {"dem/deck", "report/html"},
    "subprocess": {
        *("campaign/engine", "dem/liggghts", "network/warm_up"),
        *("report/picture", "spheres/vtk_file"),
    },
    "pandas": {
        *("spheres/dump", "spheres/readers", "network/permeability", "report/tables"),
        *("campaign/result", "formation/scale_up", "commands/formation"),
    },
    "pyvista": {"report/vtk", "report/picture"},
    "vtkmodules": {"report/vtk", "spheres/vtk_file"},
    "imageio_ffmpeg": {"report/picture"},
    "openpnm": {"report/tables"},
    "matplotlib": {"report/figures"},
    "PIL": {"report/html", "report/picture"},
    "numba": {"network/compiled"},
    "pymetis": {"network/flow/solver"},
    "pyamg": {"network/flow/solver"},
    "pydantic": {"case", "report/tables", "run/folder", "campaign/plan"},
    "tomli_w": {"case/case"},
    "rich": {"run/progress"},
}


@cache
def modules(root: Path) -> dict[str, ast.Module]:
    package = root / "fdnet"
    return {
        str(path.relative_to(package).with_suffix("")): ast.parse(path.read_text())
        for path in sorted(package.rglob("*.py"))
    }


@cache
def imported(tree: ast.Module) -> set[str]:
    """Names imported anywhere in the module, except under `if TYPE_CHECKING`."""
    skipped = {
        id(node)
        for test in ast.walk(tree)
        if isinstance(test, ast.If) and "TYPE_CHECKING" in ast.dump(test.test)
        for node in ast.walk(test)
    }
    result = set()
    for node in ast.walk(tree):
        if id(node) in skipped:
            continue
        if isinstance(node, ast.Import):
            result |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative import"
            result.add(node.module or "")
    return result


def room_of(name: str, package: str) -> str | None:
    """The part of `package` that the dotted `name` lies in; None outside of it."""
    inside = name.startswith(f"{package}.")
    return name.removeprefix(f"{package}.").split(".")[0] if inside else None


def layer(room: str, layers: list[list[str]]) -> int:
    return next(number for number, rooms in enumerate(layers) if room in rooms)


@pytest.mark.parametrize("package", ROOMS)
def test_imports_point_down(root, package):
    """Also between the rooms of a room; neighbours of one line do not import each other."""
    for module, tree in modules(root).items():
        own = room_of("fdnet." + module.replace("/", "."), package)
        if own is None or own == "__init__":
            continue
        for name in imported(tree):
            other = room_of(name, package)
            if other is not None and other != own:
                below = layer(other, ROOMS[package]) < layer(own, ROOMS[package])
                assert below, f"fdnet/{module}.py imports {name}"


def test_each_library_has_its_door(root):
    for module, tree in modules(root).items():
        for name in imported(tree):
            library = name.split(".")[0]
            doors = DOORS.get(library, {""})
            inside = any(f"{module}/".startswith(f"{door}/" if door else "") for door in doors)
            assert inside, f"fdnet/{module}.py imports {library}"


FIELD_UNITS = ("_GPa", "_mm", "_cP", "_MPa", "_ms", "_mD")


def test_the_units_of_a_case_file_stay_inside_the_case(root):
    """Everything beyond `fdnet/case` reads a case in SI."""
    keys = {key.rsplit(".")[-1] for key in known_keys() if key.endswith(FIELD_UNITS)}
    assert len(keys) > 10
    for path in [*(root / "fdnet").rglob("*.py"), *(root / "scripts").glob("*.py")]:
        name = path.relative_to(root).as_posix()
        if name.startswith("fdnet/case/"):
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            read = getattr(node, "attr", "")
            assert read not in keys, f"{name}:{node.lineno} reads {read}; take its SI property"


def test_a_public_name_stands_in_one_place(root):
    assert count.names_twice(root) == []


def test_a_step_takes_few_files(root):
    """So many that a reader can hold them: the limits are those of docs/architecture.md."""
    most = dict(zip(count.STEPS, (5, 5, 6, 5, 10, 16), strict=True))
    taken = {name: len(count.files_of(root, start)) for name, start in count.STEPS.items()}
    assert all(taken[name] <= most[name] for name in most), taken
