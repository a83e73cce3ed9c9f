"""The door for Python: public names, each explained and with an example that runs."""

import ast
import doctest
import inspect
import re
import shutil
import subprocess
import sys
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from builders import tiny

import fdnet
from fdnet import errors
from fdnet.case.tables import AnalysisKeys

HEAVY = ("numpy", "pandas", "scipy", "pydantic", "pyvista", "vtk", "matplotlib", "numba", "rich")
ERRORS = {name for name in fdnet.__all__ if name.endswith("Error")}
UNITS = re.compile(r"(?<![A-Za-z])(m|mm|um|m2|m3|mD|Pa s|SI|s)(?![A-Za-z0-9])")
NEED_A_RUN = ("run_case", "open_run", "elastic_moduli", "triaxial_test")
"""The example of run_case makes the run that the others open."""
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
PUBLIC = [name for name in fdnet.__all__ if name != "__version__"]
PACKAGE = Path(str(fdnet.__file__)).parent


def imports_for_types() -> dict[str, str]:
    """Public names and their modules, as a type checker sees them."""
    tree = ast.parse(Path(str(fdnet.__file__)).read_text())
    block = next(
        node
        for node in tree.body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    )
    imports = [node for node in block.body if isinstance(node, ast.ImportFrom)]
    return {alias.asname: node.module for node in imports for alias in node.names}


def explanation(name: str) -> str:
    """The docstring of a public name; of a constant the text below it in its module."""
    value = getattr(fdnet, name)
    if inspect.isclass(value) or inspect.isfunction(value):
        return inspect.cleandoc(value.__doc__ or "")
    source = Path(str(import_module(imports_for_types()[name]).__file__)).read_text()
    for statement, after in pairwise(ast.parse(source).body):
        targets = getattr(statement, "targets", [getattr(statement, "target", None)])
        if any(getattr(target, "id", None) == name for target in targets):
            text = getattr(getattr(after, "value", None), "value", "")
            return inspect.cleandoc(text) if isinstance(text, str) else ""
    return ""


def lattice() -> fdnet.Snapshot:
    """27 touching spheres of 1 mm."""
    place = 1e-3 * (np.indices((3, 3, 3)).reshape(3, -1).T + 0.5)
    return fdnet.Snapshot.from_arrays(place, 0.5e-3)


def test_the_fixed_names_are_there_and_what_a_type_checker_sees_is_loaded():
    names = "read_case Case run_case open_run read_spheres Snapshot analyse compare build_network"
    names += " measure_occupancy solve_flow velocity_field LAWS DAMAGE_LAWS __version__"
    assert set(names.split()) <= set(fdnet.__all__)
    assert sorted(fdnet.__all__) == dir(fdnet)
    assert re.fullmatch(r"\d+\.\d+.*", fdnet.__version__)
    classes = inspect.getmembers(errors, inspect.isclass)
    assert {name for name, one in classes if issubclass(one, Exception)} == ERRORS
    seen = imports_for_types()
    assert set(seen) == set(PUBLIC)
    for name, module in seen.items():
        assert getattr(fdnet, name) is getattr(import_module(module), name), name
    assert (PACKAGE / "py.typed").exists()
    with pytest.raises(AttributeError, match="no attribute 'velocity'"):
        _ = fdnet.velocity  # type: ignore[attr-defined]
    for function in (fdnet.analyse, fdnet.compare):
        assert set(AnalysisKeys.__annotations__) <= set(inspect.signature(function).parameters)


def test_importing_fdnet_loads_nothing_heavy():
    code = (
        "import sys, fdnet; dir(fdnet); "
        f"print([name for name in {HEAVY} if name in sys.modules], "
        "len([name for name in sys.modules if name.startswith('fdnet')]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["[]", "1"]


def test_build_network_and_analyse_give_one_permeability_between_walls():
    """Both take the same walls by default; on this lattice slip adds 54 percent."""
    result, network = fdnet.analyse(lattice()), fdnet.build_network(lattice())
    flow = fdnet.solve_flow(network, fdnet.LAWS[result.law](network))
    length = network.box[0, 1] - network.box[0, 0]
    assert flow.inflow * length / network.area == pytest.approx(result.k_initial, rel=1e-9)


def test_wrong_arguments_of_analyse_are_named():
    for spheres, periodic, expected in [
        ("x.csv", "", "spheres: 'x.csv' is a str, expected a Snapshot; read one with fdnet.read"),
        (lattice(), True, "periodic: True, expected letters such as 'yz', or three truth values"),
    ]:
        with pytest.raises(fdnet.CaseError, match=re.escape(expected)):
            fdnet.analyse(spheres, periodic=periodic)


def test_every_public_name_is_explained():
    """A docstring, units unless it is an error, and an example."""
    for name in PUBLIC:
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


@pytest.mark.liggghts
def test_examples_run(workplace, monkeypatch):
    monkeypatch.chdir(workplace)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    for name in [*NEED_A_RUN, *(one for one in PUBLIC if one not in NEED_A_RUN)]:
        example = doctest.DocTestParser().get_doctest(explanation(name), {}, name, None, 0)
        assert example.examples, name
        report: list[str] = []
        doctest.DocTestRunner(optionflags=FLAGS).run(example, out=report.append)
        assert not report, "".join(report)
