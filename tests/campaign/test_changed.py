"""Runs and plans that were changed, cut or removed afterwards: named, and never counted."""

import json
import os
from pathlib import Path

import pytest
from builders import tiny
from campaign.samples import finished_run

from fdnet.campaign.plan.ensemble import ensemble_plan
from fdnet.campaign.plan.folder import campaign_folder
from fdnet.cli import main
from fdnet.run.folder import digests_of

BAD = "tiny-seed-2"


@pytest.fixture
def ensemble(tmp_path) -> Path:
    """The folder of an ensemble of three finished seeds, that lost 0.4, 0.5 and 0.6."""
    out = tmp_path / "out"
    (tmp_path / "tiny.toml").write_text(tiny().toml())
    with campaign_folder(out, ensemble_plan(tiny(), 3)) as plan:
        for job in plan.jobs:
            finished_run(out / "runs" / job.name, job.case, k_reduction=0.3 + 0.1 * job.seed)
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


@pytest.mark.parametrize("what", SPOILT)
def test_a_changed_run_is_named_and_not_counted(ensemble, tmp_path, capsys, what):
    name, spoil = SPOILT[what]
    spoil(ensemble / "runs" / BAD / name)
    case = str(tmp_path / "tiny.toml")
    gather = ["ensemble", case, "--seeds", "3", "--gather", "--json", "--out", str(ensemble)]
    assert main(gather) == 5
    printed = capsys.readouterr()
    summary = json.loads(printed.out)
    assert (summary["done"], summary["failed"]) == (2, 1)
    assert summary["failures"][0]["run"] == BAD
    assert Path(name).name in summary["failures"][0]["reason"]
    assert f"{BAD} failed: " in printed.err
    assert summary["k_reduction"]["mean"] == pytest.approx(0.5)
    assert summary["k_reduction"]["seeds"] == 2
    for runs in ([ensemble], sorted((ensemble / "runs").iterdir())):
        assert main(["compare", *map(str, runs), "--out", str(tmp_path / "c")]) == 2
        assert Path(name).name in capsys.readouterr().err
        assert not (tmp_path / "c").exists()


def test_a_run_without_a_result_is_left_out_with_a_word(ensemble, tmp_path, capsys):
    (ensemble / "runs" / BAD / "manifest.json").unlink()
    assert main(["compare", str(ensemble), "--json", "--out", str(tmp_path / "c")]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["left_out"] == [str(ensemble / "runs" / BAD)]
    assert f"{BAD}: has no result and is left out" in printed.err


@pytest.mark.parametrize(
    "spoil",
    [
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
    ],
)
def test_a_plan_of_another_shape_is_refused_in_one_line(ensemble, tmp_path, capsys, spoil):
    spoil(ensemble / "plan.json")
    case = str(tmp_path / "tiny.toml")
    for command in (
        ["ensemble", case, "--seeds", "3", "--gather", "--out", str(ensemble)],
        ["compare", str(ensemble), "--out", str(tmp_path / "c")],
    ):
        assert main(command) == 2
        error = capsys.readouterr().err
        assert error.startswith(f"fdnet: {ensemble / 'plan.json'}: ")
        assert len(error.splitlines()) == 1
