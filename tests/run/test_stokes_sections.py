"""Sections of a run by resolved Stokes flow: what is kept, refused, and shown in the report."""

import json
import shutil
from pathlib import Path

import pytest
from builders import naming, tiny

import fdnet
from fdnet.cli import main
from fdnet.errors import CaseError
from fdnet.network.stokes import StokesFlow, estimate
from fdnet.report.html import stokes_html as section_html
from fdnet.run import stokes_sections as stokes_grids
from fdnet.run.folder import locked
from fdnet.run.stokes_sections import read_sections, report_section, stokes_sections, with_network

ROUGH, ROUGH_GRAIN = 1.0, 7.0
"""Cells across the radius of a fine and of a grain that keep the tests short."""

NAMES = list(stokes_grids.StokesSection.model_fields)
HEAD = ",".join(NAMES).encode() + b"\n1,1\n"
"""A table whose row has too few numbers."""
NOT_FINITE = HEAD.replace(b"\n1,1", b"\n" + b",".join([b"nan"] * len(NAMES)))


def test_the_error_covers_the_orders_of_deposits():
    same = {"iterations": 1, "residual": 0.0, "seconds": 0.0, "unknowns": 1}
    for order in (1.5, 1.75, 2.0):
        ratio = {cells: 1.0 + 90.0 * cells**-order for cells in (40, 60)}
        flows = [StokesFlow(k=1e-12 * one, cells=cells, **same) for cells, one in ratio.items()]
        end = estimate(*flows, with_fines=True)
        assert abs(end.k / 1e-12 - 1.0) <= end.error < ratio[60] - 1.0, order


@pytest.fixture(scope="module", autouse=True)
def rough():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stokes_grids, "ACROSS_A_GRAIN", ROUGH_GRAIN)
        yield


@pytest.fixture(scope="module")
def resolved(finished, tmp_path_factory) -> Path:
    """A copy of the tiny run whose first section is resolved."""
    folder = tmp_path_factory.mktemp("stokes") / "run"
    shutil.copytree(finished.path, folder)
    stokes_sections(folder, (1,), across=ROUGH)
    return folder


@pytest.mark.liggghts
def test_the_network_agrees_with_the_flow_between_the_spheres(resolved):
    solved = read_sections(resolved / "stokes" / "sections.csv")
    (row,) = with_network(solved, fdnet.open_run(resolved).summary)
    assert row["section"] == 1
    for key in ("k_initial", "k_damaged"):
        off = row[f"network_{key}_m2"] / row[f"{key}_m2"] - 1.0
        assert abs(off) < 0.1 + row[f"{key}_error"]
    assert row["k_damaged_m2"] < 0.9 * row["k_initial_m2"]
    assert row["k_reduction"] == pytest.approx(1.0 - row["k_damaged_m2"] / row["k_initial_m2"])


@pytest.mark.liggghts
def test_no_slip_walls_are_those_of_resolved_flow_with_and_without_fines(tmp_path):
    """A real pack in a box; with walls that slip the same section conducts far more."""
    case = tiny("run.cap_ms=0.35", "box.sides=walls", "analysis.walls=no-slip")
    run = fdnet.run_case(case, tmp_path / "run", stages=("pack", "invade", "analyse"))
    stokes_sections(run.path, (1,), across=ROUGH)
    (row,) = with_network(read_sections(run.path / "stokes" / "sections.csv"), run.summary)
    slips = case.analysis.model_copy(update={"walls": "slip"})
    spheres = run.spheres("initial"), run.spheres()
    slipping = fdnet.analyse(*spheres, periodic=case.periodic, options=slips).sections[0]
    for key in ("k_initial", "k_damaged"):
        held, flow = row[f"network_{key}_m2"], row[f"{key}_m2"]
        assert abs(held / flow - 1.0) < 0.12 + row[f"{key}_error"], key
        assert getattr(slipping, key) > 1.15 * held, key
    assert row["k_damaged_m2"] < 0.9 * row["k_initial_m2"]


@pytest.mark.liggghts
def test_a_section_is_solved_once(resolved, monkeypatch):
    table, solved = resolved / "stokes" / "sections.csv", []
    before, solve = read_sections(table), stokes_grids.solve_slab
    count = lambda *given, **more: solved.append(1) or solve(*given, **more)  # noqa: E731
    monkeypatch.setattr(stokes_grids, "solve_slab", count)
    (row,) = stokes_sections(resolved, (1,), across=ROUGH)
    assert (len(solved), read_sections(table)) == (0, before)
    assert row["k_damaged_m2"] == before[0].k_damaged_m2
    monkeypatch.setattr(stokes_grids, "ACROSS_A_GRAIN", 1.2 * ROUGH_GRAIN)
    stokes_sections(resolved, (1,), across=ROUGH)
    assert (len(solved), len(read_sections(table))) == (4, 1)
    monkeypatch.setattr(stokes_grids, "ACROSS_A_GRAIN", ROUGH_GRAIN)
    stokes_sections(resolved, (1,), across=ROUGH)
    assert read_sections(table) == before


@pytest.mark.liggghts
def test_the_command_prints_both_and_the_report_shows_them(resolved, capsys):
    assert main(["stokes", str(resolved), "--across", f"{ROUGH}", "--quiet"]) == 0
    shown = capsys.readouterr().out
    assert "resolved flow" in shown
    assert "network over flow" in shown
    assert main(["stokes", str(resolved), "--across", f"{ROUGH}", "--json", "--quiet"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    page = (resolved / "report.html").read_text()
    assert section_html([row]) in page
    assert page.count("Sections by resolved Stokes flow") == 1
    case, summary = tiny("box.sides=walls"), fdnet.open_run(resolved).summary
    assert report_section(resolved, case, summary) == section_html([row])
    assert report_section(resolved / "elsewhere", case, summary) == ""
    slipping = tiny("box.sides=walls", "analysis.walls=slip")
    assert report_section(resolved, slipping, summary) == ""


@pytest.mark.liggghts
def test_what_cannot_be_solved_is_refused_at_once(finished, capsys):
    for arguments, words in (
        (["--section", "9"], "--section: 9, expected 1 to 3"),
        (["--across", "0.5"], "--across: 0.5, expected 1 to 20"),
        (["--across", "20"], "million cells, expected at most"),
    ):
        assert main(["stokes", str(finished.path), *arguments]) == 2
        assert words in capsys.readouterr().err
        assert not (finished.path / "stokes").exists()


@pytest.mark.liggghts
def test_nothing_else_writes_meanwhile(resolved):
    with locked(resolved), pytest.raises(CaseError, match="fdnet stokes, is writing here"):
        stokes_sections(resolved, (1,), across=ROUGH)
    stokes_sections(resolved, (1,), across=ROUGH)


def test_a_table_that_cannot_be_read_is_named_and_stops_no_report(tmp_path):
    table = tmp_path / "stokes" / "sections.csv"
    table.parent.mkdir()
    for text in (b"", b"a,b\n1,2\n", b"\xff", HEAD, NOT_FINITE):
        table.write_bytes(text)
        said = r"sections\.csv: .*call fdnet stokes again"
        with naming(text), pytest.raises(CaseError, match=said):
            read_sections(table)
        assert "call fdnet stokes again" in report_section(tmp_path, tiny(), {}), text
