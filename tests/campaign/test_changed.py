"""Runs and plans that were changed, cut or removed afterwards: named, and never counted."""

import json
import os
import shutil
from pathlib import Path

import pytest
from builders import tiny
from campaign.samples import finished_run

from fdnet.cli import main
from fdnet.run.folder import digests_of

BAD = "tiny-seed-2"
VALUES = [0.30, 0.40, 0.50, 0.38, 0.42, 0.40, 0.41, 0.39, 0.40, 0.40]


def gather(folder: Path, *more: str) -> int:
    """`fdnet ensemble --gather` of three seeds."""
    folder.parent.mkdir(exist_ok=True)
    case = folder.parent / "tiny.toml"
    case.write_text(tiny().toml())
    return main(["ensemble", str(case), "--seeds", "3", "--gather", "--out", str(folder), *more])


@pytest.fixture(scope="module")
def ensemble(tmp_path_factory) -> Path:
    """The folder of an ensemble of three seeds, with the finished runs of ten."""
    out = tmp_path_factory.mktemp("ensemble") / "out"
    assert gather(out) == 5
    for seed, value in enumerate(VALUES, start=1):
        finished_run(out / f"runs/tiny-seed-{seed}", tiny(f"seed={seed}"), k_reduction=value)
    return out


def edited(**keys):
    """Puts keys into a JSON file; None takes one out."""

    def edit(path: Path) -> None:
        data = json.loads(path.read_text()) | keys
        path.write_text(json.dumps({k: v for k, v in data.items() if v is not None}))

    return edit


def signed(edit):
    """The same with the digest of the changed file in the manifest."""

    def edit_and_sign(path: Path) -> None:
        edit(path)
        manifest = json.loads((path.parent / "manifest.json").read_text())
        manifest["files"] |= digests_of(path.parent, [path.name])
        (path.parent / "manifest.json").write_text(json.dumps(manifest))

    return edit_and_sign


SPOILT = {
    "another loss": ("summary.json", edited(k_reduction=0.999)),
    "a loss that is no number": ("summary.json", signed(edited(k_reduction=float("nan")))),
    "a loss in words": ("summary.json", signed(edited(k_reduction="half"))),
    "a loss above all": ("summary.json", signed(edited(k_reduction=1.5))),
    "no loss": ("summary.json", signed(edited(k_reduction=None))),
    "a list": ("summary.json", signed(lambda path: path.write_text("[1]"))),
    "a summary of nothing": ("summary.json", lambda path: path.write_text("")),
    "a table cut": ("profile.csv", lambda path: path.write_text("x_m\n")),
    "a table gone": ("sections.csv", Path.unlink),
    "a pipe": ("pores.csv", lambda path: (path.unlink(), os.mkfifo(path))),
    "another seed": ("case.toml", lambda path: path.write_text(tiny("seed=7").toml())),
    "no digests": ("manifest.json", edited(files=None)),
    "a manifest of bytes": ("manifest.json", lambda path: path.write_bytes(b"\xff\xfe\x00")),
    "a manifest of another shape": ("manifest.json", edited(digests=["x"])),
    "a manifest without stages": ("manifest.json", edited(stages=None)),
    "a record of another shape": ("invade/stage.json", edited(steps="many")),
}


def test_a_changed_run_is_named_and_not_counted(ensemble, tmp_path, capsys):
    for number, (what, (name, spoil)) in enumerate(SPOILT.items()):
        out, compared = tmp_path / str(number) / "out", str(tmp_path / "c")
        shutil.copytree(ensemble, out)
        spoil(out / "runs" / BAD / name)
        capsys.readouterr()
        assert gather(out, "--json") == 5, what
        printed = capsys.readouterr()
        summary = json.loads(printed.out)
        assert (summary["done"], summary["failed"]) == (2, 1), what
        assert summary["failures"][0]["run"] == BAD
        assert Path(name).name in summary["failures"][0]["reason"], what
        assert f"{BAD} failed: " in printed.err
        assert summary["k_reduction"]["mean"] == pytest.approx(0.4)
        assert summary["k_reduction"]["seeds"] == 2
        for runs in ([out], sorted((out / "runs").iterdir())):
            assert main(["compare", *map(str, runs), "--out", compared]) == 2, what
            assert Path(name).name in capsys.readouterr().err
            assert not Path(compared).exists()


def test_a_changed_run_is_left_as_it_is_and_named(ensemble, tmp_path, capsys):
    """No engine starts a job for it: `fdnet run` would refuse it, and Snakemake sees its files."""
    out = shutil.copytree(ensemble, tmp_path / "out")
    summary = out / "runs" / BAD / "summary.json"
    edited(k_reduction=0.999)(summary)
    before = {path: path.stat().st_mtime_ns for path in out.glob("runs/*/*")}
    fake = tmp_path / "lmp"
    fake.write_text('#!/bin/bash\necho "LIGGGHTS (Version LIGGGHTS-PUBLIC 3.8.0)"\n')
    fake.chmod(0o755)
    (tmp_path / "tiny.toml").write_text(tiny().toml())
    more = ["--seeds", "3", "--liggghts", str(fake), "--out", str(out)]
    assert main(["ensemble", str(tmp_path / "tiny.toml"), *more]) == 5
    error = capsys.readouterr().err
    assert f"{BAD} is left as it is: " in error
    assert f"{BAD} failed: " in error
    assert "write it anew with --stages analyse" in error
    assert {path: path.stat().st_mtime_ns for path in out.glob("runs/*/*")} == before


def test_a_run_without_a_result_is_left_out_with_a_word(ensemble, tmp_path, capsys):
    out = shutil.copytree(ensemble, tmp_path / "out")
    (out / "runs" / BAD / "manifest.json").unlink()
    capsys.readouterr()
    assert main(["compare", str(out), "--json", "--out", str(tmp_path / "c")]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["left_out"] == [str(out / "runs" / BAD)]
    assert f"{BAD}: has no result and is left out" in printed.err


def test_a_plan_of_another_shape_is_refused_in_one_line(ensemble, tmp_path, capsys):
    good = (ensemble / "plan.json").read_text()
    out = shutil.copytree(ensemble, tmp_path / "out")
    for spoil in (
        lambda path: path.write_text(""),
        lambda path: path.write_text("[]"),
        lambda path: path.write_bytes(b'{"name": "\xff"}'),
        lambda path: path.write_text('{"fdnet_campaign": 1}'),
        lambda path: path.write_text("[" * 100_000),
        *(edited(**{key: None}) for key in ("name", "digest", "seeds", "variants", "runs")),
        edited(seeds=3),
        edited(seeds=[10**400]),
        edited(variants=[1]),
        edited(runs=[{"name": "../../elsewhere", "variant": "tiny", "seed": 1}]),
        edited(runs=[]),
        edited(digest=float("nan")),
    ):
        (out / "plan.json").write_text(good)
        spoil(out / "plan.json")
        capsys.readouterr()
        for code in (gather(out), main(["compare", str(out), "--out", str(tmp_path / "c")])):
            assert code == 2
        lines = capsys.readouterr().err.splitlines()
        assert len(lines) == 2
        assert all(line.startswith(f"fdnet: {out / 'plan.json'}: ") for line in lines)
