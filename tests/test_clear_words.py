"""Damaged inputs, strange surroundings and impossible values end with one clear line."""

import json
import math
import os
import resource
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from builders import answer, tiny

from fdnet.dem.deck import snapshot_of
from fdnet.dem.liggghts import find_binary
from fdnet.errors import CaseError, DumpError, LiggghtsError, NetworkError
from fdnet.network.permeability import analyse
from fdnet.network.specimen import doubts, empty_duct_permeability
from fdnet.spheres.dump import COLUMNS, Frame
from fdnet.spheres.snapshot import Kind, Snapshot
from tests.network.packs import snapshot

BOX = ("--box", "0,3,0,3,0,3")
CUBE = np.indices((3, 3, 3)).reshape(3, -1).T + 0.5
"""Centres of touching grains of radius 0.5 that fill the box."""
BOUNDS = np.array([[0.0, 3.0]] * 3)


def refusal(capsys, *arguments: object, code: int = 2) -> str:
    """The one line with which a command that must end with this code ends."""
    ended, out, err = answer(capsys, *arguments)
    assert (ended, out) == (code, ""), err
    assert len(err.strip().splitlines()) == 1, err
    return err


def write_table(path: Path, **swap: str) -> Path:
    """The cube as a table; `swap` replaces cells of the third sphere."""
    columns = ["x_m", "y_m", "z_m", "radius_m"]
    rows = [dict(zip(columns, map(str, [*place, 0.5]), strict=True)) for place in CUBE]
    rows[2] |= swap
    columns = list(rows[2])
    lines = [",".join(row.get(name, "1") for name in columns) for row in rows]
    path.write_text("\n".join([",".join(columns), *lines]) + "\n")
    return path


def frame(step: str, row: str) -> str:
    """A dump of one sphere."""
    head = f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n1\nITEM: BOX BOUNDS ff ff ff\n"
    return head + "0 1\n" * 3 + f"ITEM: ATOMS id type x y z radius\n{row}\n"


def test_the_depth_and_length_of_a_case_have_bounds(tmp_path, case_file, capsys):
    deep = tmp_path / "deep.toml"
    deep.write_text("seed = " + "[" * 20000 + "]" * 20000 + "\n")
    long, longest = "9" * 400, "9" * 5000
    out = ("--out", tmp_path / "decks")
    assert "nested too deeply" in refusal(capsys, "render", deep, *out)
    assert "a dotted key" in refusal(
        capsys, "render", case_file, *out, "--set", "a." * 5000 + "a=1"
    )
    for number in (long, longest):
        for key in ("seed", "grains.count", "fines.radius_mm", "box.size_mm"):
            refusal(capsys, "render", case_file, *out, "--set", f"{key}={number}")
        deep.write_text(f"seed = {number}\n")
        refusal(capsys, "render", deep, *out)
        refusal(capsys, "render", case_file, *out, "--np", number)
        refusal(capsys, "render", case_file, *out, "--seed", number)
    assert not (tmp_path / "decks").exists()


def test_a_second_line_of_an_assignment_is_not_dropped(tmp_path, case_file, capsys):
    for text in ("seed=1\ngrains.count=50", "name=a\nb", "seed=1\n[fines]\ncount=1"):
        err = refusal(capsys, "render", case_file, "--out", tmp_path / "decks", "--set", text)
        assert "is not one value" in err


def test_long_numbers_in_files_of_spheres_are_refused(tmp_path, capsys):
    number, dump = "9" * 5000, tmp_path / "s.dump"
    table = write_table(tmp_path / "s.csv", id=number)
    assert "id is" in refusal(capsys, "permeability", table)
    write_table(table)
    refusal(capsys, "permeability", table, "--sections", number)
    refusal(capsys, "permeability", table, "--types", f"{number}=grain")
    for step, kind, words in ((number, "1", "step is"), ("0", "1e300", "too large")):
        dump.write_text(frame(step, f"1 {kind} 0 0 0 1"))
        assert words in refusal(capsys, "permeability", dump)


def test_radii_beyond_reason_are_refused(tmp_path, capsys):
    """Their cubes are no doubles: overflow where it was not refused."""
    for radius in ("1e308", "1e-200", "1e100"):
        table = write_table(tmp_path / "s.csv", radius_m=radius)
        assert "check the units" in refusal(capsys, "permeability", table, *BOX, code=4)


def test_a_stray_sphere_is_left_out_unless_a_period_would_have_to_bring_it_back(tmp_path, capsys):
    """1e25 periods away no digit of its place is left; next to a wall it is counted as outside."""
    for place, periodic, code in (("1e308", "", 4), ("1e25", "x", 4), ("1e25", "", 0)):
        words = ["permeability", write_table(tmp_path / "s.csv", x_m=place), *BOX, "--json"]
        ended, out, err = answer(capsys, *words, "--periodic", periodic)
        assert ended == code, err
        assert code or "1 grains lie outside the box" in " ".join(json.loads(out)["warnings"])


def test_a_pack_whose_paths_are_all_closed_is_an_answer_at_the_command_line(tmp_path, capsys):
    """A radius of 0.72 spacings closes every triangle of a cubic lattice (0.707): k = 0."""
    table = write_table(tmp_path / "s.csv")
    table.write_text(table.read_text().replace(",0.5\n", ",0.72\n"))
    words = ["permeability", table, *BOX, "--periodic", "xyz", "--json"]
    code, out, _ = answer(capsys, *words)
    result = json.loads(out)
    assert (code, result["k_initial_m2"], result["k_damaged_m2"]) == (0, 0, 0)
    assert result["k_reduction"] is None
    assert any("k_initial = 0: no open path" in one for one in result["warnings"])


def test_a_snapshot_holds_no_number_that_is_none():
    for name in ("position", "radius", "box"):
        for value in (math.nan, math.inf, -math.inf):
            fields = {"position": CUBE.copy(), "radius": np.full(27, 0.5), "box": BOUNDS.copy()}
            fields[name].flat[1] = value
            with pytest.raises(CaseError, match=f"{name} holds values that are not finite"):
                snapshot(**fields)


def test_a_dump_of_a_run_with_a_sphere_of_no_kind_or_size_is_named():
    columns = tuple(COLUMNS.split())
    for column, value in (("type", 3.0), ("radius", 0.0)):
        rows = np.array([[7, 1, 1e-4, 1e-4, 1e-4, 0, 0, 0, 2e-4]])
        rows[0, columns.index(column)] = value
        frame = Frame(step=5, box=np.array([[0, 1.0]] * 3), columns=columns, rows=rows)
        with pytest.raises(DumpError, match=f"id 7 has {column} {value:g}"):
            snapshot_of(frame, tiny(), time_s=0.0)


def test_limits_of_time_ranks_and_grains_are_refused_before_anything_runs(
    tmp_path, case_file, capsys
):
    run = ["run", case_file, "--out", tmp_path / "run", "--set", "fluid.velocity_m_s=0.1"]
    for option, word in (
        *((f"--timeout={value}", "timeout") for value in ("nan", "inf", "0", "-1")),
        *((f"--set=grains.count={count}", "expected at least 4") for count in (1, 2, 3)),
        ("--np=1000000", "ranks: 1000000"),
    ):
        assert word in refusal(capsys, *run, option)
    assert not (tmp_path / "run").exists()


def test_surroundings_are_named_and_not_blamed_on_liggghts(tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path / "none"))
    with pytest.raises(LiggghtsError, match=r"TMPDIR: .*none is no folder"):
        find_binary()
    monkeypatch.delenv("TMPDIR")
    monkeypatch.setattr(resource, "getrlimit", lambda _: (32, 4096))
    with pytest.raises(LiggghtsError, match=r"ulimit -n: only 32 files"):
        find_binary()


def in_ascii(*arguments: object) -> subprocess.CompletedProcess[bytes]:
    words = [sys.executable, "-m", "fdnet.cli", *map(os.fsencode, map(str, arguments))]
    knows = {"LC_ALL": "C", "PYTHONIOENCODING": "ascii", "PYTHONCOERCECLOCALE": "0"}
    return subprocess.run(words, capture_output=True, check=False, env=os.environ | knows)


def test_a_terminal_that_knows_ascii_alone_and_names_that_are_no_utf_8(tmp_path, case_file):
    strange = tmp_path / os.fsdecode(b"gr\xe4in")
    for out in (tmp_path / "körner", strange):
        refused = in_ascii("run", case_file, "--out", out, "--set", "nöpe=1")
        assert refused.returncode == 2
        assert refused.stderr.count(b"\n") == 1
    refused = in_ascii("run", case_file, "--out", strange)
    assert refused.returncode == 2
    assert b"is not UTF-8" in refused.stderr
    assert not strange.exists()
    done = in_ascii("render", case_file, "--out", tmp_path / "körner")
    assert done.returncode == 0, done.stderr
    assert b"k\\xf6rner/pack/in.pack" in done.stdout


def pack(*fine: float, radius: float = 0.1) -> Snapshot:
    """The cube of grains and one fine."""
    grains = snapshot(CUBE, 0.5, BOUNDS)
    return grains.joined(snapshot([fine], radius, BOUNDS, Kind.FINE))


def test_a_fine_larger_than_any_grain_or_wider_than_the_box_is_refused():
    for radius, limit in (
        (60.0, "more than half the shortest side of the box"),
        (0.6, "the smallest grain one of 0.5 m"),
    ):
        with pytest.raises(NetworkError, match=rf"id 1 has a radius of {radius:g} m, {limit}"):
            analyse(pack(1.0, 1.0, 1.0, radius=radius))


def test_fines_beyond_the_side_walls_are_counted():
    outside = analyse(pack(1.0, 3.4, 1.0))
    assert any("1 fines are centred beyond the side walls" in text for text in outside.warnings)
    assert not any("side walls" in text for text in analyse(pack(1.0, 1.0, 1.0)).warnings)
    around = analyse(pack(1.0, 3.4, 1.0), periodic="yz")
    assert not any("side walls" in text for text in around.warnings)


def test_a_permeability_above_that_of_the_empty_duct_is_said_with_its_number():
    box = np.array([[0, 1.0], [0, 2.0], [0, 2.0]])
    square = empty_duct_permeability(box, (False, False, False))
    assert square == pytest.approx(0.035144 * 4, rel=1e-4)
    assert empty_duct_permeability(box, (False, True, False)) == pytest.approx(4 / 12)
    assert empty_duct_permeability(box, (False, True, True)) == np.inf
    duct = SimpleNamespace(box=box, periodic=(False,) * 3, walls="no-slip")
    said = list(doubts(0.4, 2 * square, duct))
    assert len(said) == 1
    assert f"{square:.3g} m2, which is impossible" in said[0]
    assert not list(doubts(0.4, 0.5 * square, duct))
    duct.walls = "slip"
    assert not list(doubts(0.4, 2 * square, duct))
