"""The door for Python: public names, each explained and with an example that runs."""

import ast
import doctest
import inspect
import re
import shutil
import subprocess
import sys
from dataclasses import fields, is_dataclass
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from builders import tiny

import fdnet

HEAVY = ("numpy", "pandas", "scipy", "pydantic", "pyvista", "vtk", "matplotlib", "numba", "rich")
ERRORS = {name for name in fdnet.__all__ if name.endswith("Error")}
UNITS = re.compile(r"(?<![A-Za-z])(m|mm|um|m2|m3|mD|Pa s|SI|s)(?![A-Za-z0-9])")
NEED_A_RUN = ("run_case", "open_run", "elastic_moduli", "triaxial_test")
"""The example of run_case makes the run that the others open."""
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def explanation(name: str) -> str:
    """The docstring of a public name; of a constant the text below it in its module."""
    value = getattr(fdnet, name)
    if inspect.isclass(value) or inspect.isfunction(value):
        return inspect.cleandoc(value.__doc__ or "")
    source = Path(str(import_module(fdnet._HOME[name]).__file__)).read_text()
    body = ast.parse(source).body
    for statement, after in pairwise(body):
        targets = getattr(statement, "targets", [getattr(statement, "target", None)])
        if any(getattr(target, "id", None) == name for target in targets):
            text = getattr(getattr(after, "value", None), "value", "")
            return inspect.cleandoc(text) if isinstance(text, str) else ""
    return ""


PUBLIC = [name for name in fdnet.__all__ if name != "__version__"]


def test_the_fixed_names_are_there():
    assert {
        "read_case",
        "Case",
        "run_case",
        "open_run",
        "read_spheres",
        "Snapshot",
        "analyse",
        "compare",
        "build_network",
        "measure_occupancy",
        "solve_flow",
        "velocity_field",
        "LAWS",
        "DAMAGE_LAWS",
        "__version__",
    } <= set(fdnet.__all__)
    assert set(fdnet.__all__) <= set(dir(fdnet))
    assert re.fullmatch(r"\d+\.\d+.*", fdnet.__version__)


def test_every_error_is_public():
    from fdnet import errors

    of_errors = inspect.getmembers(errors, inspect.isclass)
    classes = {name for name, one in of_errors if issubclass(one, Exception)}
    assert classes == ERRORS


def test_types_and_names_agree():
    """What a type checker sees (the imports under TYPE_CHECKING) is what is loaded at run time."""
    tree = ast.parse(Path(str(fdnet.__file__)).read_text())
    block = next(
        node
        for node in tree.body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    )
    seen = {
        alias.asname: node.module
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert seen == fdnet._HOME
    assert (Path(str(fdnet.__file__)).parent / "py.typed").exists()


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'velocity'"):
        _ = fdnet.velocity  # type: ignore[attr-defined]


def test_build_network_and_analyse_give_one_permeability_between_walls():
    """Both take the same walls by default; on this lattice slip adds 54 percent."""
    lattice = 1e-3 * (np.indices((3, 3, 3)).reshape(3, -1).T + 0.5)
    spheres = fdnet.Snapshot.from_arrays(lattice, 0.5e-3)
    result = fdnet.analyse(spheres)
    network = fdnet.build_network(spheres)
    flow = fdnet.solve_flow(network, fdnet.LAWS[result.law](network))
    length = network.box[0, 1] - network.box[0, 0]
    assert flow.inflow * length / network.area == pytest.approx(result.k_initial, rel=1e-9)


def test_importing_fdnet_loads_nothing_heavy():
    code = (
        "import sys, fdnet; dir(fdnet); "
        f"print([name for name in {HEAVY} if name in sys.modules], "
        "len([name for name in sys.modules if name.startswith('fdnet')]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["[]", "1"]


@pytest.mark.parametrize("name", PUBLIC)
def test_every_public_name_is_explained(name):
    """A docstring, units unless it is an error, and an example."""
    text = explanation(name)
    assert len(text.splitlines()[0].split()) >= 4, f"{name}: no docstring"
    assert ">>>" in text, f"{name}: no example"
    assert name in ERRORS or UNITS.search(text.partition(">>>")[0]), f"{name}: no units"


@pytest.fixture(scope="module")
def workplace(tmp_path_factory, root):
    """A folder with the shipped cases; cases/quick.toml is replaced by a smaller one."""
    folder = tmp_path_factory.mktemp("workplace")
    shutil.copytree(root / "cases", folder / "cases")
    small = tiny("name=quick").toml().replace('name = "tiny"', 'name = "quick"')
    (folder / "cases" / "quick.toml").write_text(small)
    return folder


def run_example(name: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    example = doctest.DocTestParser().get_doctest(explanation(name), {}, name, None, 0)
    assert example.examples
    report: list[str] = []
    doctest.DocTestRunner(optionflags=FLAGS).run(example, out=report.append)
    assert not report, "".join(report)


@pytest.mark.parametrize("name", [name for name in PUBLIC if name not in NEED_A_RUN])
def test_examples_run(name, workplace, monkeypatch):
    run_example(name, workplace, monkeypatch)


@pytest.mark.liggghts
def test_examples_of_a_run(workplace, monkeypatch):
    for name in NEED_A_RUN:
        run_example(name, workplace, monkeypatch)


def array_owners() -> list[type]:
    """Every data class of spheres and networks with a field that is an array, but private ones."""
    package = Path(str(fdnet.__file__)).parent
    owners = {}
    for path in sorted([*package.glob("network/**/*.py"), *package.glob("spheres/*.py")]):
        name = ".".join(["fdnet", *path.relative_to(package).with_suffix("").parts])
        if "Array" not in path.read_text() or path.name == "__init__.py":
            continue
        for value in vars(import_module(name)).values():
            if not (inspect.isclass(value) and is_dataclass(value)):
                continue
            types = " ".join(str(field.type) for field in fields(value))
            if value.__module__ == name and value.__name__[0] != "_" and "ndarray" in types:
                owners[value.__qualname__] = value
    return list(owners.values())


def test_owners_of_arrays_print_on_one_line():
    """The representation that `dataclass` makes prints whole arrays."""
    owners = array_owners()
    assert {"Snapshot", "Network", "Occupancy", "Flow", "Analysis"} <= {
        owner.__name__ for owner in owners
    }
    made = [owner for owner in owners if hasattr(owner.__repr__, "__wrapped__")]
    assert not made


def test_what_prints_is_short():
    lattice = 1e-3 * (np.indices((3, 3, 3)).reshape(3, -1).T + 0.5)
    spheres = fdnet.Snapshot.from_arrays(lattice, 0.5e-3)
    result = fdnet.analyse(spheres, periodic="yz", sections=2)
    for owner in (spheres, result, result.network, result.flow_initial, result.profile):
        text = repr(owner)
        assert "\n" not in text
        assert len(text) < 700, text
        assert text.startswith(type(owner).__name__)
    assert "27 grains, 0 fines" in repr(spheres)
    assert f"{result.k_initial:.4g} m2" in repr(result)


@pytest.mark.parametrize(
    ("spheres", "periodic", "expected"),
    [
        ("x.csv", "", "spheres: 'x.csv' is a str, expected a Snapshot; read one with fdnet.read"),
        (None, True, "periodic: True, expected letters such as 'yz', or three truth values"),
    ],
)
def test_wrong_arguments_of_analyse_are_named(spheres, periodic, expected):
    if spheres is None:
        lattice = 1e-3 * (np.indices((3, 3, 3)).reshape(3, -1).T + 0.5)
        spheres = fdnet.Snapshot.from_arrays(lattice, 0.5e-3)
    with pytest.raises(fdnet.CaseError, match=re.escape(expected)):
        fdnet.analyse(spheres, periodic=periodic)


def test_only_public_names_are_listed():
    assert sorted(fdnet.__all__) == dir(fdnet)


def test_the_keywords_of_analyse_are_visible():
    from fdnet.case.tables import AnalysisKeys

    for function in (fdnet.analyse, fdnet.compare):
        assert set(AnalysisKeys.__annotations__) <= set(inspect.signature(function).parameters)
