"""Mutated case files, dumps and sphere tables through fdnet's real entries.

    python -m pytest -m nightly tests/robustness/test_mutations.py

FDNET_INPUTS (300) is the number of inputs of each kind, FDNET_SEED (1) chooses them. A fault is
any exception but fdnet's own, a warning, more than 20 s, an exit code other than 0, 2, 3 or 4,
more than one line of error, a file left by a refusal, or a result with impossible numbers.
"""

import contextlib
import io
import json
import math
import os
import signal
import warnings
from collections import Counter
from pathlib import Path
from random import Random

import numpy as np
import pytest

from fdnet.cli import main
from fdnet.errors import DumpError
from fdnet.spheres.dump import parse_dump
from robustness import mutations
from robustness.mutations import EDGE
from tests.spheres.dumps import lattice_dump

SEED, LIMIT_S = os.environ.get("FDNET_SEED", "1"), 20.0
DECKS = {"in.pack", "pack.data", "in.invade", "ask.in", "fluid.in", "held.in", "checkpoint.in"}
SMALL = "[box]\nsize_mm = [3.0, 1.6, 1.6]\n[grains]\nradius_mm = 0.25\ncount = 40\n"
RICH = "[fines]\nradius_mm = [0.03, 0.05]\nslab_mm = 0.5\n[gravity]\nmode = 'on'\n"
RICH += "[run]\nduration_ms = 0.1\n"
CASES = tuple(
    path.read_bytes()
    for path in sorted((Path(__file__).parents[2] / "cases").glob("*.toml"))
    if path.stem != "specimen1"
)
CASES += (f"name = 'a'\n{SMALL}".encode(), f"name = 'b'\n{SMALL}{RICH}".encode())


class TooLong(BaseException):
    """The time limit of one input has passed."""


def answer(words: list[str]) -> tuple[str | None, str]:
    """The refusal in a word, None where it is accepted, and the standard output."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = main(words)
        except SystemExit as stop:
            code = stop.code if isinstance(stop.code, int) else 1
    lines = err.getvalue().strip().splitlines()
    assert code in (0, 2, 3, 4), f"exit code {code}"
    assert len(lines) == (code != 0), lines
    assert code == 0 or not out.getvalue()
    return (None if code == 0 else f"refused ({code})"), out.getvalue()


def judge_case(data: bytes, folder: Path, _: Random) -> str:
    """`fdnet render`: decks that are whole, or nothing."""
    case = folder / "case.toml"
    case.write_bytes(data)
    refused, _ = answer(["render", str(case), "--out", str(folder / "decks")])
    written = [path for path in folder.rglob("*") if path.is_file() and path != case]
    assert not (refused and written), f"refused, yet {written[0].name} was written"
    if not refused:
        assert {"in.pack", "pack.data"} <= {path.name for path in written} <= DECKS
        words = {word for path in written for word in path.read_text().split()}
        assert not words & {"nan", "inf", "-nan", "-inf", "NaN"}
    return refused or "accepted"


def judge_dump(data: bytes, _: Path, __: Random) -> str:
    """The parser: whole frames of finite numbers, or DumpError."""
    try:
        frames = list(parse_dump(data, "fuzz.dump"))
    except DumpError as error:
        return "refused" if "\n" not in str(error) else pytest.fail("several lines")
    for one in frames:
        assert np.all(np.isfinite(one.rows))
        assert one.rows.shape[1] == len(one.columns)
        assert np.all(np.isfinite(one.box))
    return "accepted"


OPTIONS = {"--units": "m mm um", "--axis": "x y z", "--periodic": "x yz xyz xyz"}
OPTIONS |= {"--sections": "1 3 8", "--walls": "slip no-slip"}


def judge_spheres(data: bytes, folder: Path, rng: Random) -> str:
    """`fdnet permeability`: strict JSON with possible numbers, or a refusal."""
    table = folder / "spheres.csv"
    table.write_bytes(data)
    box = f"0,{EDGE},0,{EDGE},0,{EDGE}"
    box = rng.choice(("", f"0,{EDGE},0,0.5,0,{EDGE}", "0,1e-3,0,1e3,0,1", *[box] * 4))
    words = ["permeability", str(table), "--json", *(["--box", box] if box else [])]
    for option, values in OPTIONS.items():
        words += [option, rng.choice(values.split())]
    refused, out = answer(words + rng.choice(([], [], ["--law", "thesis"], ["--compare-laws"])))
    assert list(folder.iterdir()) == [table]
    return refused or judge_numbers(out)


def judge_numbers(text: str) -> str:
    """The output of `fdnet permeability --json`."""
    result = json.loads(text, parse_constant=lambda name: pytest.fail(name))
    for one in (result, *result["sections"]):
        before, after = one["k_initial_m2"], one["k_damaged_m2"]
        shares = one["porosity_initial"], one["porosity_damaged"]
        assert all(math.isfinite(value) and value >= 0 for value in (before, after, *shares))
        assert max(shares) <= 1
        assert one is not result or after <= before * (1 + 1e-9)
    return "accepted" if result["k_initial_m2"] > 0 else "accepted, k = 0"


FRAMES = [lattice_dump(step=step) for step in range(3)]
DUMPS = tuple("".join(FRAMES[:count]).encode() for count in (1, 2, 3))
PACKS = tuple(mutations.small_pack(Random(number), number % 2 * 12) for number in range(4))
KINDS = {
    "case bytes": (judge_case, CASES, mutations.change_bytes),
    "case tables": (judge_case, CASES, mutations.change_tables),
    "dump bytes": (judge_dump, DUMPS, mutations.change_bytes),
    "dump lines": (judge_dump, DUMPS, mutations.change_lines),
    "spheres bytes": (judge_spheres, PACKS, mutations.change_bytes),
    "spheres lines": (judge_spheres, PACKS, mutations.change_lines),
    "spheres geometry": (judge_spheres, PACKS, mutations.change_geometry),
}


def outcomes(kind: str, number: int, folder: Path) -> Counter[str]:
    """What became of so many inputs of a kind. Raises AssertionError with the first fault."""
    judge, seeds, change = KINDS[kind]
    seen: Counter[str] = Counter()
    for index in range(number):
        rng = Random(f"{SEED}:{kind}:{index}")
        data, place = change(rng, rng.choice(seeds)), folder / f"{kind} {index}"
        seen[outcome(judge, data, place, rng, f"{kind} {index} of seed {SEED}")] += 1
    return seen


def outcome(judge, data: bytes, place: Path, rng: Random, name: str, limit=LIMIT_S) -> str:
    """What became of one input."""

    def stop(*_: object) -> None:
        raise TooLong(f"not done within {limit:g} s")

    place.mkdir(exist_ok=True)
    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, limit)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return judge(data, place, rng)
    except (TooLong, Exception) as fault:
        said = f"{name}: {type(fault).__name__}: {fault}\n{data[:2000]!r}"
        raise AssertionError(said) from fault
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def test_good_inputs_and_some_mutated_ones_make_no_fault(tmp_path):
    plain = Random()
    plain.choice = lambda options: options[-1]
    for kind, (judge, seeds, _) in KINDS.items():
        for number, data in enumerate(seeds[-2:] * (" bytes" in kind)):
            good = outcome(judge, data, tmp_path / f"{kind} good {number}", plain, kind, 120.0)
            assert good == "accepted"
        assert outcomes(kind, 8, tmp_path).total() == 8


@pytest.mark.nightly
@pytest.mark.parametrize("kind", KINDS)
def test_mutated_inputs_make_no_fault(kind, tmp_path, record_property):
    number = int(os.environ.get("FDNET_INPUTS", "300"))
    seen = outcomes(kind, number, tmp_path)
    for name, count in seen.items():
        record_property(name, count)
    assert sum(seen.values()) == number
    assert len(seen) > 1, "both accepted and refused"
