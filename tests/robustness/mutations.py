"""Broken case files, dumps and sphere tables, made from good ones by a random generator."""

import tomllib
from collections.abc import Callable
from copy import deepcopy
from random import Random
from typing import Any

import tomli_w

Mutation = Callable[[Random, bytes], bytes]
EDGE = 4.0
"""Edge of the box of the small packs."""
VALUES: tuple[Any, ...] = (
    *(0, -1, 1, 2, -0.0, 1e-300, 5e-324, 1e-9, 1e3, 1e15, 1e16, 1e308),
    *map(float, ("inf", "-inf", "nan")),
    *(2**31, 2**63, -(2**63), 10**30, True, False, "", "walls", "1.0", "\u00b5\n\x00", [], [1.0]),
    *([1.0, 2.0], [0.3, 0.2], [1.0, 1.0, 1.0], [[1.0]], {}, {"a": 1}, [0.1] * 20),
)
KEYS = ("", "a b", "ä", "x" * 300, "-", "0", "name", "__class__")
CELLS = (
    *("nan", "inf", "-inf", "NaN", "1e400", "-1e400", "1e-400", "0", "-0", "-1", "0x10", "1_0"),
    *("abc", "1,5", "1e308", "1e-300", "1e12", "1e-12", "+5", "7.", "٣", "--1", "1e", "∞"),
    *("none", "true", "", " 7", '"', "9" * 400, "id", "ITEM:", "x", "radius", "kind", "fine"),
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


def change_tables(rng: Random, data: bytes) -> bytes:
    """Keys of TOML dropped, renamed, nested, or given a hostile value or one of other size."""
    tables = tomllib.loads(data.decode())
    for _ in range(rng.choice((1, 1, 2, 4))):
        table = rng.choice([tables, *(one for one in tables.values() if isinstance(one, dict))])
        if not table:
            continue
        key, change = rng.choice(list(table)), rng.randrange(6)
        value = table[key]
        if change == 0:
            del table[key]
        elif change == 1:
            table[key[:-1] + rng.choice("aes_")] = table.pop(key)
        elif change == 2:
            table[key] = rng.choice(({key: value}, [value], deepcopy(tables)))
        elif change == 3:
            table[rng.choice(KEYS)] = deepcopy(rng.choice(VALUES))
        elif change == 4 and type(value) in (int, float):
            table[key] = value * 10.0 ** rng.uniform(-6, 6)
        else:
            table[key] = deepcopy(rng.choice(VALUES))
    return tomli_w.dumps(tables).encode("utf-8", "surrogatepass")


def change_lines(rng: Random, data: bytes) -> bytes:
    """Lines of a table or dump dropped, doubled, exchanged, or with another cell or separator."""
    lines = data.decode().split("\n")
    for _ in range(rng.choice((1, 1, 2, 4))):
        at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
        between = "," if "," in lines[at] else " "
        cells, change = lines[at].split(between), rng.randrange(6)
        if change == 0 and len(lines) > 1:
            del lines[at]
        elif change == 1:
            lines.insert(at, lines[at])
        elif change == 2:
            lines[at], lines[other] = lines[other], lines[at]
        elif change == 3:
            lines[at] = rng.choice((";", "\t", ",,", ", ", "  ", " \r")).join(cells)
        else:
            cells[rng.randrange(len(cells))] = rng.choice(CELLS)
            lines[at] = between.join(cells)
    return "\n".join(lines).encode()


def change_geometry(rng: Random, data: bytes) -> bytes:
    """Spheres moved together, far away, into a plane or a lattice, of another size or kind."""
    head, *lines = data.decode().splitlines()
    cells = [line.split(",") for line in lines]
    rows: list[list[Any]] = [[*map(float, one[:4]), one[4]] for one in cells]
    for _ in range(rng.choice((1, 1, 2, 3))):
        axis, factor, change = rng.randrange(3), 10.0 ** rng.uniform(-8, 8), rng.randrange(7)
        some = rng.sample(rows, rng.choice((1, 2, len(rows) // 2, len(rows))))
        for row in some:
            row[:] = (
                [*some[0][:3], *row[3:]],
                [*row[:axis], some[0][axis] * rng.choice((1.0, 1.0 + 1e-12)), *row[axis + 1 :]],
                [*(factor * cell for cell in row[:3]), *row[3:]],
                [*(float(round(cell)) for cell in row[:3]), *row[3:]],
                [*row[:axis], row[axis] + factor, *row[axis + 1 :]],
                [*row[:3], row[3] * rng.choice((factor, rng.uniform(0.3, 3.0))), row[4]],
                [*row[:4], rng.choice(("fine", "grain"))],
            )[change]
    return "\n".join([head, *(",".join(map(str, row)) for row in rows)]).encode()


def small_pack(rng: Random, fines: int) -> bytes:
    """A table of 27 grains near a lattice, and some fines."""
    text = "x,y,z,radius,kind"
    for n in range(27):
        place = (n // 9 + 0.5, n // 3 % 3 + 0.5, n % 3 + 0.5)
        cells = [EDGE / 3 * x + rng.uniform(-0.25, 0.25) for x in place]
        text += "\n" + ",".join(map(str, [*cells, rng.uniform(0.5, 0.65), "grain"]))
    for _ in range(fines):
        text += "\n" + ",".join(str(rng.uniform(0, EDGE)) for _ in range(3)) + ",0.1,fine"
    return text.encode()
