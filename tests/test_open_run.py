"""A finished run as an object: tables, spheres, network, hand-over, and what is refused."""

import errno
import json
import re
import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from builders import tiny

import fdnet
from fdnet.case.file import case_from
from fdnet.errors import CaseError
from fdnet.report.text import facts
from fdnet.run.finished import FinishedRun

pytestmark = pytest.mark.liggghts


@pytest.fixture(scope="module")
def run(finished) -> FinishedRun:
    """Fixed grains, periodic sides."""
    return finished


@pytest.fixture(scope="module")
def mobile(tmp_path_factory) -> FinishedRun:
    """Mobile grains between walls, analysed and not reported."""
    case = tiny("run.cap_ms=0.2", "grains.motion=mobile")
    out = tmp_path_factory.mktemp("mobile") / "run"
    return fdnet.run_case(case, out, stages=("pack", "invade", "analyse"))


@pytest.fixture
def copied(run, tmp_path) -> Path:
    return Path(shutil.copytree(run.path, tmp_path / "run"))


def test_tables_agree_with_the_summary(run):
    summary = run.summary
    assert run.summary == json.loads((run.path / "summary.json").read_text())
    assert len(run.sections) == len(summary["sections"]) == 3
    assert run.sections["fines_count"].sum() == summary["invaded_count"] > 0
    assert run.sections["k_initial_m2"].to_numpy() == pytest.approx(
        [row["k_initial_m2"] for row in summary["sections"]], rel=1e-8, abs=0
    )
    assert (len(run.pores), len(run.throats)) == (summary["pores"], summary["throats"])
    assert run.throats["blocked"].sum() == summary["throats_blocked"]
    assert run.profile["x_hi_m"].iloc[-1] == run.case.size_m[0]
    last = run.history.iloc[-1]
    assert last["invaded"] == summary["invaded_count"]
    assert last["time_s"] == pytest.approx(last["step"] * summary["dem_dt_s"], rel=1e-8, abs=0)
    assert run.history["time_s"].is_monotonic_increasing
    assert list(run.history["physical_time_s"]) == list(run.history["time_s"])
    assert last["physical_time_s"] == pytest.approx(summary["physical_time_s"], rel=1e-8)
    for name in ("invaded", "passed", "upstream", "supplied"):
        assert last[f"{name}_count"] == summary[f"{name}_count"], name


@pytest.mark.parametrize("kind", ["fixed", "mobile"])
def test_its_spheres_give_its_permeability_again(kind, request):
    """The stored spheres hold every digit: the analysis from the files is the one of the run."""
    one = request.getfixturevalue("run" if kind == "fixed" else kind)
    again = fdnet.analyse(
        one.spheres("initial"),
        one.spheres(),
        periodic=one.case.periodic,
        options=one.case.analysis,
    )
    assert again.k_initial == one.summary["k_initial_m2"]
    assert again.k_damaged == one.summary["k_damaged_m2"]


@pytest.mark.parametrize("kind", ["fixed", "mobile"])
def test_the_last_dump_gives_the_same_permeability_as_the_table(kind, request):
    """LIGGGHTS's own file of the last state, read as any dump, against spheres_damaged.csv."""
    one = request.getfixturevalue("run" if kind == "fixed" else kind)
    box = [(0.0, side) for side in one.case.size_m]
    step = int(one.history["step"].iloc[-1])
    dump = fdnet.read_spheres(one.path / "invade" / "post" / f"invade_{step}.dump", box=box)
    if kind == "fixed":
        # grains that cannot move are not dumped again
        dump = fdnet.read_spheres(one.path / "pack" / "post" / "pack.dump", box=box).joined(dump)
    table = fdnet.read_spheres(one.path / "spheres_damaged.csv", box=box)
    assert len(dump) == len(table)
    choices = {"periodic": one.case.periodic, "law": "lubrication", "damage_law": "section-archie"}
    first, second = fdnet.analyse(dump, **choices), fdnet.analyse(table, **choices)
    assert first.k_initial == pytest.approx(second.k_initial, rel=1e-9, abs=0)
    assert first.k_damaged == pytest.approx(second.k_damaged, rel=1e-9, abs=0)
    assert second.k_damaged < second.k_initial


def test_its_network_is_the_one_of_its_tables(run):
    network = run.network()
    places = run.pores[[f"pore_coords_{k}_m" for k in range(3)]].to_numpy()
    assert network.pore_position == pytest.approx(places, rel=1e-7, abs=1e-12)
    flow = fdnet.solve_flow(network, run.conductance())
    k = flow.inflow * float(np.ptp(network.box[0])) / network.area
    assert run.summary["damage_law_used"] == "all-spheres"
    assert k == pytest.approx(run.summary["k_damaged_other_m2"], rel=1e-7, abs=0)


def test_its_meshes_are_ready_to_plot(run):
    network, balls = run.network_mesh(), run.sphere_mesh("initial")
    assert network.n_lines == run.summary["throats"]
    assert "conductance_damaged_m3" in network.cell_data
    grains = run.spheres("initial")
    top = (grains.position + grains.radius[:, None]).max(axis=0)
    assert np.array(balls.bounds)[1::2] == pytest.approx(top, rel=0.02, abs=0)
    assert set(np.unique(balls.point_data["kind"])) == {1}


@pytest.mark.parametrize(
    ("state", "law", "number"),
    [
        ("initial", None, "k_initial_m2"),
        ("damaged", None, "k_damaged_m2"),
        ("damaged", "all-spheres", "k_damaged_m2"),
        ("damaged", "section-archie", "k_damaged_other_m2"),
    ],
)
@pytest.mark.parametrize("kind", ["fixed", "mobile"])
def test_openpnm_finds_the_permeability_of_the_summary(kind, state, law, number, request):
    openpnm = pytest.importorskip("openpnm", reason="OpenPNM is not installed")
    one = request.getfixturevalue("run" if kind == "fixed" else kind)
    pores = one.to_openpnm(state, damage_law=law)
    fluid = openpnm.phase.Phase(network=pores)
    fluid["throat.hydraulic_conductance"] = pores["throat.hydraulic_conductance"]
    stokes = openpnm.algorithms.StokesFlow(network=pores, phase=fluid)
    stokes.set_value_BC(pores=pores.pores("inlet"), values=1.0)
    stokes.set_value_BC(pores=pores.pores("outlet"), values=0.0)
    stokes.run()
    rate = float(stokes.rate(pores=pores.pores("inlet"))[0])
    length, width, height = one.case.size_m
    k = rate * one.case.fluid.viscosity_Pa_s * length / (width * height)
    assert k == pytest.approx(one.summary[number], rel=1e-6, abs=0)


@pytest.mark.parametrize("kind", ["fixed", "mobile"])
def test_the_arrays_for_openpnm_balance_without_it(kind, request):
    """Solved with plain linear algebra.

    Throats across the periodic sides join both pores; throats in the side walls conduct by their
    share inside.
    """
    run = request.getfixturevalue("run" if kind == "fixed" else kind)
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import spsolve

    from fdnet.report.tables import openpnm_arrays

    network = run.network()
    arrays = openpnm_arrays(network, run.conductance(), viscosity=2.0)
    pair, g = arrays["throat.conns"], arrays["throat.hydraulic_conductance"]
    count = len(arrays["pore.coords"])
    assert np.all(pair[:, 0] < pair[:, 1])
    assert arrays["throat.periodic"].any() == (kind == "fixed")
    assert np.any(network.throat_share < 1) == (kind == "mobile")
    face = arrays["pore.inlet"] | arrays["pore.outlet"]
    x = arrays["pore.coords"][:, 0]
    assert x[arrays["pore.inlet"]] == pytest.approx(0.0, abs=1e-12)
    assert x[arrays["pore.outlet"]] == pytest.approx(run.case.size_m[0], rel=1e-9, abs=0)
    rows = np.concatenate([pair[:, 0], pair[:, 1]])
    columns = np.concatenate([pair[:, 1], pair[:, 0]])
    near = coo_matrix((np.tile(g, 2), (rows, columns)), shape=(count, count)).tocsr()
    balance = -near.tolil()
    balance.setdiag(np.asarray(near.sum(axis=1)).ravel())
    balance = balance.tocsr()
    pressure = arrays["pore.inlet"].astype(float)
    inner = np.flatnonzero(~face)
    pressure[inner] = spsolve(balance[inner][:, inner].tocsc(), -(balance[inner] @ pressure))
    inflow = float((balance @ pressure)[arrays["pore.inlet"]].sum())
    expected = fdnet.solve_flow(network, run.conductance()).inflow / 2.0
    assert inflow == pytest.approx(expected, rel=1e-9, abs=0)


def test_it_prints_in_the_units_of_the_field(run):
    text = str(run)
    summary = run.summary
    assert f"fdnet run tiny in {run.path}" in text
    assert f"{summary['k_initial_m2']:.3g} -> {summary['k_damaged_m2']:.3g} m2" in text
    assert f"{100 * summary['k_reduction']:.1f} % lost" in text
    line = re.search(r"\npermeability +([\d,]+) ->", text)
    assert line
    millidarcy = float(line[1].replace(",", ""))
    assert text.splitlines()[1].startswith("95 % of the fines that entered lie within")
    assert millidarcy == pytest.approx(summary["k_initial_m2"] / 9.869233e-16, rel=1e-3, abs=0)
    assert max(len(line) for line in text.split("warning", maxsplit=1)[0].splitlines()) <= 120
    assert repr(run) == f"FinishedRun('tiny', {str(run.path)!r})"
    assert run._repr_html_().count("<tr>") == len(list(facts(summary))) + 1 + 3


def test_a_run_without_fines_has_no_history(tmp_path):
    from fdnet.case.file import case_from
    from tests.builders import TINY

    case = case_from({key: value for key, value in TINY.items() if key != "fines"})
    intact = fdnet.run_case(case, tmp_path / "run", stages=("pack", "analyse"))
    assert len(intact.history) == 0
    assert "time_s" in intact.history
    assert "none supplied" in str(intact)
    assert len(intact.spheres()) == len(intact.spheres("initial"))


def test_a_finished_run_is_opened_and_not_repeated(run):
    before = (run.path / "manifest.json").stat().st_mtime_ns
    again = fdnet.run_case(run.case, run.path)
    assert (run.path / "manifest.json").stat().st_mtime_ns == before
    assert again.summary == run.summary


def test_the_answer_is_printed_before_the_figures_whose_failure_is_said(
    copied, monkeypatch, capsys
):
    from fdnet.cli import main
    from fdnet.run import pipeline

    printed = []

    def fail(results):
        printed.append(capsys.readouterr().out)
        raise OSError(errno.ENOSPC, "No space left on device", "depth.png")

    monkeypatch.setattr(pipeline, "draw_figures", fail)
    again = ["--stages", "analyse,report", "--force", "--quiet"]
    assert main(["run", str(copied / "case.toml"), "--out", str(copied), *again]) == 2
    assert printed[0].startswith("95 % of the fines that entered lie within")
    assert "permeability" in printed[0]
    assert "depth.png: No space left on device" in capsys.readouterr().err
    assert (copied / "summary.json").exists()
    assert not (copied / "manifest.json").exists()


def test_what_is_no_finished_run_is_refused(copied, tmp_path):
    (tmp_path / "a file").write_text("")
    (tmp_path / "empty").mkdir()
    for name, message in (
        ("none", "does not exist"),
        ("a file", "is a file"),
        ("empty", "holds no fdnet run"),
    ):
        with pytest.raises(CaseError, match=message):
            fdnet.open_run(tmp_path / name)
    (copied / "manifest.json").unlink()
    with pytest.raises(CaseError, match=r"unfinished run; continue it with .* --resume"):
        fdnet.open_run(copied)


@pytest.mark.parametrize(
    ("name", "spoil", "message"),
    [
        ("manifest.json", lambda text: text[:50], "cannot be read"),
        ("case.toml", lambda text: text + "\nnonsense", "case.toml"),
    ],
)
def test_damaged_records_are_refused(copied, name, spoil, message):
    path = copied / name
    path.write_text(spoil(path.read_text()))
    with pytest.raises(CaseError, match=message):
        fdnet.open_run(copied)


def test_a_missing_table_is_refused(copied):
    (copied / "pores.csv").unlink()
    with pytest.raises(CaseError, match=r"pores.csv is missing"):
        fdnet.open_run(copied)


@pytest.mark.parametrize("name", ["layers", "history"])
def test_a_table_that_only_some_runs_have_is_missed_where_the_run_wrote_it(copied, name):
    (copied / f"{name}.csv").unlink()
    with pytest.raises(CaseError, match=rf"{name}\.csv"):
        getattr(fdnet.open_run(copied), name)


def test_a_case_that_was_changed_is_refused(copied):
    path = copied / "case.toml"
    path.write_text(path.read_text().replace("seed = 1", "seed = 2", 1))
    with pytest.raises(CaseError, match=r"case\.toml: is not the case that the run"):
        fdnet.open_run(copied)


TABLES = {
    "cut": (
        "throats",
        lambda text: text[: len(text) // 2],
        r"rows, expected|cannot be read|number",
    ),
    "empty": ("sections", lambda text: "", "cannot be read as a table"),
    "text": ("pores", lambda text: text.replace("0.", "zero", 1), "no number"),
    "column": ("profile", lambda text: text.replace("x_lo_m", "x_lo"), "no column x_lo_m"),
    "rows": ("sections", lambda text: text + text.splitlines()[-1] + "\n", "4 rows, expected 3"),
}


@pytest.mark.parametrize("name", TABLES)
def test_a_spoilt_table_is_refused(copied, name):
    table, spoil, message = TABLES[name]
    path = copied / f"{table}.csv"
    path.write_text(spoil(path.read_text()))
    opened = fdnet.open_run(copied)
    with pytest.raises(CaseError, match=message) as caught:
        getattr(opened, table)
    assert str(path) in str(caught.value)
    assert "--stages analyse,report --force" in str(caught.value)


def test_a_spoilt_summary_is_refused(copied):
    (copied / "summary.json").write_text("[1, 2]")
    with pytest.raises(CaseError, match="is no summary"):
        _ = fdnet.open_run(copied).summary
    (copied / "summary.json").write_text("{")
    with pytest.raises(CaseError, match="cannot be read as JSON"):
        _ = fdnet.open_run(copied).summary


def test_a_changed_mesh_is_refused_and_a_missing_one_is_not_needed(run, copied):
    """A mesh that ParaView reads and saves again is another one."""
    meshes = {
        "network.vtp": FinishedRun.network_mesh,
        "spheres_initial.vtp": lambda opened: opened.sphere_mesh("initial"),
        "spheres_damaged.vtp": FinishedRun.sphere_mesh,
    }
    for name, read in meshes.items():
        path = copied / name
        path.write_bytes(path.read_bytes() + b"\n")
        opened = fdnet.open_run(copied)
        with pytest.raises(CaseError, match=rf"{name}: is not the file that the run wrote"):
            read(opened)
        with pytest.raises(CaseError, match=rf"{name}: is not the file that the run wrote"):
            fdnet.run_case(run.case, copied)
        path.unlink()
    assert fdnet.run_case(run.case, copied).summary == run.summary


def test_meshes_that_were_not_written_are_named(mobile, copied):
    with pytest.raises(CaseError, match=r"network.vtp: is missing; .*--stages report"):
        mobile.network_mesh()
    (copied / "network.vtp").write_text("<VTKFile")
    with pytest.raises(CaseError, match=r"network.vtp: "):
        fdnet.open_run(copied).network_mesh()


@pytest.mark.parametrize("stages", [("pack",), ("analyse", "rest"), "analyse", ()])
def test_stages_that_end_without_a_result_are_refused(tmp_path, stages):
    with pytest.raises(CaseError, match="with analyse or report among them"):
        fdnet.run_case(tiny(), tmp_path / "run", stages=stages)
    assert not (tmp_path / "run").exists()


def test_an_unknown_state_is_refused(run):
    with pytest.raises(CaseError, match="expected 'initial'"):
        run.spheres("final")


def test_a_finished_run_is_read_and_one_of_another_case_refused(finished):
    again = partial(
        fdnet.run_case, stages=("pack", "invade", "analyse"), resume=True, progress=False
    )
    before = sorted(path.stat().st_mtime_ns for path in finished.path.rglob("*"))
    assert again(finished.case, finished.path).summary == finished.summary
    data = finished.case.data()
    data["seed"] += 1
    with pytest.raises(CaseError, match="holds a run of another case"):
        again(case_from(data), finished.path)
    assert sorted(path.stat().st_mtime_ns for path in finished.path.rglob("*")) == before
