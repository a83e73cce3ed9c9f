"""Mutated case files, dumps and sphere tables through fdnet's real entries: none may crash, hang or half-write.

    python scripts/fuzz.py --inputs 10500 --seed 1 --record docs/validation/fuzz.json [--keep DIR] [--only INDEX]

Case files go through `fdnet render`, sphere tables through `fdnet permeability`, dumps through the parser, all in this
process. A fault is: any exception but fdnet's own, an exit code other than 0, 2, 3 or 4, more than one line of error
message, a warning of Python, a file left by a refusal, a result that is not whole or has impossible numbers, or more
than the limit of CPU time. Input INDEX of a seed is always the same. Ends with 1 when there were faults.
"""

import argparse
import contextlib
import faulthandler
import io
import json
import math
import resource
import signal
import sys
import tempfile
import time
import tomllib
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

import fuzz_mutations as mutations

from fdnet.cli import main as fdnet
from fdnet.errors import DumpError
from fdnet.spheres.dump import COLUMNS, parse_dump

LIMIT_S = 10.0
MEMORY_BYTES = 6 << 30
EDGE = 4.0


class TooLong(BaseException):
    """The time limit of one input has passed."""


@dataclass(frozen=True, slots=True)
class Told:
    """What the command line answered."""

    code: int
    out: str
    err: str


@dataclass(frozen=True, slots=True)
class Target:
    """One entry: good inputs to start from, ways to break them, and what judges the answer."""

    seeds: tuple[bytes, ...]
    changes: dict[str, mutations.Mutation]
    judge: Callable[[bytes, Path, Random], str]


def fault(what: str) -> str:
    """An outcome that must not be."""
    return f"fault: {what}"


def tell(arguments: list[str]) -> Told:
    """Run the command line in this process."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = fdnet(arguments)
        except SystemExit as stop:
            code = stop.code if isinstance(stop.code, int) else 1
    return Told(code, out.getvalue(), err.getvalue())


def refusal(told: Told) -> str | None:
    """The outcome of a refusal, None when the input was accepted."""
    lines = told.err.strip().splitlines()
    if told.code == 0:
        return fault(f"accepted with a message: {lines[0]}") if lines else None
    if told.code not in (2, 3, 4):
        return fault(f"exit code {told.code}")
    if len(lines) != 1 or told.out:
        return fault(
            f"exit code {told.code} with {len(lines)} lines of error and {len(told.out)} characters of output"
        )
    return {2: "refused", 3: "refused (3)", 4: "degenerate"}[told.code]


def judge_case(data: bytes, folder: Path, _: Random) -> str:
    """`fdnet render`: decks that are whole, or nothing."""
    case, out = folder / "case.toml", folder / "decks"
    case.write_bytes(data)
    refused = refusal(tell(["render", str(case), "--out", str(out)]))
    written = [path for path in folder.rglob("*") if path.is_file() and path != case]
    if refused:
        return fault(f"{refused}, yet {written[0].name} was written") if written else refused
    names = {path.name for path in written}
    if not {"in.pack", "pack.data"} <= names <= {"in.pack", "pack.data", "in.invade"}:
        return fault(f"decks {sorted(names)}")
    words = [word for path in written for word in path.read_text().split() if len(word) < 10]
    return (
        fault("a deck holds nan or inf")
        if {"nan", "inf", "-nan", "-inf", "NaN"} & set(words)
        else "accepted"
    )


def judge_dump(data: bytes, _: Path, __: Random) -> str:
    """The parser: whole frames of finite numbers, or DumpError."""
    try:
        frames = list(parse_dump(data, "fuzz.dump"))
    except DumpError as error:
        return fault("message of several lines") if "\n" in str(error) else "refused"
    whole = all(
        np.all(np.isfinite(one.rows)) and one.rows.shape[1] == len(one.columns) for one in frames
    )
    bounded = all(np.all(np.isfinite(one.box)) for one in frames)
    return "accepted" if whole and bounded else fault("a frame holds numbers that are not finite")


def judge_spheres(data: bytes, folder: Path, rng: Random) -> str:
    """`fdnet permeability`: strict JSON with possible numbers, or a refusal."""
    table = folder / "spheres.csv"
    table.write_bytes(data)
    told = tell(["permeability", str(table), "--json", *_options(rng)])
    if [path for path in folder.rglob("*") if path != table]:
        return fault("files beside the input")
    return refusal(told) or _numbers(told.out)


def _options(rng: Random) -> list[str]:
    sides = rng.choice(("", "x", "yz", "xyz", "xyz"))
    box = rng.choice(
        (
            None,
            f"0,{EDGE},0,0.5,0,{EDGE}",
            "0,1e-3,0,1e3,0,1",
            *(f"0,{EDGE},0,{EDGE},0,{EDGE}",) * 4,
        )
    )
    chosen = [
        "--units",
        rng.choice(("m", "mm", "um")),
        "--axis",
        rng.choice("xyz"),
        "--periodic",
        sides,
    ]
    chosen += [
        "--sections",
        rng.choice(("1", "3", "8")),
        "--walls",
        rng.choice(("slip", "no-slip")),
    ]
    return (
        chosen
        + (["--box", box] if box else [])
        + rng.choice(([], [], ["--law", "thesis"], ["--compare-laws"]))
    )


def _numbers(text: str) -> str:
    try:
        found = json.loads(text, parse_constant=_refuse)
    except ValueError:
        return fault("output is not JSON")
    for one in (found, *found["sections"]):
        before, after = one["k_initial_m2"], one["k_damaged_m2"]
        numbers = [before, after, one["porosity_initial"], one["porosity_damaged"]]
        if not all(
            isinstance(value, float | int) and math.isfinite(value) and value >= 0
            for value in numbers
        ):
            return fault(f"k, k damaged, porosities {numbers}")
        if max(numbers[2:]) > 1 or (one is found and after > before * (1 + 1e-9)):
            return fault(f"k, k damaged, porosities {numbers}")
    return "accepted" if found["k_initial_m2"] > 0 else "accepted, k = 0"


def _refuse(name: str) -> None:
    raise ValueError(name)


def targets(root: Path) -> dict[str, Target]:
    """The entries by name, with the shipped cases, small dumps and small packs to start from."""
    cases = tuple(
        path.read_bytes()
        for path in sorted((root / "cases").glob("*.toml"))
        if path.stem != "specimen1"
    )
    small = "[box]\nsize_mm = [3.0, 1.6, 1.6]\n[grains]\nradius_mm = 0.25\ncount = 40\n"
    rich = (
        small
        + "[fines]\nradius_mm = [0.03, 0.05]\nslab_mm = 0.5\n[gravity]\nmode = 'on'\n[run]\nduration_ms = 0.1\n"
    )
    cases += (f"name = 'a'\n{small}".encode(), f"name = 'b'\nseed = 3\n{rich}".encode())
    return {
        "case": Target(cases, mutations.CASE, judge_case),
        "dump": Target(tuple(_dump(Random(n), n) for n in (1, 2, 3)), mutations.DUMP, judge_dump),
        "spheres": Target(
            tuple(_spheres(Random(n), fines=n % 2) for n in range(4)),
            mutations.SPHERES,
            judge_spheres,
        ),
    }


def _dump(rng: Random, frames: int) -> bytes:
    text = ""
    for step in range(frames):
        rows = [
            f"{n + 1} 2 " + " ".join(repr(rng.gauss(0, 1e-3)) for _ in range(7)) + " \n"
            for n in range(8)
        ]
        head = f"ITEM: TIMESTEP\n{100 * step}\nITEM: NUMBER OF ATOMS\n{len(rows)}\nITEM: BOX BOUNDS ff ff ff\n"
        text += (
            head
            + "-0.001 0.003\n0 0.0016\n0 0.0016\n"
            + f"ITEM: ATOMS {COLUMNS} \n"
            + "".join(rows)
        )
    return text.encode()


def _spheres(rng: Random, *, fines: int) -> bytes:
    points = [
        [EDGE / 3 * (n // 9 + 0.5), EDGE / 3 * (n // 3 % 3 + 0.5), EDGE / 3 * (n % 3 + 0.5)]
        for n in range(27)
    ]
    rows = [
        [x + rng.uniform(-0.25, 0.25) for x in point] + [rng.uniform(0.5, 0.65), "grain"]
        for point in points
    ]
    rows += [[rng.uniform(0, EDGE) for _ in range(3)] + [0.1, "fine"] for _ in range(12 * fines)]
    return "\n".join(["x,y,z,radius,kind", *(",".join(map(str, row)) for row in rows)]).encode()


@contextlib.contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Raise TooLong in the body after `seconds` of this process's CPU time."""

    def stop(*_: Any) -> None:
        raise TooLong

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    # compiled code sees no signal before it returns: this ends the process and says where it was
    faulthandler.dump_traceback_later(30 * seconds, exit=True)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        faulthandler.cancel_dump_traceback_later()
        signal.signal(signal.SIGPROF, before)


def one_input(known: dict[str, Target], seed: int, index: int) -> tuple[str, bytes, Random]:
    """Kind, bytes and the generator that chooses the options of input `index`."""
    rng = Random(f"{seed}:{index}")
    name = rng.choice(list(known))
    kind = rng.choice(list(known[name].changes))
    return f"{name} {kind}", known[name].changes[kind](rng, rng.choice(known[name].seeds)), rng


def outcome(target: Target, data: bytes, rng: Random, limit: float) -> str:
    """What became of one input."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            with limited(limit):
                found = target.judge(data, Path(folder), rng)
        except TooLong:
            return fault(f"not done within {limit:g} s")
        except Exception as error:
            return fault(f"{type(error).__name__}: {error}")
    return fault(f"{said[0].category.__name__}: {said[0].message}") if said else found


def _refuse_bad_seeds(target: Target) -> None:
    """What all inputs are made from must be accepted; this also compiles what numba compiles, outside the limit."""
    plain = Random()
    plain.choice = lambda options: options[-1]  # type: ignore[method-assign]
    for data in target.seeds:
        with tempfile.TemporaryDirectory() as folder:
            found = target.judge(data, Path(folder), plain)
        if not found.startswith("accepted"):
            raise RuntimeError(f"a good input is not accepted: {found}")


def fuzz(
    root: Path, *, seed: int, indices: range, limit: float = LIMIT_S, keep: Path | None = None
) -> dict[str, Any]:
    """Run the inputs `indices` of `seed`; counts by kind and outcome, and every fault with its index."""
    known, counts, faults = targets(root), Counter(), []
    for target in known.values():
        _refuse_bad_seeds(target)
    start = time.perf_counter()
    for index in indices:
        kind, data, rng = one_input(known, seed, index)
        if keep:
            (keep / "last").write_text(f"{seed} {index} {kind}")
        found = outcome(known[kind.split()[0]], data, rng, limit)
        counts[kind, found.partition(":")[0]] += 1
        if found.startswith("fault"):
            faults.append({"index": index, "kind": kind, "what": " ".join(found.split())[:300]})
            if keep:
                (keep / f"{seed}_{index}").write_bytes(data)
    kinds: dict[str, dict[str, int]] = {}
    for (kind, found), count in sorted(counts.items()):
        kinds.setdefault(kind, {})[found] = count
    versions = {name: metadata.version(name) for name in ("numpy", "pandas", "pydantic", "scipy")}
    versions["fdnet"] = tomllib.loads((root / "pyproject.toml").read_text())["project"]["version"]
    return {
        "inputs": len(indices),
        "seed": seed,
        "limit_s": limit,
        "seconds": round(time.perf_counter() - start, 1),
        "versions": versions,
        "kinds": kinds,
        "faults": faults,
    }


def main() -> int:
    """Read the options, run, write the record."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--inputs", type=int, default=10_500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, metavar="INDEX", help="this input alone")
    parser.add_argument("--record", type=Path, metavar="FILE.json")
    parser.add_argument(
        "--keep", type=Path, metavar="DIR", help="keep the inputs that made faults"
    )
    options = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    if options.keep:
        options.keep.mkdir(parents=True, exist_ok=True)
    indices = (
        range(options.inputs) if options.only is None else range(options.only, options.only + 1)
    )
    root = Path(__file__).resolve().parents[1]
    text = (
        json.dumps(fuzz(root, seed=options.seed, indices=indices, keep=options.keep), indent=1)
        + "\n"
    )
    if options.record:
        options.record.write_text(text, encoding="utf-8")
    print(text, end="")
    return 1 if json.loads(text)["faults"] else 0


if __name__ == "__main__":
    sys.exit(main())
