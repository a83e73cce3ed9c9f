"""The wheel carries everything: installed elsewhere it renders a deck and runs a case."""

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from builders import tiny

SMOKE = """
import sys, fdnet
fast = [name for name in ("numpy", "pandas", "scipy") if name in sys.modules]
case = fdnet.read_case(sys.argv[1])
stages = ("pack", "invade", "analyse")
run = fdnet.run_case(case, "run", liggghts=sys.argv[2], stages=stages)
spheres = fdnet.read_spheres("run/spheres_damaged.csv", box=[(0, side) for side in case.size_m])
again = fdnet.analyse(spheres, options=case.analysis)
import liggghts_templates
assert liggghts_templates.__file__.startswith(sys.argv[3])
print(fdnet.__file__, fast, run.sections.shape[0], again.k_damaged / run.summary["k_damaged_m2"])
"""

COMES_WITH = {"PIL": "matplotlib", "pydantic_core": "pydantic", "vtkmodules": "pyvista"}
"""Modules that are imported, and the dependency whose own requirements bring them."""


def test_what_fdnet_imports_is_what_pyproject_asks_for(root):
    """OpenMPI's launcher and Snakemake are started, not imported."""
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    trees = [ast.parse(path.read_text()) for path in (root / "fdnet").rglob("*.py")]
    nodes = [node for tree in trees for node in ast.walk(tree)]
    names = [one.name for node in nodes if isinstance(node, ast.Import) for one in node.names]
    names += [node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)]
    own = {*sys.stdlib_module_names, "fdnet", "liggghts_templates"}
    imported = {name.split(".")[0] for name in names} - own

    def asked(requirements):
        return {re.split(r"[<>=\[]", one)[0].replace("-", "_") for one in requirements}

    extras = project["optional-dependencies"]
    optional = asked(extras["view"] + extras["movie"] + extras["openpnm"]) - {"fdnet"}
    needed = optional | asked(project["dependencies"])
    assert {COMES_WITH.get(name, name) for name in imported} == needed


def test_the_image_has_the_debian_packages_of_the_setup(root):
    setup, image = (root / name for name in ("scripts/setup.sh", "Dockerfile"))
    (packages,) = re.findall(r"gl_packages=\((.*)\)", setup.read_text())
    assert {*packages.split(), "liggghts", "python3-venv"} <= set(image.read_text().split())


@pytest.fixture(scope="module")
def installed(root, tmp_path_factory) -> Path:
    """A folder outside of the project with the wheel installed in it."""
    tmp_path = tmp_path_factory.mktemp("wheel")
    pip = [sys.executable, "-m", "pip"]
    quiet = ["--no-deps", "--quiet", "--disable-pip-version-check"]
    build = [*pip, "wheel", *quiet, "-w", str(tmp_path), str(root)]
    built = subprocess.run(build, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    wheel, target = next(tmp_path.glob("fdnet-*.whl")), tmp_path / "site"
    install = [*pip, "install", *quiet, "--target", str(target), str(wheel)]
    subprocess.run(install, check=True, capture_output=True)
    return target


@pytest.mark.liggghts
def test_a_wheel_installed_elsewhere_runs_a_case(installed, binary, tmp_path):
    """The whole story and the analysis of its spheres; nothing is of the project."""
    (tmp_path / "tiny.toml").write_text(tiny("run.cap_ms=0.2").toml())
    words = [sys.executable, "-c", SMOKE, "tiny.toml", str(binary.path), str(installed)]
    there = {"cwd": tmp_path, "env": os.environ | {"PYTHONPATH": str(installed)}}
    done = subprocess.run(words, capture_output=True, text=True, check=False, **there)
    assert done.returncode == 0, done.stderr
    file, fast, rows, ratio = done.stdout.split()
    assert file.startswith(str(installed))
    assert (fast, rows) == ("[]", "3")
    assert float(ratio) == 1.0


def test_setup_empties_no_folder_that_its_venv_links_to(root, tmp_path, binary):
    """`python -m venv --clear` follows a link and removes all that is there."""
    other = tmp_path / "other"
    (tmp_path / "project/scripts").mkdir(parents=True)
    other.mkdir()
    (other / "kept.txt").write_text("kept")
    (tmp_path / "project/.venv").symlink_to(other)
    shutil.copy(root / "scripts/setup.sh", tmp_path / "project/scripts")
    words = ["bash", str(tmp_path / "project/scripts/setup.sh")]
    own = os.environ | {"FDNET_LIGGGHTS": str(binary.path)}
    done = subprocess.run(words, env=own, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "is a link to" in done.stderr + done.stdout
    assert (other / "kept.txt").read_text() == "kept"
