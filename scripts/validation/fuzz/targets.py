"""The entries of fdnet that are fuzzed: good inputs, and what judges the answers.

Case files go through `fdnet render`, sphere tables through `fdnet permeability`, dumps through the
parser. A fault is an exit code other than 0, 2, 3 or 4, more than one line of error message, a
file left by a refusal, or a result that is not whole or has impossible numbers.
"""

import contextlib
import io
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from random import Random

import numpy as np

from fdnet.errors import DumpError
from fdnet.spheres.dump import COLUMNS, parse_dump
from validation.fuzz import mutations

EDGE = 4.0
"""Edge of the box of the small packs."""
Command = Callable[[Sequence[str]], int]
"""fdnet's command line: it takes arguments and returns an exit code."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What the command line answered.

    Attributes:
        code: exit code.
        out: standard output.
        err: standard error.
    """

    code: int
    out: str
    err: str


@dataclass(frozen=True, slots=True)
class Target:
    """One entry of fdnet.

    Attributes:
        seeds: good inputs to start from.
        changes: mutations by name.
        judge: the outcome of an input, given a folder and a generator for the options.
    """

    seeds: tuple[bytes, ...]
    changes: dict[str, mutations.Mutation]
    judge: Callable[[bytes, Path, Random], str]


def fault(what: str) -> str:
    """An outcome that must not be."""
    return f"fault: {what}"


def answer_of(command: Command, arguments: Sequence[str]) -> Answer:
    """What the command line answers, run in this process."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = command(arguments)
        except SystemExit as stop:
            code = stop.code if isinstance(stop.code, int) else 1
    return Answer(code, out.getvalue(), err.getvalue())


def refusal(answer: Answer) -> str | None:
    """The outcome of a refusal, None when the input was accepted."""
    lines = answer.err.strip().splitlines()
    if answer.code == 0:
        return fault(f"accepted with a message: {lines[0]}") if lines else None
    if answer.code not in (2, 3, 4):
        return fault(f"exit code {answer.code}")
    if len(lines) != 1 or answer.out:
        return fault(
            f"exit code {answer.code} with {len(lines)} lines of error "
            f"and {len(answer.out)} characters of output"
        )
    return {2: "refused", 3: "refused (3)", 4: "degenerate"}[answer.code]


DECKS = {
    *("in.pack", "pack.data", "in.invade"),
    *("ask.in", "fluid.in", "held.in", "checkpoint.in"),
}
"""What `fdnet render` may write; the second line belongs to a coupled invasion."""


def judge_case(data: bytes, folder: Path, _: Random, *, command: Command) -> str:
    """`fdnet render`: decks that are whole, or nothing."""
    case, out = folder / "case.toml", folder / "decks"
    case.write_bytes(data)
    refused = refusal(answer_of(command, ["render", str(case), "--out", str(out)]))
    written = [path for path in folder.rglob("*") if path.is_file() and path != case]
    if refused:
        return fault(f"{refused}, yet {written[0].name} was written") if written else refused
    names = {path.name for path in written}
    if not {"in.pack", "pack.data"} <= names <= DECKS:
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


def judge_spheres(data: bytes, folder: Path, rng: Random, *, command: Command) -> str:
    """`fdnet permeability`: strict JSON with possible numbers, or a refusal."""
    table = folder / "spheres.csv"
    table.write_bytes(data)
    answer = answer_of(command, ["permeability", str(table), "--json", *_options(rng)])
    if [path for path in folder.rglob("*") if path != table]:
        return fault("files next to the input")
    return refusal(answer) or judge_numbers(answer.out)


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


def judge_numbers(text: str) -> str:
    """The outcome of the output of `fdnet permeability --json`."""
    try:
        result = json.loads(text, parse_constant=_refuse)
    except ValueError:
        return fault("output is not JSON")
    for one in (result, *result["sections"]):
        before, after = one["k_initial_m2"], one["k_damaged_m2"]
        numbers = [before, after, one["porosity_initial"], one["porosity_damaged"]]
        if not all(
            isinstance(value, float | int) and math.isfinite(value) and value >= 0
            for value in numbers
        ):
            return fault(f"k, k damaged, porosities {numbers}")
        if max(numbers[2:]) > 1 or (one is result and after > before * (1 + 1e-9)):
            return fault(f"k, k damaged, porosities {numbers}")
    return "accepted" if result["k_initial_m2"] > 0 else "accepted, k = 0"


def _refuse(name: str) -> None:
    raise ValueError(name)


def targets(root: Path, command: Command) -> dict[str, Target]:
    """The entries by name, with the shipped cases, small dumps and small packs to start from."""
    cases = tuple(
        path.read_bytes()
        for path in sorted((root / "cases").glob("*.toml"))
        if path.stem != "specimen1"
    )
    small = "[box]\nsize_mm = [3.0, 1.6, 1.6]\n[grains]\nradius_mm = 0.25\ncount = 40\n"
    rich = (
        small
        + "[fines]\nradius_mm = [0.03, 0.05]\nslab_mm = 0.5\n"
        + "[gravity]\nmode = 'on'\n[run]\nduration_ms = 0.1\n"
    )
    cases += (f"name = 'a'\n{small}".encode(), f"name = 'b'\nseed = 3\n{rich}".encode())
    return {
        "case": Target(cases, mutations.CASE, partial(judge_case, command=command)),
        "dump": Target(tuple(_dump(Random(n), n) for n in (1, 2, 3)), mutations.DUMP, judge_dump),
        "spheres": Target(
            tuple(_spheres(Random(n), fines=n % 2) for n in range(4)),
            mutations.SPHERES,
            partial(judge_spheres, command=command),
        ),
    }


def _dump(rng: Random, frames: int) -> bytes:
    text = ""
    for step in range(frames):
        rows = [
            f"{n + 1} 2 " + " ".join(repr(rng.gauss(0, 1e-3)) for _ in range(7)) + " \n"
            for n in range(8)
        ]
        head = f"ITEM: TIMESTEP\n{100 * step}\nITEM: NUMBER OF ATOMS\n{len(rows)}\n"
        head += "ITEM: BOX BOUNDS ff ff ff\n"
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
