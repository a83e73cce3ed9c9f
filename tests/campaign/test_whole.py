"""A sweep through the real binary: its table, its page, its failed runs, and its second call."""

import csv
import json
import re
from pathlib import Path

import pytest
import tomli_w
from builders import TINY

import fdnet
from fdnet.cli import main

pytestmark = pytest.mark.liggghts
SWEEP = """
name = "muds"
case = "tiny.toml"
seeds = 2
variants = [
    {name = "few", fines.count = 40},
    {name = "many", fines.count = 120},
    {name = "late", run.max_hours = 1e-9},
]
"""
STAGES = ["--stages", "pack,invade,analyse", "--engine", "local", "--jobs", "2", "--quiet"]


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """Folder of the sweep, and its exit code; `late` may take no time."""
    folder = tmp_path_factory.mktemp("sweep")
    (folder / "tiny.toml").write_text(tomli_w.dumps(TINY))
    (folder / "sweep.toml").write_text(SWEEP)
    code = main(["sweep", str(folder / "sweep.toml"), "--out", str(folder / "out"), *STAGES])
    return folder / "out", code


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_the_table_has_every_run_and_number(swept):
    """Its columns: the run, its variant, the varied keys, seed, status, reason, and numbers."""
    out, code = swept
    assert code == 5
    columns = list(rows(out / "table.csv")[0])
    assert columns[:5] == ["run", "variant", "fines.count", "run.max_hours", "seed"]
    assert columns[5:8] == ["status", "reason", "folder"]
    table = {row["run"]: row for row in rows(out / "table.csv")}
    assert len(table) == 6
    for name, row in table.items():
        assert row["status"] == ("failed" if name.startswith("late") else "done")
    failures = json.loads((out / "summary.json").read_text())["failures"]
    assert [row["run"] for row in failures] == ["late-seed-1", "late-seed-2"]
    for row in failures:
        assert row["reason"].startswith("run.max_hours: 1e-09 h, but")
        assert row["folder"] == f"runs/{row['run']}"
    summary = json.loads((out / "runs/many-seed-2/summary.json").read_text())
    row = table["many-seed-2"]
    assert row["fines.count"] == "120"
    assert float(row["k_damaged_m2"]) == summary["k_damaged_m2"]
    assert float(row["sections.2.k_reduction"]) == summary["sections"][1]["k_reduction"]
    assert int(row["warnings"]) == len(summary["warnings"])


def test_python_opens_it_as_one_object(swept):
    """The numbers of its summary.json; runs that failed are in the table."""
    runs, written = fdnet.open_runs(swept[0]), json.loads((swept[0] / "summary.json").read_text())
    few = next(row for row in written["variants"] if row["name"] == "few")
    row = runs.band.loc[("few", "k_reduction")]
    assert {name: row[name] for name in row.index} == {n: few["k_reduction"][n] for n in row.index}
    assert runs.summary == written
    assert runs.table["status"].tolist().count("failed") == 2
    depth = runs.by_depth()
    assert set(depth["variant"]) == {"few", "many"}
    assert depth["x_hi_m"].max() == pytest.approx(1e-3 * TINY["box"]["size_mm"][0])


def test_the_difference_is_taken_seed_by_seed(swept):
    out, _ = swept
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["runs"], summary["done"], summary["failed"]) == (6, 4, 2)
    losses = {r["run"]: float(r["k_reduction"] or "nan") for r in rows(out / "table.csv")}
    gaps = [losses[f"few-seed-{seed}"] - losses[f"many-seed-{seed}"] for seed in (1, 2)]
    (pair,) = summary["pairs"]
    assert pair["paired"]
    assert pair["difference"]["mean"] == pytest.approx(sum(gaps) / 2)


def test_packs_are_made_once(swept):
    """Two packs for four runs; the copies count no time of LIGGGHTS, the whole counts it once."""
    out, _ = swept
    records = [json.loads(p.read_text()) for p in sorted(out.glob("runs/*/pack/stage.json"))]
    assert len(records) == 4
    assert len({record["taken_from"] for record in records}) == 2
    assert all(run["seconds"] == 0 for record in records for run in record["runs"])
    cost = json.loads((out / "summary.json").read_text())["all_cpu_seconds"]
    runs = [json.loads(p.read_text())["cpu_seconds"] for p in out.glob("runs/*/summary.json")]
    packs = [json.loads(p.read_text()) for p in out.glob("packs/*/pack/stage.json")]
    shared = sum(run["cpu_seconds"] for one in packs for run in (one, *one["runs"]))
    shared += sum(row["liggghts_cpu_s"] for one in packs for row in one["attempts"][:-1])
    assert cost == pytest.approx(shared + sum(sum(one.values()) for one in runs))
    assert shared > 0
    made = {p.read_bytes() for p in out.glob("packs/*/pack/post/pack.dump")}
    assert made == {p.read_bytes() for p in out.glob("runs/*/pack/post/pack.dump")}


def test_the_page_stands_alone_and_leads_to_every_run(swept):
    out, _ = swept
    page = (out / "compare.html").read_text()
    links = re.findall(r'href="([^"]+)"', page)
    done = [f"runs/{name}-seed-{seed}" for name in ("few", "many") for seed in (1, 2)]
    assert set(done) <= set(links)
    assert not [s for s in re.findall(r'(?:src|href)="([^"]+)"', page) if s.startswith("http")]
    for link in links:
        place, _, anchor = link.partition("#")
        assert (out / place).exists() or "late" in link
        assert not anchor or f'id="{anchor}"' in page
    assert page.index('id="ranking"') < page.index("<img") < page.index('id="pairs"')
    first = re.search(r'id="ranking".*?<li>(.*?)</li>', page, re.DOTALL)
    assert first is not None
    said = first[1].replace("&nbsp;", " ")
    assert re.match(r"few: permeability lost .* % \(95 % band .* to .* %.*\), 2 seeds", said)


def test_a_second_call_runs_only_what_is_missing(swept, capsys):
    out, _ = swept
    before = {p: p.stat().st_mtime_ns for p in out.glob("runs/*/manifest.json")}
    gone = out / "runs/few-seed-1/manifest.json"
    gone.unlink()
    assert main(["sweep", str(out.parent / "sweep.toml"), "--out", str(out), *STAGES]) == 5
    after = {p: p.stat().st_mtime_ns for p in out.glob("runs/*/manifest.json")}
    assert after.keys() == before.keys()
    assert [p for p in before if before[p] != after[p]] == [gone]
    assert "late-seed-1 failed" in capsys.readouterr().err


def test_runs_are_compared_by_what_differs_in_their_cases(swept, tmp_path, capsys):
    out, _ = swept
    runs = [str(out / f"runs/{name}-seed-{seed}") for name in ("few", "many") for seed in (1, 2)]
    assert main(["compare", *runs, "--out", str(tmp_path / "c")]) == 0
    assert capsys.readouterr().out.startswith("1. count=40: permeability lost ")
    table = rows(tmp_path / "c" / "table.csv")
    assert {row["fines.count"] for row in table} == {"40", "120"}
    assert main(["compare", runs[0], runs[0], "--out", str(tmp_path / "d")]) == 2
    assert "counted twice" in capsys.readouterr().err
    assert main(["compare", str(tmp_path), "--out", str(tmp_path / "d")]) == 2
    assert main(["compare", str(out), "--out", str(tmp_path / "d")]) == 0
    assert len(rows(tmp_path / "d" / "table.csv")) == 4


def test_a_pack_of_another_seed_is_not_taken(swept, tmp_path, capsys):
    out, _ = swept
    arguments = ["run", str(out.parent / "tiny.toml"), "--seed", "7", "--quiet"]
    source = next(out.glob("packs/*"))
    assert main([*arguments, "--out", str(tmp_path / "r"), "--pack-from", str(source)]) == 2
    assert "another case or seed" in capsys.readouterr().err
    assert not (tmp_path / "r").exists()


def test_the_fast_model_runs_without_liggghts_and_the_page_says_so(swept, tmp_path, capsys):
    """Its seeds are those of `fdnet run --fast`, on the packs of LIGGGHTS."""
    case, out = swept[0].parent / "tiny.toml", tmp_path / "out"
    assert main(["ensemble", str(case), "--fast", "--seeds", "2", "--out", str(out), *STAGES]) == 0
    said = "All runs are by the fast model of size classes: on the packs of five cases"
    assert said in capsys.readouterr().out
    assert said in (out / "compare.html").read_text()
    alone = tmp_path / "alone"
    stages = ["--stages", "pack,invade,analyse", "--quiet"]
    assert main(["run", str(case), "--fast", "--seed", "2", "--out", str(alone), *stages]) == 0
    k = json.loads((alone / "summary.json").read_text())["k_damaged_m2"]
    assert [float(row["k_damaged_m2"]) for row in rows(out / "table.csv")][1] == k
    assert {row["method"] for row in rows(out / "table.csv")} == {"network"}
    assert not list(out.rglob("in.invade"))
    how = {"seeds": 2, "out": out, "stages": ("pack", "invade", "analyse"), "engine": "local"}
    again = fdnet.ensemble(fdnet.read_case(case), fast=True, **how)
    assert again.summary["k_damaged_m2"]["mean"] > 0
    assert "fast model" not in str(fdnet.open_runs(swept[0]))
    plain = ["ensemble", str(case), "--gather", "--quiet", "--out", str(tmp_path / "plain")]
    assert main(plain) == 5  # what one call sets, the next of the same process has not
    assert "network" not in (tmp_path / "plain/cases/tiny-seed-1.toml").read_text()


def test_a_sweep_by_the_fast_model_varies_no_model(swept, tmp_path):
    file = swept[0].parent / "fast.toml"
    file.write_text('case = "tiny.toml"\n[grid]\ninvasion.method = ["network", "liggghts"]\n')
    with pytest.raises(fdnet.CaseError, match=r"varies invasion\.method; leave --fast out"):
        fdnet.sweep(file, out=tmp_path / "out", fast=True)
