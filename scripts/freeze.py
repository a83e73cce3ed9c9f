#!/usr/bin/env python
"""The results that a change of the code must not move, and whether they stand.

    python scripts/freeze.py --write    # keeps the present results, before the change
    python scripts/freeze.py            # compares with them after it, some ten minutes
    python scripts/freeze.py --decks    # compares the rendered decks alone

It holds the SHA-256 of every deck of every shipped case, of the tables and of `summary.json` (less
seconds and versions) of three small runs, and permeabilities at full digits by each law.
"""

import argparse
import hashlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

import fdnet
from fdnet.network.permeability import Analysis
from validation.truth import read_pack, slabs

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "tests/data/frozen.json"
RUNS = {
    "quick": ["cases/quick.toml"],
    "followed": [
        "cases/quick/specimen5.toml",
        "--set",
        'drag={field="network"}',
        *("--set", "analysis.law=lubrication", "--set", "analysis.damage_law=auto"),
    ],
    "cleaned": ["cases/quick/specimen5.toml", "--set", "clean_up.drawdown_MPa=0.7"],
}
SMALL = ["--set", "fines.count=400", "--set", "run.cap_ms=20"]
PACKS = ["A_200_eps40", "C_r5_d8", "C_r10_d2", "G_r5_d8", "H_r10_d10", "H_r5_d17"]
SLABS = [
    "slabA_r5",
    "slabC_r5_mu0_cake",
    "slabK_r10_cake",
    "slabFC_r10",
    "slabIC_r10",
    "slabLL_r10",
]
TABLES = ["sections", "profile", "pores", "throats", "history", "clean_up", "layers", "cake"]
TABLES += ["spheres_initial", "spheres_damaged", "spheres_cleaned", "bridging"]
UNSTEADY = ("seconds", "versions", "cpu_seconds", "peak_memory_bytes")


def digest(content: bytes) -> str:
    """The first 16 hexadecimal digits of the SHA-256."""
    return hashlib.sha256(content).hexdigest()[:16]


def command(*words: str) -> None:
    """Run `fdnet` with these words."""
    program = [sys.executable, "-m", "fdnet.cli", *words]
    done = subprocess.run(program, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"fdnet {' '.join(words)}: {done.stderr or done.stdout}")


def decks(into: Path) -> Iterator[tuple[str, str]]:
    """Name and digest of every deck of every shipped case."""
    for case in sorted((ROOT / "cases").rglob("*.toml")):
        if case.parent.name == "sweeps":
            continue
        folder = into / case.relative_to(ROOT / "cases").with_suffix("")
        command("render", str(case), "--out", str(folder))
        for path in sorted(folder.rglob("*")):
            if path.is_file() and path.name.startswith("in."):
                yield f"decks/{path.relative_to(into)}", digest(path.read_bytes())


def steady(value: object) -> object:
    """A summary without what differs from run to run."""
    if isinstance(value, dict):
        return {key: steady(one) for key, one in value.items() if key not in UNSTEADY}
    return [steady(one) for one in value] if isinstance(value, list) else value


def runs(into: Path) -> Iterator[tuple[str, str]]:
    """Name and digest of the tables of the runs, and the numbers of their summaries."""
    for name, words in RUNS.items():
        folder = into / name
        small = SMALL if "quick.toml" not in words[0] else []
        command("run", *words, *small, "--out", str(folder))
        for table in TABLES:
            if (path := folder / f"{table}.csv").exists():
                yield f"runs/{name}/{path.name}", digest(path.read_bytes())
        summary = json.loads((folder / "summary.json").read_text())
        for key, value in steady(summary).items():
            small_value = isinstance(value, (int, float, str, type(None)))
            text = json.dumps(value, sort_keys=True)
            yield f"runs/{name}/summary/{key}", text if small_value else digest(text.encode())


def permeabilities() -> Iterator[tuple[str, str]]:
    """Permeability without and with fines, m2, at full digits, by each pair of laws."""
    for name in PACKS:
        spheres = read_pack(f"pack{name}")
        yield from _by_law(f"pack{name}", fdnet.compare(spheres, periodic="xyz"))
    for slab in slabs(SLABS):
        spheres = read_pack(slab.specimen)
        edges = sorted({*map(float, spheres.box[0]), *slab.planes})
        yield from _by_law(slab.name, fdnet.compare(spheres, periodic="yz", sections=edges))


def _by_law(name: str, results: Iterable[Analysis]) -> Iterator[tuple[str, str]]:
    for one in results:
        sections = [(s.k_initial, s.k_damaged) for s in one.sections]
        yield (
            f"k/{name}/{one.law}/{one.damage_law}",
            repr((one.k_initial, one.k_damaged, sections)),
        )


def main() -> None:
    """Compare with what is kept, or keep it anew."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--decks", action="store_true", help="the rendered decks alone")
    parser.add_argument("--write", action="store_true", help="keep the present results")
    asked = parser.parse_args()
    if not asked.write and not KEPT.exists():
        parser.error(f"{KEPT} is not there: call it with --write before the change, then without")
    with tempfile.TemporaryDirectory() as folder:
        now = dict(decks(Path(folder) / "decks"))
        if not asked.decks:
            now |= dict(permeabilities())
            now |= dict(runs(Path(folder) / "runs"))
    if asked.write:
        KEPT.write_text(json.dumps(now, indent=0) + "\n")
        return
    kept = {
        key: value
        for key, value in json.loads(KEPT.read_text()).items()
        if key in now or not asked.decks
    }
    changed = [key for key in sorted({*kept, *now}) if kept.get(key) != now.get(key)]
    for key in changed:
        print(f"{key}: kept {kept.get(key)}, now {now.get(key)}")
    print(f"{len(now)} results, {len(changed)} changed")
    raise SystemExit(bool(changed))


if __name__ == "__main__":
    main()
