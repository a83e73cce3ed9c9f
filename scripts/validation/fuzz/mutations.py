"""Broken case files, dumps and sphere tables, made from good ones by a random generator."""

import copy
import tomllib
from collections.abc import Callable
from random import Random
from typing import Any

import tomli_w

Mutation = Callable[[Random, bytes], bytes]

VALUES: tuple[Any, ...] = (
    0,
    -1,
    1,
    2,
    -0.0,
    1e-300,
    5e-324,
    1e-9,
    1e3,
    1e15,
    1e16,
    1e308,
    float("inf"),
    float("-inf"),
    float("nan"),
)
VALUES += (
    2**31,
    2**63,
    -(2**63),
    10**30,
    True,
    False,
    "",
    "walls",
    "1.0",
    "\u00b5\n\x00",
    [],
    [1.0],
    [1.0, 2.0],
)
VALUES += ([0.3, 0.2], [1.0, 1.0, 1.0], [[1.0]], {}, {"a": 1}, [0.1] * 20)
NUMBERS: tuple[str, ...] = (
    "nan",
    "inf",
    "-inf",
    "NaN",
    "1e400",
    "-1e400",
    "1e-400",
    "0",
    "-0",
    "-1",
    "0x10",
    "1_0",
    "",
    "abc",
    "1,5",
)
NUMBERS += (
    "1e308",
    "1e-300",
    "1e12",
    "1e-12",
    "+5",
    " 7",
    "7.",
    "٣",
    "9" * 400,
    "--1",
    "1e",
    "∞",
    "none",
    "true",
    '"',
)
_BYTES = (
    b"\x00",
    b"\xff\xfe",
    b"\xef\xbb\xbf",
    b"\r",
    b"\r\n",
    b"\n\n",
    b"\t",
    b" ",
    b"#",
    b'"',
    b"=",
    b"[",
    b",",
    b"-",
)


def change_bytes(rng: Random, data: bytes) -> bytes:
    """One to eight bytes or stretches flipped, put in, cut out, doubled, or the end cut off."""
    for _ in range(rng.choice((1, 1, 1, 2, 4, 8))):
        at, length = rng.randrange(len(data) + 1), rng.choice((1, 1, 2, 5, 40))
        put = rng.choice(
            (b"", bytes([rng.randrange(256)]), rng.choice(_BYTES), data[at : at + length] * 2)
        )
        data = (
            data[:at]
            if rng.random() < 0.1
            else data[:at] + put + data[at + rng.choice((0, length)) :]
        )
    return data


def change_structure(rng: Random, data: bytes) -> bytes:
    """Tables and keys of TOML dropped, renamed, copied, nested or given another kind of value."""
    tables = tomllib.loads(data.decode())
    for _ in range(rng.choice((1, 1, 2, 3))):
        table = rng.choice([tables, *(one for one in tables.values() if isinstance(one, dict))])
        if not table:
            continue
        key = rng.choice(list(table))
        change = rng.randrange(5)
        if change == 0:
            del table[key]
        elif change == 1:
            table[key[:-1] + rng.choice("aes_")] = table.pop(key)
        elif change == 2:
            rng.choice(list(_tables(tables)))[key] = copy.deepcopy(table[key])
        elif change == 3:
            table[key] = rng.choice(({key: table[key]}, [table[key]], copy.deepcopy(tables)))
        else:
            table[rng.choice(("", "a b", "ä", "x" * 300, "-", "0", "name", "__class__"))] = (
                rng.choice(VALUES)
            )
    return tomli_w.dumps(tables).encode("utf-8", "surrogatepass")


def change_values(rng: Random, data: bytes) -> bytes:
    """One to four values of TOML replaced by hostile ones, or scaled by up to six decades."""
    tables = tomllib.loads(data.decode())
    for _ in range(rng.choice((1, 1, 2, 4))):
        table = rng.choice([one for one in _tables(tables) if one])
        key = rng.choice(list(table))
        number = isinstance(table[key], int | float) and not isinstance(table[key], bool)
        factor = 10.0 ** rng.uniform(-6, 6)
        table[key] = table[key] * factor if number and rng.random() < 0.5 else rng.choice(VALUES)
    return tomli_w.dumps(tables).encode()


def _tables(tables: dict[str, Any]) -> list[dict[str, Any]]:
    return [tables, *(one for one in tables.values() if isinstance(one, dict))]


def change_dump_rows(rng: Random, data: bytes) -> bytes:
    """Rows of a dump dropped, doubled or exchanged, or a value or a separator replaced."""
    lines = data.split(b"\n")
    rows = [at for at, line in enumerate(lines) if line[:1].isdigit() and line.count(b" ") > 3]
    for _ in range(rng.choice((1, 1, 2, 4))):
        at = rng.choice(rows) % len(lines)
        parts = lines[at].split(b" ")
        change = rng.randrange(6)
        if change == 0:
            del lines[at]
        elif change == 1:
            lines.insert(at, lines[at])
        elif change == 2:
            other = rng.choice(rows) % len(lines)
            lines[at], lines[other] = lines[other], lines[at]
        elif change == 3:
            lines[at] = rng.choice((b"  ", b"\t", b",", b" \r")).join(parts)
        else:
            parts[rng.randrange(len(parts))] = rng.choice(NUMBERS).encode()
            lines[at] = b" ".join(parts)
    return b"\n".join(lines)


def change_dump_headers(rng: Random, data: bytes) -> bytes:
    """A line of a dump's headers replaced, dropped, doubled, or given hostile numbers."""
    lines = data.split(b"\n")
    heads = [
        at for at, line in enumerate(lines) if line.startswith(b"ITEM") or line.count(b" ") < 3
    ]
    for _ in range(rng.choice((1, 1, 2))):
        at = rng.choice(heads) % len(lines)
        change = rng.randrange(5)
        if change == 0:
            del lines[at]
        elif change == 1:
            lines.insert(at, lines[at])
        elif change == 2:
            lines[at] = rng.choice(NUMBERS).encode()
        elif change == 3:
            parts = lines[at].split(b" ")
            parts[rng.randrange(len(parts))] = rng.choice(
                (rng.choice(NUMBERS).encode(), b"id", b"ITEM:")
            )
            lines[at] = b" ".join(parts)
        else:
            lines[at] = lines[rng.choice(heads) % len(lines)]
    return b"\n".join(lines)


def change_sphere_rows(rng: Random, data: bytes) -> bytes:
    """Rows of a sphere table dropped or doubled, a cell or the header's names replaced."""
    lines = data.decode().splitlines()
    for _ in range(rng.choice((1, 1, 2, 4))):
        at = rng.randrange(len(lines))
        cells = lines[at].split(",")
        change = rng.randrange(5)
        if change == 0:
            del lines[at]
        elif change == 1:
            lines.insert(at, lines[at])
        elif change == 2:
            lines[at] = rng.choice((";", "\t", ",,", ", ")).join(cells)
        else:
            cells[rng.randrange(len(cells))] = rng.choice(
                (*NUMBERS, "x", "radius", "kind", "fine", "grain", "x_m")
            )
            lines[at] = ",".join(cells)
    return "\n".join(lines).encode()


def change_geometry(rng: Random, data: bytes) -> bytes:
    """Spheres moved together, far away, into a plane, a line or a lattice, or given another size
    or kind."""
    head, *lines = data.decode().splitlines()
    cells = [line.split(",") for line in lines]
    rows: list[list[Any]] = [[*map(float, one[:4]), one[4]] for one in cells]
    for _ in range(rng.choice((1, 1, 2, 3))):
        some = rng.sample(rows, rng.choice((1, 2, len(rows) // 2, len(rows))))
        axis, factor = rng.randrange(3), 10.0 ** rng.uniform(-8, 8)
        change = rng.randrange(8)
        for row in some:
            if change == 0:
                row[:3] = some[0][:3]
            elif change == 1:
                row[axis] = some[0][axis] * rng.choice((1.0, 1.0 + 1e-12))
            elif change == 2:
                row[:3] = [factor * cell for cell in row[:3]]
            elif change == 3:
                row[3] *= factor
            elif change == 4:
                row[:3] = [float(round(cell)) for cell in row[:3]]
            elif change == 5:
                row[axis] += factor
            elif change == 6:
                row[4] = rng.choice(("fine", "grain"))
            else:
                row[3] *= rng.uniform(0.3, 3.0)
    return "\n".join([head, *(",".join(map(str, row)) for row in rows)]).encode()


CASE: dict[str, Mutation] = {
    "bytes": change_bytes,
    "structure": change_structure,
    "values": change_values,
}
DUMP: dict[str, Mutation] = {
    "bytes": change_bytes,
    "rows": change_dump_rows,
    "headers": change_dump_headers,
}
SPHERES: dict[str, Mutation] = {
    "bytes": change_bytes,
    "rows": change_sphere_rows,
    "geometry": change_geometry,
}
