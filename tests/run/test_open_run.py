"""A finished run: its tables as objects, and files that were changed are refused by name."""

import copy
import json
import pickle
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from builders import TINY, naming, tiny
from matplotlib.figure import Figure
from scipy.sparse import coo_matrix, diags
from scipy.sparse.linalg import spsolve

import fdnet
from fdnet.case.file import case_from
from fdnet.errors import CaseError, FdnetError
from fdnet.report.figures import fill_depth
from fdnet.report.tables import openpnm_arrays
from fdnet.run.finished import FinishedRun
from fdnet.run.folder import TABLES
from fdnet.run.pipeline import run_stages
from fdnet.run.records import RunOptions

pytestmark = pytest.mark.liggghts
STAGES = ("pack", "invade", "analyse")
CONDUCTANCE = lambda run: run.throats["conductance_damaged_m3"].to_numpy()  # noqa: E731
ANEW = "is not the file that the run wrote"


@pytest.fixture(scope="module")
def run(finished) -> FinishedRun:
    """Fixed grains, periodic sides."""
    return finished


@pytest.fixture(scope="module")
def mobile(tmp_path_factory) -> FinishedRun:
    """Mobile grains between walls, analysed and not reported."""
    case = tiny("run.cap_ms=0.2", "grains.motion=mobile")
    return fdnet.run_case(case, tmp_path_factory.mktemp("mobile") / "run", stages=STAGES)


@pytest.fixture(scope="module", params=["fixed", "mobile"])
def either(request) -> FinishedRun:
    """Either of the two."""
    return request.getfixturevalue("run" if request.param == "fixed" else "mobile")


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
    assert run.profile["x_hi_m"].iloc[-1] == run.case.size_m[0]
    last = run.history.iloc[-1]
    assert last["invaded"] == summary["invaded_count"]
    assert last["time_s"] == pytest.approx(last["step"] * summary["dem_dt_s"], rel=1e-8, abs=0)
    assert run.history["time_s"].is_monotonic_increasing
    assert list(run.history["physical_time_s"]) == list(run.history["time_s"])
    assert last["physical_time_s"] == pytest.approx(summary["physical_time_s"], rel=1e-8)
    for name in ("invaded", "passed", "upstream", "supplied"):
        assert last[f"{name}_count"] == summary[f"{name}_count"], name


def test_what_a_user_types_first_is_there(run):
    summary = run.summary
    assert run.k_damaged_m2 == summary["k_damaged_m2"]
    assert run.k_damaged_mD == pytest.approx(summary["k_damaged_m2"] / 9.869233e-16, rel=1e-12)
    assert (run.lost, run.k_reduction) == (summary["k_reduction"],) * 2
    for name in ("stop_reason", "porosity_initial"):
        assert getattr(run, name) == summary[name]
    assert {"k_initial_mD", "k_initial_m2", "warnings", "plot", "sections"} <= set(dir(run))
    assert len(run.sections) == 3  # the table, and not the list of the summary
    with pytest.raises(AttributeError, match="no 'k_damage_mD'; did you mean k_damaged_mD"):
        _ = run.k_damage_mD
    assert copy.copy(run).k_initial_m2 == run.k_initial_m2
    assert pickle.loads(pickle.dumps(run)).k_initial_m2 == run.k_initial_m2


def test_its_plot_is_that_of_its_analysis(run, analysed):
    """The same lines as the figure of the report, drawn from the tables (nine digits)."""
    figure = Figure()
    fill_depth(figure, analysis=analysed)
    own = run.plot()
    assert [one.get_ylabel() for one in own] == ["permeability in place (mD)", "porosity (–)"]
    assert own[1].get_xlabel() == "depth from the formation face (mm)"
    for drawn, expected in zip(own, figure.axes, strict=True):
        assert drawn.get_yscale() == expected.get_yscale()
        assert len(drawn.patches) == len(expected.patches) > 1
        for one, other in zip(drawn.patches, expected.patches, strict=True):
            assert one.get_label() == other.get_label()
            assert one.get_data().edges == pytest.approx(other.get_data().edges, rel=1e-8)
            assert one.get_data().values == pytest.approx(other.get_data().values, rel=1e-8)


def test_its_spheres_and_its_last_dump_give_its_permeability_again(either):
    """Every digit is stored; LIGGGHTS's own file of the last state is read as any dump."""
    one, box = either, [(0.0, side) for side in either.case.size_m]
    spheres, options = (one.spheres("initial"), one.spheres()), one.case.analysis
    again = fdnet.analyse(*spheres, periodic=one.case.periodic, options=options)
    assert again.k_initial == one.summary["k_initial_m2"]
    assert again.k_damaged == one.summary["k_damaged_m2"]
    step = int(one.history["step"].iloc[-1])
    dump = fdnet.read_spheres(one.path / "invade" / "post" / f"invade_{step}.dump", box=box)
    if one.case.grains.motion == "fixed":  # grains that cannot move are not dumped again
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
    flow = fdnet.solve_flow(network, CONDUCTANCE(run))
    k = flow.inflow * float(np.ptp(network.box[0])) / network.area
    assert run.summary["damage_law_used"] == "all-spheres"
    assert k == pytest.approx(run.summary["k_damaged_other_m2"], rel=1e-7, abs=0)


def test_the_arrays_for_openpnm_balance_without_it(either):
    """Solved with plain linear algebra, also across periodic sides and in the side walls."""
    run, fixed = either, either.case.grains.motion == "fixed"
    network = run.network()
    arrays = openpnm_arrays(network, CONDUCTANCE(run), viscosity=2.0)
    pair, g = arrays["throat.conns"], arrays["throat.hydraulic_conductance"]
    count = len(arrays["pore.coords"])
    assert np.all(pair[:, 0] < pair[:, 1])
    assert arrays["throat.periodic"].any() == fixed
    assert np.any(network.throat_share < 1) == (not fixed)
    face = arrays["pore.inlet"] | arrays["pore.outlet"]
    x = arrays["pore.coords"][:, 0]
    assert x[arrays["pore.inlet"]] == pytest.approx(0.0, abs=1e-12)
    assert x[arrays["pore.outlet"]] == pytest.approx(run.case.size_m[0], rel=1e-9, abs=0)
    one_way = coo_matrix((g, pair.T), shape=(count, count)).tocsr()
    near = one_way + one_way.T
    balance = (diags(np.asarray(near.sum(axis=1)).ravel()) - near).tocsr()
    pressure = arrays["pore.inlet"].astype(float)
    inner = np.flatnonzero(~face)
    pressure[inner] = spsolve(balance[inner][:, inner].tocsc(), -(balance[inner] @ pressure))
    inflow = float((balance @ pressure)[arrays["pore.inlet"]].sum())
    expected = fdnet.solve_flow(network, CONDUCTANCE(run)).inflow / 2.0
    assert inflow == pytest.approx(expected, rel=1e-9, abs=0)


def test_a_run_without_fines_has_no_history(tmp_path):
    case = case_from({key: value for key, value in TINY.items() if key != "fines"})
    intact = fdnet.run_case(case, tmp_path / "run", stages=("pack", "analyse"))
    assert len(intact.history) == 0
    assert "time_s" in intact.history
    assert "none supplied" in str(intact)
    assert len(intact.spheres()) == len(intact.spheres("initial"))


def test_a_finished_run_is_read_and_one_of_another_case_refused(run):
    before = sorted(path.stat().st_mtime_ns for path in run.path.rglob("*"))
    assert fdnet.run_case(run.case, run.path).summary == run.summary
    again = partial(fdnet.run_case, stages=STAGES, resume=True, progress=False)
    assert again(run.case, run.path).summary == run.summary
    with pytest.raises(CaseError, match="holds a run of another case"):
        again(case_from(run.case.data() | {"seed": 2}), run.path)
    with pytest.raises(CaseError, match="expected 'initial'"):
        run.spheres("final")
    assert sorted(path.stat().st_mtime_ns for path in run.path.rglob("*")) == before


# ---- What is no finished run, and files that are not as the run wrote them.
def test_what_is_no_finished_run_is_refused(copied, tmp_path):
    (tmp_path / "a file").write_text("")
    (tmp_path / "empty").mkdir()
    said = {"none": "does not exist", "a file": "is a file", "empty": "holds no fdnet run"}
    for name, message in said.items():
        with pytest.raises(CaseError, match=message):
            fdnet.open_run(tmp_path / name)
    (copied / "manifest.json").unlink()
    with pytest.raises(CaseError, match=r"unfinished run; continue it with .* --resume"):
        fdnet.open_run(copied)
    for stages in (("pack",), ("analyse", "rest"), "analyse", ()):
        with naming(stages), pytest.raises(CaseError, match="with analyse or report among them"):
            fdnet.run_case(tiny(), tmp_path / "new", stages=stages)
    assert not (tmp_path / "new").exists()


def test_damaged_records_and_tables_are_refused_with_what_to_do(run, tmp_path):
    """By name, when the run is opened or the table read."""
    again = "--stages analyse,report --force"
    opens, summary = fdnet.open_run, lambda folder: fdnet.open_run(folder).summary
    cases = [
        ("manifest.json", lambda text: text[:50], opens, "cannot be read"),
        ("manifest.json", without_files, opens, r"manifest\.json: .*files"),
        ("case.toml", lambda text: text + "\nnonsense", opens, "case.toml"),
        ("case.toml", lambda text: text.replace("seed = 1", "seed = 2"), opens, "is not the ca"),
        ("summary.json", lambda text: "[1, 2]", summary, "is no summary"),
        ("summary.json", lambda text: "{", summary, "cannot be read as JSON"),
    ]
    for table in ("profile", "sections", "pores", "throats"):
        read = partial(lambda folder, name: getattr(fdnet.open_run(folder), name), name=table)
        cases.append((f"{table}.csv", one_digit, read, f"{ANEW}.*{again}|{again}.*{ANEW}"))
    damaged = lambda folder: fdnet.open_run(folder).spheres()  # noqa: E731
    cases.append(("spheres_damaged.csv", one_digit, damaged, r"spheres_damaged\.csv"))
    folder = Path(shutil.copytree(run.path, tmp_path / "run"))
    for name, change, read, message in cases:
        path = folder / name
        whole = path.read_bytes()
        path.write_text(change(path.read_text()))
        with naming(name, message), pytest.raises(CaseError, match=message) as caught:
            read(folder)
        assert name in str(caught.value)
        path.write_bytes(whole)
    for name in ("pores", "layers", "history"):
        (folder / f"{name}.csv").rename(folder / "away")
        with naming(name), pytest.raises(CaseError, match=rf"{name}\.csv"):
            getattr(fdnet.open_run(folder), name)
        (folder / "away").rename(folder / f"{name}.csv")
    assert fdnet.open_run(folder).summary == run.summary


def without_files(text: str) -> str:
    return json.dumps({key: one for key, one in json.loads(text).items() if key != "files"})


def one_digit(text: str) -> str:
    """Another number in the first row."""
    title, _, rows = text.partition("\n")
    return title + "\n" + rows.replace("1", "2", 1)


def test_a_changed_mesh_is_refused_and_a_missing_one_is_not_needed(run, copied):
    """A mesh that ParaView reads and saves again is another one."""
    for name in ("network.vtp", "spheres_initial.vtp", "spheres_damaged.vtp"):
        path = copied / name
        path.write_bytes(path.read_bytes() + b"\n")
        with pytest.raises(CaseError, match=rf"{name}: is not the file that the run wrote"):
            fdnet.run_case(run.case, copied)
        path.unlink()
    assert fdnet.run_case(run.case, copied).summary == run.summary


def last_dump(folder: Path) -> Path:
    step = (folder / "invade" / "history.csv").read_text().splitlines()[-1].split(",")[1]
    return folder / "invade" / "post" / f"invade_{step}.dump"


def with_lines(path: Path, change) -> None:
    path.write_text("".join(change(path.read_text().splitlines(keepends=True))))


def with_last(path: Path, column: int, change) -> None:
    """Another number in the last row; LIGGGHTS ends each row with a space."""
    text = path.read_text().rstrip()
    words = text[text.rindex("\n") + 1 :].split()
    words[column] = repr(change(float(words[column])))
    path.write_text(text[: text.rindex("\n") + 1] + " ".join(words) + " \n")


SHORTER = partial(with_lines, change=lambda rows: [rows[0], *rows[2:]])
CHANGES = {
    "dropped": partial(
        with_lines, change=lambda rows: [*rows[:3], f"{int(rows[3]) - 1}\n", *rows[4:-1]]
    ),
    "of another radius": partial(with_last, column=-1, change=lambda radius: 1.01 * radius),
    "moved": partial(with_last, column=2, change=lambda x: x + 1e-6),
}
SPOILT = {
    **{f"a grain {what}": ("pack/post/pack.dump", change) for what, change in CHANGES.items()},
    **{f"a fine {what}": ("last", change) for what, change in CHANGES.items()},
    "the dump gone": ("last", Path.unlink),
    "a row of the history": ("invade/history.csv", SHORTER),
    "a row of the overlap": ("invade/overlap.csv", SHORTER),
    "the overlap gone": ("invade/overlap.csv", Path.unlink),
}


def options(folder: Path, **changes) -> RunOptions:
    return RunOptions(out=folder, show_progress=False, **({"stages": STAGES} | changes))


@pytest.mark.parametrize("how", ["finished", "again", "resumed"])
def test_a_changed_file_of_a_stage_is_refused(run, copied, how):
    if how == "resumed":
        (copied / "manifest.json").unlink()
    again = {"stages": ("analyse",), "force": True}
    changes = {"finished": {}, "again": again, "resumed": {"resume": True}}[how]
    for what, (name, spoil) in SPOILT.items():
        path = last_dump(copied) if name == "last" else copied / name
        whole = path.read_bytes()
        spoil(path)
        if what == "the dump gone" and how == "finished":
            assert run_stages(run.case, options(copied)), "dumps may be removed"
        else:
            with naming(what), pytest.raises(FdnetError, match=path.name):
                run_stages(run.case, options(copied, **changes))
        path.write_bytes(whole)


def test_a_changed_table_of_a_finished_run_is_refused(run, copied):
    for name in (*TABLES, "pack/stage.json", "invade/stage.json"):
        path = copied / name
        text = path.read_text()
        path.write_text(text.replace("1", "2", 1))
        with naming(name), pytest.raises(CaseError, match=rf"{path.name}: {ANEW}"):
            run_stages(run.case, options(copied))
        path.write_text(text)


def test_a_run_ends_well_though_the_reader_of_its_answer_has_gone(copied):
    """`fdnet run ... | less`, closed with q: its manifest is still written."""
    words = f"run {copied}/case.toml --out {copied} --stages analyse --force --quiet"
    line = f"'{sys.executable}' -m fdnet.cli {words} | true; "
    ended = ["bash", "-c", line + 'echo "${PIPESTATUS[0]}"']
    done = subprocess.run(ended, capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "0", done.stderr
    assert not (copied / ".unfinished").exists()
    assert (copied / "manifest.json").exists()
