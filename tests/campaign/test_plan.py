"""Sweep files, their plans, the folder that keeps one plan, and targets of a design."""

import json
import re
from pathlib import Path

import pytest
import tomli_w
from builders import TINY, answer, naming, tiny
from campaign.samples import finished_run

import fdnet
from fdnet import CaseError, read_case
from fdnet.campaign import engine
from fdnet.campaign.plan import sweep_plan
from fdnet.cli import main
from fdnet.run.pipeline import refusals
from fdnet.scales.scales import scales_of

GRID = """
case = "tiny.toml"
seeds = [3, 5]
[set]
analysis.sections = 2
[grid]
fines.radius_mm = [0.04, 0.05]
fluid.viscosity = ["10 cP", "50 cP", "90 cP"]
"""


@pytest.fixture
def write(tmp_path):
    """Writes a sweep file with tiny.toml next to it; gives its path."""
    (tmp_path / "tiny.toml").write_text(tomli_w.dumps(TINY))

    def write(text: str) -> Path:
        (tmp_path / "sweep.toml").write_text(text)
        return tmp_path / "sweep.toml"

    return write


def planned(path: Path) -> tuple[dict, dict]:
    """plan.json of a sweep that is not run, and its cases by run."""
    out = path.parent / "out"
    assert main(["sweep", str(path), "--out", str(out), "--gather", "--quiet"]) == 5
    plan = json.loads((out / "plan.json").read_text())
    names = [row["name"] for row in plan["runs"]]
    return plan, {name: read_case(out / f"cases/{name}.toml") for name in names}


def test_a_dry_run_says_the_time_and_writes_nothing(write, tmp_path, capsys, monkeypatch):
    path = write(GRID)
    words = ["sweep", str(path), "--out", str(tmp_path / "out"), "--dry-run", "--jobs", "3"]
    for find, resource, code in ((str, "x", 2), ({}.get, "mem=1", 2), (str, "runtime=60", 0)):
        monkeypatch.setattr(engine, "find_spec", find)
        assert main([*words, "--slurm", resource]) == code
    said = capsys.readouterr().out.splitlines()
    assert len(said) == 8
    assert said[-2].startswith("12 runs: ")
    assert said[-2].endswith("2 packs of grains serve several runs")
    assert said[-1].endswith("out: 3 at a time, by Slurm with runtime=60")
    assert not (tmp_path / "out").exists()
    assert main(["check", str(path)]) == 2
    assert "is a sweep file and no case; fdnet sweep takes it" in capsys.readouterr().err


def test_a_grid_is_every_combination_with_every_seed(write):
    """Fines and fluid are none of a pack's business: runs of one seed share theirs."""
    plan, cases = planned(write(GRID))
    seen = {(c.fines.radius_mm, c.fluid.viscosity_cP, c.seed) for c in cases.values()}
    assert len(plan["runs"]) == len(cases) == 12
    assert seen == {(r, v, s) for r in (0.04, 0.05) for v in (10, 50, 90) for s in (3, 5)}
    assert {case.analysis.sections for case in cases.values()} == {2}
    assert list(plan["variants"][0]["keys"]) == ["fines.radius_mm", "fluid.viscosity"]
    packs = {(row["seed"], row["pack"]) for row in plan["runs"]}
    assert (len(packs), all(pack for _, pack in packs)) == (2, True)


def test_named_variants_meet_every_case(write, tmp_path):
    (tmp_path / "other.toml").write_text(tomli_w.dumps(TINY | {"name": "other"}))
    text = 'cases = ["tiny.toml", "other.toml"]\nseeds = 3\n'
    text += '[[variants]]\nname = "a/b"\nfines.count = 50\n[[variants]]\n"fines.count" = 60\n'
    plan, _ = planned(write(text))
    names = ["tiny-a_b", "tiny-count=60", "other-a_b", "other-count=60"]
    assert [one["name"] for one in plan["variants"]] == names
    assert plan["seeds"] == [1, 2, 3]


def test_bad_sweeps_are_refused_with_the_key(write, capsys):
    names = ("'$(touch hit)'", "'a; b'", "'a b'", "''", '"\'"', "5", "'-x'", '"a\\ntouch hit"')
    case = 'case = "tiny.toml"\n'
    for text, message in (
        ("seeds = 2", "case: give one case file"),
        (f"{case}sweeps = 1", "sweeps: unknown key"),
        *((f"{case}name = {name}", "name: ") for name in names),
        (f'{case}[[variants]]\nname = "a\\nb"', "variants.name: .*one line"),
        (f"{case}[[variants]]\nname = []", "variants.name: .*one line"),
        (f"{case}seeds = 0", "seeds: 0, expected"),
        (f"{case}seeds = true", "seeds: True, expected"),
        (f"{case}seeds = [1, 1]", "seeds: .*names a seed twice"),
        (f"{case}[grid]\nfines.radius_mm = 0.05", "grid.fines.radius_mm: 0.05, .*list"),
        (f"{case}[grid]\nfines.radius_mm = []", "grid.fines.radius_mm: "),
        (f"{case}[grid]\nseed = [1, 2]", "give seeds"),
        (f"{case}[[variants]]\nname = 'a'\nseed = 1", "give seeds"),
        ('case = "nowhere.toml"', "cannot be read"),
        (f"{case}[grid]\nfines.radus_mm = [1]", "did you mean fines.radius_mm"),
        (f"{case}[grid]\nfines.radius_mm = [0.05, -1]", "radius_mm=-1"),
        (f"{case}[grid]\nfines.count = [1]\n[set]\nfines.count = 2", "in \\[grid\\] and in set"),
        (f"{case}[targets]\ncost = 3", "targets.cost: unknown"),
        (f"{case}[targets]\ndepth = '5 kg'", "targets.depth"),
        ("case = ", "not valid TOML"),
        (f"{case}[grid]\nfines.count = [5, 5]", "given twice"),
    ):
        path = write(text)
        code, _, error = answer(capsys, "sweep", path, "--out", path.parent / "out")
        assert (code, bool(re.search(message, error))) == (2, True), (text, error)
        with pytest.raises(CaseError, match=message):
            fdnet.sweep(path, out=path.parent / "out")
    assert not (path.parent / "out").exists()


def test_a_million_runs_are_refused_with_their_number(write, capsys):
    values = list(range(1, 1001))
    path = write(f'case = "tiny.toml"\nseeds = 1000\n[grid]\nfines.count = {values}')
    code, _, error = answer(capsys, "sweep", path, "--out", path.parent / "out")
    assert code == 2
    assert "1,000,000 runs, more than 1,000" in error
    assert "--jobs-limit 1000000" in error


def test_a_folder_keeps_its_plan(tmp_path, capsys):
    """More seeds extend it, another case does not fit, and seeds that are there stay."""
    case, out = tmp_path / "tiny.toml", tmp_path / "out"
    case.write_text(tiny().toml())

    def gather(*more: str, out=out) -> int:
        return main(["ensemble", str(case), "--gather", "--quiet", "--out", str(out), *more])

    for asked, seeds in (("2", [1, 2]), ("3", [1, 2, 3]), ("1", [1, 2, 3])):
        assert gather("--seeds", asked) == 5
        assert json.loads((out / "plan.json").read_text())["seeds"] == seeds
    before = {path: path.stat().st_mtime_ns for path in out.glob("cases/*")}
    assert gather("--seeds", "2") == 5
    assert {path: path.stat().st_mtime_ns for path in out.glob("cases/*")} == before
    assert gather("--set", "fines.count=299") == 2
    assert "holds another plan" in capsys.readouterr().err
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("mine")
    assert gather(out=tmp_path / "mine") == 2
    assert "holds no campaign" in capsys.readouterr().err
    assert gather(out=case) == 2
    assert gather("--stages", "pack") == 2
    assert "without analyse" in capsys.readouterr().err


def designed(write, losses: dict[str, list[float]], targets: str, capsys, **more) -> dict:
    """summary.json of `fdnet sweep` over made-up muds, with the printed lines as `lines`."""
    muds = "".join(
        f'[[variants]]\nname = "{name}"\nfines.count = {50 + number}\n'
        for number, name in enumerate(losses)
    )
    seeds = len(next(iter(losses.values())))
    path = write(f'case = "tiny.toml"\nseeds = {seeds}\n{muds}[targets]\n{targets}\n')
    out = path.parent / "out"
    arguments = ["sweep", str(path), "--gather", "--quiet", "--out", str(out)]
    assert main(arguments) == 5
    for row in json.loads((out / "plan.json").read_text())["runs"]:
        case = read_case(out / f"cases/{row['name']}.toml")
        index = row["seed"] - 1
        numbers = {name: values[index] for name, values in more.items()}
        loss = losses[row["variant"]][index]
        finished_run(out / "runs" / row["name"], case, k_reduction=loss, **numbers)
    capsys.readouterr()
    assert main(arguments) == 0
    lines = capsys.readouterr().out.splitlines()
    made = json.loads((out / "summary.json").read_text()) | {"lines": lines}
    in_python = [one[:2] for one in fdnet.sweep(path, out=out).candidates]
    assert in_python == [(mud["name"], mud["state"]) for mud in made["candidates"]]
    return made


def test_muds_are_ranked_by_their_bands(write, capsys):
    """Half a band is 3.182 s / 2 = 0.016; t(n-1) / sqrt(n) <= 1 first at n = 7."""
    around = [-0.01, -0.01, 0.01, 0.01]
    losses = {
        name: [mean + x * 0.75**0.5 for x in around]
        for name, mean in (("bad", 0.5), ("close", 0.29), ("good", 0.1))
    }
    made = designed(write, losses, 'k_loss = "30 %"', capsys)
    states = [(mud["name"], mud["state"]) for mud in made["candidates"]]
    assert states == [("good", "met"), ("close", "open"), ("bad", "missed")]
    assert made["targets"] == {"k_loss": pytest.approx(0.3)}
    assert made["lines"][0].startswith("1. good meets every target: permeability lost 10.0 %")
    assert "some 7 seeds would decide it" in made["lines"][1]
    assert ">good meets every target" in (write("").parent / "out/compare.html").read_text()


def test_bridging_is_the_share_that_passes(write, capsys):
    more = {"passed_count": [1, 3], "supplied_count": [100, 100]}
    targets = 'bridging = "1 %"\ndepth = "500 um"\nk_loss = "30 %"'
    made = designed(write, {"mud": [0.1, 0.2]}, targets, capsys, **more)
    assert "pass through the specimen unbridged 2.0 % (95 %" in made["lines"][0]
    assert made["targets"] == pytest.approx({"depth": 5e-4, "k_loss": 0.3, "bridging": 0.01})


def test_the_shipped_design_plans_three_muds_and_every_shipped_sweep_runs(root):
    plan = sweep_plan(root / "cases/sweeps/bridging.toml")
    diameters = [round(2e6 * v.case.fines.mean_radius_m) for v in plan.variants]
    assert diameters == [30, 60, 100]
    assert (len(plan.jobs), len(set(plan.packs.values()))) == (24, 8)
    # no variant is refused, and none has springs that its deposit would press flat
    for name in ("bridging", "clogging", "coupling", "drag-and-overbalance"):
        for variant in sweep_plan(root / f"cases/sweeps/{name}.toml").variants:
            scales = scales_of(variant.case)
            with naming(name, variant.name):
                assert not list(refusals(variant.case, scales))
                assert scales.deposit_overlap < 0.1
