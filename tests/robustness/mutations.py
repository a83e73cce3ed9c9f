"""Broken case files, dumps and sphere tables, made from good ones by a random generator."""

import tomllib
from collections.abc import Callable
from random import Random
from typing import Any

import tomli_w

from fdnet.spheres.dump import COLUMNS

Mutation = Callable[[Random, bytes], bytes]
EDGE = 4.0
"""Edge of the box of the small packs."""
VALUES: tuple[Any, ...] = (
    *(0, -1, 1, 2, -0.0, 1e-300, 5e-324, 1e-9, 1e3, 1e15, 1e16, 1e308),
    *map(float, ("inf", "-inf", "nan")),
    *(2**31, 2**63, -(2**63), 10**30, True, False, "", "walls", "1.0", "\u00b5\n\x00", [], [1.0]),
    *([1.0, 2.0], [0.3, 0.2], [1.0, 1.0, 1.0], [[1.0]], {}, {"a": 1}, [0.1] * 20),
)
NUMBERS = (
    *("nan", "inf", "-inf", "NaN", "1e400", "-1e400", "1e-400", "0", "-0", "-1", "0x10", "1_0"),
    *("abc", "1,5", "1e308", "1e-300", "1e12", "1e-12", "+5", "7.", "٣", "--1", "1e", "∞"),
    *("none", "true", "", " 7", '"', "9" * 400),
)
BYTES = (
    *(b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\r", b"\r\n", b"\n\n", b"\t", b" ", b"#", b'"'),
    *(b"=", b"[", b",", b"-"),
)


def change_bytes(rng: Random, data: bytes) -> bytes:
    """One to eight bytes or stretches flipped, put in, cut out, doubled, or the end cut off."""
    for _ in range(rng.choice((1, 1, 1, 2, 4, 8))):
        at, length = rng.randrange(len(data) + 1), rng.choice((1, 1, 2, 5, 40))
        own = (b"", bytes([rng.randrange(256)]), rng.choice(BYTES), data[at : at + length] * 2)
        rest = b"" if rng.random() < 0.1 else data[at + rng.choice((0, length)) :]
        data = data[:at] + rng.choice(own) + rest
    return data


def _tables(tables: dict[str, Any]) -> list[dict[str, Any]]:
    every = [tables, *(one for one in tables.values() if isinstance(one, dict))]
    return [one for one in every if one] or [tables]


def change_structure(rng: Random, data: bytes) -> bytes:
    """Tables and keys of TOML dropped, renamed, copied, nested or given another kind of value."""
    tables = tomllib.loads(data.decode())
    for _ in range(rng.choice((1, 1, 2, 3))):
        table = rng.choice(_tables(tables))
        if not table:
            continue
        key, change = rng.choice(list(table)), rng.randrange(5)
        if change == 0:
            del table[key]
        elif change == 1:
            table[key[:-1] + rng.choice("aes_")] = table.pop(key)
        elif change == 2:
            rng.choice(_tables(tables))[key] = _copy(table[key])
        elif change == 3:
            table[key] = rng.choice(({key: table[key]}, [table[key]], _copy(tables)))
        else:
            strange = ("", "a b", "ä", "x" * 300, "-", "0", "name", "__class__")
            table[rng.choice(strange)] = rng.choice(VALUES)
    return tomli_w.dumps(tables).encode("utf-8", "surrogatepass")


def _copy(value: Any) -> Any:
    return tomllib.loads(tomli_w.dumps({"a": value}))["a"]


def change_values(rng: Random, data: bytes) -> bytes:
    """One to four values of TOML replaced by hostile ones, or scaled by up to six decades."""
    tables = tomllib.loads(data.decode())
    for _ in range(rng.choice((1, 1, 2, 4))):
        table = rng.choice(_tables(tables))
        key = rng.choice(list(table))
        scales = type(table[key]) in (int, float) and rng.random() < 0.5
        table[key] = table[key] * 10.0 ** rng.uniform(-6, 6) if scales else rng.choice(VALUES)
    return tomli_w.dumps(tables).encode()


def _change_lines(
    rng: Random, lines: list[str], which: list[int], names: str, between: str
) -> str:
    """Some lines dropped, doubled, exchanged, or a cell or a separator of them replaced."""
    for _ in range(rng.choice((1, 1, 2, 4))):
        at, other = (rng.choice(which) % len(lines) for _ in "ab")
        cells, change = lines[at].split(between), rng.randrange(6)
        if change == 0:
            del lines[at]
        elif change == 1:
            lines.insert(at, lines[at])
        elif change == 2:
            lines[at], lines[other] = lines[other], lines[at]
        elif change == 3:
            lines[at] = rng.choice((";", "\t", ",,", ", ", "  ", " \r")).join(cells)
        else:
            cells[rng.randrange(len(cells))] = rng.choice((*NUMBERS, *names.split()))
            lines[at] = between.join(cells)
    return "\n".join(lines)


def change_dump_rows(rng: Random, data: bytes) -> bytes:
    """Rows of a dump."""
    lines = data.decode().split("\n")
    rows = [at for at, line in enumerate(lines) if line[:1].isdigit() and line.count(" ") > 3]
    return _change_lines(rng, lines, rows, "0", " ").encode()


def change_dump_headers(rng: Random, data: bytes) -> bytes:
    """Lines of a dump's headers."""
    lines = data.decode().split("\n")
    heads = [at for at, one in enumerate(lines) if one.startswith("ITEM") or one.count(" ") < 3]
    return _change_lines(rng, lines, heads, "id ITEM:", " ").encode()


def change_sphere_rows(rng: Random, data: bytes) -> bytes:
    """Rows of a sphere table, its header among them."""
    lines = data.decode().splitlines()
    names = "x radius kind fine grain x_m"
    return _change_lines(rng, lines, list(range(len(lines))), names, ",").encode()


def change_geometry(rng: Random, data: bytes) -> bytes:
    """Spheres moved together, far away, into a plane or a lattice, of another size or kind."""
    head, *lines = data.decode().splitlines()
    cells = [line.split(",") for line in lines]
    rows: list[list[Any]] = [[*map(float, one[:4]), one[4]] for one in cells]
    for _ in range(rng.choice((1, 1, 2, 3))):
        some = rng.sample(rows, rng.choice((1, 2, len(rows) // 2, len(rows))))
        axis, factor, change = rng.randrange(3), 10.0 ** rng.uniform(-8, 8), rng.randrange(8)
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


def small_dump(rng: Random, frames: int) -> bytes:
    """A dump of eight spheres."""
    text = ""
    for step in range(frames):
        text += f"ITEM: TIMESTEP\n{100 * step}\nITEM: NUMBER OF ATOMS\n8\n"
        text += "ITEM: BOX BOUNDS ff ff ff\n-0.001 0.003\n0 0.0016\n0 0.0016\n"
        text += f"ITEM: ATOMS {COLUMNS} \n"
        for number in range(1, 9):
            cells = " ".join(repr(rng.gauss(0, 1e-3)) for _ in range(7))
            text += f"{number} 2 {cells} \n"
    return text.encode()


def small_pack(rng: Random, fines: int) -> bytes:
    """A table of 27 grains near a lattice, and some fines."""
    places = [(n // 9 + 0.5, n // 3 % 3 + 0.5, n % 3 + 0.5) for n in range(27)]
    rows = [
        [
            *(EDGE / 3 * x + rng.uniform(-0.25, 0.25) for x in place),
            rng.uniform(0.5, 0.65),
            "grain",
        ]
        for place in places
    ]
    rows += [[*(rng.uniform(0, EDGE) for _ in range(3)), 0.1, "fine"] for _ in range(fines)]
    return "\n".join(["x,y,z,radius,kind", *(",".join(map(str, row)) for row in rows)]).encode()
