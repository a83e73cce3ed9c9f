"""Damaged inputs, strange surroundings and impossible values end with one clear line."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from builders import tiny

from fdnet.errors import CaseError, DumpError, LiggghtsError, NetworkError
from fdnet.network.permeability import analyse
from fdnet.spheres.snapshot import Snapshot
from tests.run.test_foreign_folders import CUBE, answer


@pytest.fixture
def case(tmp_path: Path) -> Path:
    """The file of the tiny case."""
    path = tmp_path / "case.toml"
    path.write_text(tiny("run.cap_ms=0.35").toml())
    return path


def refusal(capsys, *arguments: object) -> str:
    """The one line with which a command that must end with 2 ends."""
    code, err = answer(capsys, *arguments)
    assert code == 2, err
    assert len(err.strip().splitlines()) == 1, err
    return err


def test_the_depth_and_length_of_a_case_have_bounds(tmp_path, case, capsys):
    deep = tmp_path / "deep.toml"
    deep.write_text("seed = " + "[" * 20000 + "]" * 20000 + "\n")
    long, longest = "9" * 400, "9" * 5000
    out = ("--out", tmp_path / "decks")
    assert "nested too deeply" in refusal(capsys, "render", deep, *out)
    assert "parts" in refusal(capsys, "render", case, *out, "--set", "a." * 5000 + "a=1")
    for number in (long, longest):
        for key in ("seed", "grains.count", "fines.radius_mm", "box.size_mm"):
            refusal(capsys, "render", case, *out, "--set", f"{key}={number}")
        deep.write_text(f"seed = {number}\n")
        refusal(capsys, "render", deep, *out)
        refusal(capsys, "render", case, *out, "--np", number)
        refusal(capsys, "render", case, *out, "--seed", number)
    assert not (tmp_path / "decks").exists()


def test_a_second_line_of_an_assignment_is_not_dropped(tmp_path, case, capsys):
    for text in ("seed=1\ngrains.count=50", "name=a\nb", "seed=1\n[fines]\ncount=1"):
        err = refusal(capsys, "render", case, "--out", tmp_path / "decks", "--set", text)
        assert "is not one value" in err


@pytest.mark.parametrize("number", ["9" * 400, "9" * 5000])
def test_long_numbers_in_files_of_spheres_are_refused(tmp_path, capsys, number):
    table = tmp_path / "s.csv"
    table.write_text(
        CUBE.replace("radius_m\n", "radius_m,id\n").replace(",0.5\n", f",0.5,{number}\n")
    )
    assert "id is" in refusal(capsys, "permeability", table)
    table.write_text(CUBE)
    refusal(capsys, "permeability", table, "--sections", number)
    refusal(capsys, "permeability", table, "--types", f"{number}=grain")
    dump = tmp_path / "s.dump"
    head = (
        "ITEM: TIMESTEP\n{}\nITEM: NUMBER OF ATOMS\n1\nITEM: BOX BOUNDS ff ff ff\n" + "0 1\n" * 3
    )
    dump.write_text(head.format(number) + "ITEM: ATOMS id type x y z radius\n1 1 0 0 0 1\n")
    code, err = answer(capsys, "permeability", dump)
    assert code == 2
    assert "step is" in err
    dump.write_text(head.format(0) + "ITEM: ATOMS id type x y z radius\n1 1e300 0 0 0 1\n")
    assert "too large" in refusal(capsys, "permeability", dump)


@pytest.mark.parametrize(("column", "value"), [("type", 3.0), ("radius", 0.0)])
def test_a_dump_of_a_run_with_a_sphere_of_no_kind_or_size_is_named(column, value):
    from fdnet.dem.deck import snapshot_of
    from fdnet.spheres.dump import COLUMNS, Frame

    columns = tuple(COLUMNS.split())
    rows = np.array([[7, 1, 1e-4, 1e-4, 1e-4, 0, 0, 0, 2e-4]])
    rows[0, columns.index(column)] = value
    frame = Frame(step=5, box=np.array([[0, 1.0]] * 3), columns=columns, rows=rows)
    with pytest.raises(DumpError, match=f"id 7 has {column} {value:g}"):
        snapshot_of(frame, tiny(), time_s=0.0)


@pytest.mark.parametrize(
    ("stage", "key", "value"),
    [
        ("pack", "runs", []),
        ("pack", "runs", ["x"]),
        ("pack", "seconds", "long"),
        ("pack", "attempts", {}),
        ("invade", "warnings", [1]),
        ("invade", "digest", None),
        ("manifest", "stages", {"pack": 1}),
        ("manifest", "invade", [1]),
        ("manifest", "stages", None),
    ],
)
def test_records_of_another_shape_are_named(tmp_path, stage, key, value):
    from fdnet.run.folder import read_manifest, read_record

    row = {"version": "3.8.0", "seconds": 1.0, "liggghts_s": 1.0}
    files = {"files": {"x": "y"}, "ranks": 1}
    numbers = dict.fromkeys(
        ("seconds", "max_overlap", "steps", "dt_s", "supplied", "porosity", "porosity_assumed"), 1
    )
    texts = {"digest": "x", "stop_reason": "x", "left_out": [], "warnings": []}
    good = {"format": 1, "stages": [], "invade": None, "runs": [row], "attempts": [row], **files}
    path = tmp_path / ("manifest.json" if stage == "manifest" else f"{stage}/stage.json")
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps(good | numbers | texts))
    read = (
        (lambda: read_manifest(tmp_path))
        if stage == "manifest"
        else (lambda: read_record(tmp_path, stage))
    )
    assert read() is not None
    path.write_text(json.dumps(good | numbers | texts | {key: value}))
    with pytest.raises(CaseError, match=rf"{key}.*--force"):
        read()


def test_an_empty_summary_of_a_finished_run_is_named(tmp_path, monkeypatch):
    from fdnet.run import pipeline

    (tmp_path / "summary.json").write_text("")

    class Folder:
        path = tmp_path

    with pytest.raises(CaseError, match=r"summary.json: cannot be read as JSON"):
        pipeline._read_summary(Folder())


@pytest.mark.parametrize("value", ["nan", "inf", "0", "-1"])
def test_a_time_limit_is_a_number_of_seconds(tmp_path, case, capsys, value):
    err = refusal(capsys, "run", case, "--out", tmp_path / "run", f"--timeout={value}")
    assert "timeout" in err
    assert not (tmp_path / "run").exists()


def test_ranks_have_a_bound_that_fits_the_machine(tmp_path, case, capsys):
    err = refusal(capsys, "run", case, "--out", tmp_path / "run", "--np", "1000000")
    assert "ranks: 1000000" in err


def test_more_ranks_than_cores_are_warned_of_at_once(tmp_path, case, capsys, monkeypatch):
    from fdnet.run import pipeline
    from fdnet.run import records as session

    monkeypatch.setattr(pipeline, "run_stages", lambda *_: {})
    monkeypatch.setattr(session, "cores", lambda: 2)
    code, err = answer(capsys, "run", case, "--out", tmp_path / "run", "--np", "64")
    assert code == 0
    assert "--np 64: this machine has 2 cores" in err


@pytest.mark.parametrize("count", [1, 2, 3])
def test_too_few_grains_are_refused_before_anything_runs(tmp_path, case, capsys, count):
    command = ["run", case, "--out", tmp_path / "run", "--set", f"grains.count={count}"]
    assert "expected at least 4" in refusal(capsys, *command, "--set", "fluid.velocity_m_s=0.1")
    assert not (tmp_path / "run").exists()


def test_a_picture_that_could_not_be_drawn_is_said_on_standard_error(
    tmp_path, case, capsys, monkeypatch
):
    from fdnet.run import pipeline

    reason = "no 3-D picture: the drawing process ended with signal 9; no usable OpenGL?"
    monkeypatch.setattr(pipeline, "run_stages", lambda *_: {"warnings": [reason]})
    code, err = answer(capsys, "run", case, "--out", tmp_path / "run", "--json")
    assert code == 0
    assert err == f"fdnet: warning: {reason}\n"


def test_surroundings_are_named_and_not_blamed_on_liggghts(tmp_path, monkeypatch):
    import resource

    from fdnet.dem.liggghts import find_binary

    monkeypatch.setenv("TMPDIR", str(tmp_path / "none"))
    with pytest.raises(LiggghtsError, match=r"TMPDIR: .*none is no folder"):
        find_binary()
    monkeypatch.delenv("TMPDIR")
    monkeypatch.setattr(resource, "getrlimit", lambda _: (32, 4096))
    with pytest.raises(LiggghtsError, match=r"ulimit -n: only 32 files"):
        find_binary()


def test_a_program_without_its_helpers_is_named(tmp_path):
    from fdnet.dem.liggghts import find_binary

    fake = tmp_path / "liggghts"
    fake.write_text("#!/bin/sh\nno-such-helper-of-liggghts\n")
    fake.chmod(0o755)
    with pytest.raises(LiggghtsError, match="a program or library that it needs was not found"):
        find_binary(str(fake))


def test_a_disk_without_free_inodes_is_full(tmp_path, monkeypatch):
    from fdnet import files as atomic

    class NoInodes:
        f_files, f_favail = 100, 0

    monkeypatch.setattr(os, "statvfs", lambda _: NoInodes)
    assert atomic.disk_is_full(tmp_path)


def command(*arguments: object, **environment: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        [sys.executable, "-m", "fdnet.cli", *map(os.fsencode, map(str, arguments))],
        capture_output=True,
        check=False,
        env=os.environ | environment,
    )


def test_a_terminal_that_knows_ascii_alone_and_names_that_are_no_utf_8(tmp_path, case):
    surroundings = {"LC_ALL": "C", "PYTHONIOENCODING": "ascii", "PYTHONCOERCECLOCALE": "0"}
    strange = tmp_path / os.fsdecode(b"gr\xe4in")
    for out in (tmp_path / "körner", strange):
        refused = command("run", case, "--out", out, "--set", "nöpe=1", **surroundings)
        assert refused.returncode == 2
        assert refused.stderr.count(b"\n") == 1
    refused = command("run", case, "--out", strange, **surroundings)
    assert refused.returncode == 2
    assert b"is not UTF-8" in refused.stderr
    assert not strange.exists()
    done = command("render", case, "--out", tmp_path / "körner", **surroundings)
    assert done.returncode == 0, done.stderr
    assert b"k\\xf6rner/pack/in.pack" in done.stdout


def test_a_reader_that_has_gone_does_not_fail_the_command(tmp_path):
    (tmp_path / "s.csv").write_text(CUBE)
    line = f"'{sys.executable}' -m fdnet.cli permeability s.csv --compare-laws | true; "
    done = subprocess.run(
        ["bash", "-c", line + 'echo "${PIPESTATUS[0]}"'],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.strip() == "0"
    assert done.stderr == ""


def test_a_library_that_cannot_be_loaded_is_named(tmp_path, capsys, monkeypatch):
    """As under a limit of memory, where the linker cannot map a library."""
    table = tmp_path / "s.csv"
    table.write_text(CUBE)
    monkeypatch.setitem(sys.modules, "fdnet.spheres.readers", None)
    arguments = ("permeability", table, "--units", "mm", "--box", "0,1,0,1,0,1")
    assert "fdnet: a library cannot be loaded (" in refusal(capsys, *arguments)


def test_a_failure_of_python_itself_for_want_of_memory_is_named(capsys, monkeypatch, tmp_path):
    """Attack 939 of seed 1: an import under a limit of 300 MiB ended with a SystemError."""
    from fdnet.commands import permeability as permeability_command

    def importing(_):
        raise SystemError("_find_and_load returned NULL without setting an exception")

    monkeypatch.setattr(permeability_command, "run", importing)
    assert "give fdnet more memory" in refusal(capsys, "permeability", tmp_path / "s.csv")


def test_a_stop_that_a_library_turns_into_its_own_error_is_a_stop(capsys, monkeypatch, tmp_path):
    import signal

    from fdnet.commands import permeability as permeability_command

    def importing(_):
        try:
            signal.raise_signal(signal.SIGTERM)
        except KeyboardInterrupt as stop:
            raise ImportError("initialisation failed") from stop

    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr(permeability_command, "run", importing)
    code, err = answer(capsys, "permeability", tmp_path / "s.csv")
    signal.signal(signal.SIGTERM, before)
    assert code == 130
    assert "stopped" in err


def pack(fine: list[float] | None = None, radius: float = 0.1, *, side: float = 3.0) -> Snapshot:
    """The cubic lattice of 27 touching grains of radius 0.5 in a box, with one fine."""
    places = (np.indices((3, 3, 3)).reshape(3, -1).T + 0.5).tolist()
    radii, kinds = [0.5] * 27, ["grain"] * 27
    if fine is not None:
        places, radii, kinds = [*places, fine], [*radii, radius], [*kinds, "fine"]
    return Snapshot.from_arrays(places, radii, kind=kinds, box=[0, side] * 3)


@pytest.mark.parametrize(
    ("radius", "limit"),
    [
        (60.0, "more than half the shortest side of the box"),
        (0.6, "the smallest grain one of 0.5 m"),
    ],
)
def test_a_fine_larger_than_any_grain_or_wider_than_the_box_is_refused(radius, limit):
    with pytest.raises(NetworkError, match=rf"id 28 has a radius of {radius:g} m, {limit}"):
        analyse(pack([1.0, 1.0, 1.0], radius))


def test_fines_beyond_the_side_walls_are_counted():
    outside = analyse(pack([1.0, 3.4, 1.0]))
    assert any("1 fines are centred beyond the side walls" in text for text in outside.warnings)
    assert not any("side walls" in text for text in analyse(pack([1.0, 1.0, 1.0])).warnings)
    around = analyse(pack([1.0, 3.4, 1.0]), periodic="yz")
    assert not any("side walls" in text for text in around.warnings)


def test_porosities_that_were_not_validated_are_warned_of():
    loose = analyse(pack(side=4.0))
    assert any("outside 0.25 to 0.50" in text for text in loose.warnings)
    assert not any("outside 0.25" in text for text in analyse(pack()).warnings)


def test_a_permeability_above_that_of_the_empty_duct_is_said_with_its_number():
    from fdnet.network.specimen import doubts, empty_duct_permeability

    box = np.array([[0, 1.0], [0, 2.0], [0, 2.0]])
    square = empty_duct_permeability(box, (False, False, False))
    assert square == pytest.approx(0.035144 * 4, rel=1e-4)
    assert empty_duct_permeability(box, (False, True, False)) == pytest.approx(4 / 12)
    assert empty_duct_permeability(box, (False, True, True)) == np.inf
    given = {"porosity": 0.4, "box": box, "periodic": (False,) * 3}
    said = list(doubts(permeability=2 * square, walls="no-slip", **given))
    assert len(said) == 1
    assert f"{square:.3g} m2, which is impossible" in said[0]
    assert not list(doubts(permeability=0.5 * square, walls="no-slip", **given))
    assert not list(doubts(permeability=2 * square, walls="slip", **given))
