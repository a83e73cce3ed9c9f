"""The door for Python: public names, each explained and with an example that runs."""

import ast
import doctest
import inspect
import json
import re
import shutil
import subprocess
import sys
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from builders import tiny

import fdnet
from fdnet import errors
from fdnet.case.tables import AnalysisKeys
from fdnet.cli import main

HEAVY = ("numpy", "pandas", "scipy", "pydantic", "pyvista", "vtk", "matplotlib", "numba", "rich")
ERRORS = {name for name in fdnet.__all__ if name.endswith("Error")}
UNITS = re.compile(r"(?<![A-Za-z])(m|mm|um|m2|m3|mD|Pa s|SI|s)(?![A-Za-z0-9])")
NEED_A_RUN = ("run_case", "open_run", "elastic_moduli", "triaxial_test")
"""The example of run_case makes the run that the others open."""
COLUMNS = ("x", "y", "z", "radius", "kind")
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
PUBLIC = [name for name in fdnet.__all__ if name != "__version__"]
PACKAGE = Path(str(fdnet.__file__)).parent


def imports_for_types() -> dict[str, str]:
    """Public names and their modules, as a type checker sees them."""
    tree = ast.parse(Path(str(fdnet.__file__)).read_text())
    block = next(node for node in tree.body if isinstance(node, ast.If))
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


def test_a_case_shows_its_keys_and_what_was_given():
    assert "(*, name, seed=1, box, grains, fluid=Fluid()" in str(inspect.signature(fdnet.Case))
    given = repr(tiny("fluid={viscosity_cP=7.0}"))
    assert "fluid=Fluid(viscosity_cP=7.0)" in given
    assert "gravity" not in given


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


def test_importing_fdnet_and_its_help_load_nothing_heavy():
    """Heavy libraries are imported only by the commands that need them."""
    heavy = f"[name for name in {HEAVY} if name in sys.modules]"
    own = "len([name for name in sys.modules if name.startswith('fdnet')])"
    at_exit = f"import atexit; atexit.register(lambda: print({heavy}))"
    for code, said in (
        (f"import sys, fdnet; dir(fdnet); print({heavy}, {own})", "[] 1\n"),
        (f"import sys, fdnet.cli; {at_exit}; fdnet.cli.main(['run', '--help'])", "[]\n"),
    ):
        command = [sys.executable, "-c", code]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        assert done.stdout.endswith(said)


def test_build_network_and_analyse_give_one_permeability_between_walls():
    """Both take the same walls by default; on this lattice slip adds 54 percent."""
    result, network = fdnet.analyse(lattice()), fdnet.build_network(lattice())
    flow = fdnet.solve_flow(network, fdnet.LAWS[result.law](network))
    length = network.box[0, 1] - network.box[0, 0]
    assert flow.inflow * length / network.area == pytest.approx(result.k_initial, rel=1e-9)


def test_wrong_arguments_of_analyse_are_named():
    for spheres, periodic, expected in (
        ("x.csv", "", "spheres: 'x.csv' is a str, expected a Snapshot or (points, radii, box); "),
        (lattice(), 1, "periodic: 1, expected letters such as 'yz', or truth values: one, or thr"),
    ):
        with pytest.raises(fdnet.CaseError, match=re.escape(expected)):
            fdnet.analyse(spheres, periodic=periodic)


def packs():
    """Points, radii and box, in mm: a cubic lattice, and a pack of two sizes with fines."""
    places = np.indices((3, 3, 3)).reshape(3, -1).T + 0.5
    rng = np.random.default_rng(7)
    grains = places * [1.1, 1.0, 1.2] + rng.uniform(-0.05, 0.05, places.shape)
    radii = np.r_[rng.uniform(0.38, 0.45, 27), np.full(9, 0.12)]
    fines = np.indices((1, 3, 3)).reshape(3, -1).T * [1.1, 1.0, 1.2] + [1.1, 0.02, 0.01]
    kinds = ["grain"] * 27 + ["fine"] * 9
    yield places, np.full(27, 0.5), [3.0, 3.0, 3.0], ["grain"] * 27
    yield np.concatenate([grains, fines]), radii, [3.3, 3.0, 3.6], kinds


@pytest.mark.parametrize("units", ["mm", "m"])
@pytest.mark.parametrize("periodic", ["xyz", "yz"])
def test_permeability_of_arrays_is_that_of_the_command(tmp_path, capsys, units, periodic):
    """To the last digit, with its warnings, along every axis."""
    for points, radii, box, kinds in packs():
        scale = 1.0 if units == "mm" else 1e-3
        points, radii, box = points * scale, radii * scale, [scale * side for side in box]
        file = tmp_path / "pack.csv"
        columns = [*points.T, radii, kinds]
        pd.DataFrame(dict(zip(COLUMNS, columns, strict=True))).to_csv(file, index=False)
        given = ["--units", units, "--box", ",".join(f"0,{side!r}" for side in box)]
        given += ["--periodic", periodic, "--axis", "all", "--json"]
        assert main(["permeability", str(file), *given]) == 0
        said = json.loads(capsys.readouterr().out)
        own = {"units": units, "kind": kinds, "periodic": periodic}
        result = fdnet.permeability(points, radii, box, axis="all", **own)
        assert result.k_m2.tolist() == [said[f"k_{axis}_damaged_m2"] for axis in "xyz"]
        assert result.k_initial_m2.tolist() == [said[f"k_{axis}_m2"] for axis in "xyz"]
        assert result.porosity == said["porosity_damaged"]
        assert list(result.warnings) == said["warnings"]
        one = fdnet.permeability(points, radii, box, axis="y", **own)
        assert one.k_m2 == result.k_m2[1]
        assert one.k_mD == pytest.approx(one.k_m2 / 9.869233e-16)
        grains = np.array(kinds) == "grain"
        plain = (points[grains], radii[grains], box)
        si = tuple(1e-3 / scale * np.asarray(part) for part in plain)
        again = fdnet.analyse(si, periodic=periodic == "xyz" or periodic, axis="y")
        assert again.k_initial == pytest.approx(one.k_initial_m2, rel=1e-9, abs=0)


def test_the_result_of_permeability_is_a_table_and_json():
    points, radii, box, kinds = list(packs())[1]
    result = fdnet.permeability(points, radii, box, kind=kinds, axis="all", sections=3)
    frame, data = result.to_frame(), json.loads(json.dumps(result.to_dict()))
    assert frame["axis"].tolist() == ["x", "y", "z"]
    assert frame["k_mD"].tolist() == data["k_mD"] == result.k_mD.tolist()
    assert len(result.sections) == len(data["sections"]) == 9
    assert {"axis", "x_lo_m", "k_damaged_m2", "fines_count"} <= set(result.sections)
    assert np.all(result.k_m2[:2] < result.k_initial_m2[:2])
    assert result.k_m2[2] <= result.k_initial_m2[2], "light damage, of which it warns"
    assert "<table" in result._repr_html_()
    assert "k_mD" in str(result)


def test_a_box_is_what_people_write():
    """Lengths, bounds, six numbers and the cell of ASE, which is an object with __array__."""

    class Cell:
        def __array__(self, dtype=None, copy=None):
            return np.diag([3.0, 2.0, 1.0])

    place = [[0.5, 0.5, 0.5]]
    for box in ([3, 2, 1], [[0, 3], [0, 2], [0, 1]], [0, 3, 0, 2, 0, 1], Cell()):
        given = {"box": box, "units": "mm", "periodic": np.array([True, False, True])}
        spheres = fdnet.Snapshot.from_arrays(place, 0.5, **given)
        assert spheres.box.tolist() == [[0, 3e-3], [0, 2e-3], [0, 1e-3]]
        assert spheres.periodic == (True, False, True)
        assert (spheres.position.tolist(), spheres.radius.tolist()) == ([[5e-4] * 3], [5e-4])
    for box, said in [
        ([[3, 0, 0], [1, 3, 0], [0, 0, 3]], "is skewed (triclinic), expected sides along x, y"),
        ([3, 0, 1], "expected three lengths above 0, or six numbers"),
        ([3, 2], "expected three lengths above 0, or six numbers"),
    ]:
        with pytest.raises(fdnet.CaseError, match=re.escape(said)):
            fdnet.Snapshot.from_arrays(place, 0.5, box=box)


def test_a_wrong_unit_of_length_is_refused_or_said_aloud():
    points, radii, box, _ = next(packs())
    for side in (3e-3, 3000.0):
        with pytest.raises(fdnet.CaseError, match="expected box, points and radii in one unit"):
            fdnet.permeability(points, radii, [side] * 3)
    with pytest.warns(UserWarning, match="which is no sand") as caught:
        result = fdnet.permeability(points, radii, box, units="m")
    assert "which is no sand" in result.warnings[0]
    with pytest.warns(UserWarning, match="which is no sand") as again:
        fdnet.analyse((points, radii, box), periodic=True)
    assert {Path(one.filename) for one in (*caught, *again)} == {Path(__file__)}
    for axis in ("xy", "", "X"):
        with pytest.raises(fdnet.CaseError, match="expected x, y or z"):
            fdnet.permeability(points, radii, box, axis=axis)


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
