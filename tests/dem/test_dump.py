"""The dump parser: what it reads exactly, and every way a file can be broken."""

import re
from pathlib import Path

import pytest

from fdnet.errors import DumpError
from fdnet.spheres.dump import parse_dump, read_dump, read_frame


def frame(step: int, rows: list[str], count: int | None = None) -> str:
    count = len(rows) if count is None else count
    head = f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n{count}\nITEM: BOX BOUNDS ff ff ff\n"
    head += "-1 1\n0 2\n0 3\nITEM: ATOMS id type x \n"
    return head + "".join(row + "\n" for row in rows)


def parse(text: str) -> list:
    return list(parse_dump(text.encode(), "d.dump"))


def test_full_precision_any_order_and_several_frames():
    text = frame(5, ["2 1 0.12345678901234568 ", "1 2 -3e-9 "]) + frame(10, ["1 2 7 "])
    first, second = parse(text)
    assert (first.step, second.step) == (5, 10)
    assert first.column("id").tolist() == [1, 2]
    assert first.column("x").tolist() == [-3e-9, 0.12345678901234568]
    assert first.box.tolist() == [[-1, 1], [0, 2], [0, 3]]
    assert not first.rows.flags.writeable
    assert parse(frame(0, ["1 1 0.5", "2 1 0.25"]))[0].column("x").tolist() == [0.5, 0.25]
    assert parse(frame(0, []))[0].rows.shape == (0, 3)


def test_a_dump_cut_anywhere_is_refused_or_ends_between_two_frames():
    whole = frame(5, ["1 2 -3e-9 ", "2 1 0.12345678901234568 "]) + frame(10, ["1 2 7 "])
    for length in range(1, len(whole)):
        if whole[length:].startswith("ITEM: TIMESTEP"):
            assert len(parse(whole[:length])) == 1
        else:
            with pytest.raises(DumpError):
                parse(whole[:length])


def test_broken_files_are_named_by_line_and_step(tmp_path: Path):
    for text, message in (
        (frame(9, ["1 1 0.5 "], count=3), "d.dump:10: step 9: 1 of 3 rows, then the file ends"),
        (frame(9, ["1 1 0.5 ", "2 1 0."])[:-1], "rows, then the file ends"),
        (frame(0, ["1 1 0.5 "], count=2) + frame(1, []), "1 of 2 rows, then the next frame begin"),
        (frame(0, ["1 1 0.5 ", "2 1 "]), "d.dump:11: step 0: 2 values, expected 3"),
        (frame(0, ["1 1 0.5 ", "2 1 0.5 7 "]), "4 values, expected 3"),
        (frame(0, ["1 1 nan "]), "column x holds 'nan', expected a finite number"),
        (frame(0, ["1 1 0.5 ", "2 1 -inf "]), "d.dump:11: step 0: column x holds '-inf'"),
        *((frame(0, [f"1 1 {x} "]), f"column x holds '{x}'") for x in ("abc", "1e400", "1_0")),
        ("ITEM: TIMESTEP\n12\nITEM: NUMBER OF", "the file ends in the middle of a line"),
        ("ITEM: TIMESTEP\n12\n", "the file ends before ITEM: NUMBER OF ATOMS"),
        ("ITEM: TIMESTEP\nx\nITEM: NUMBER OF ATOMS\n", "step is 'x'"),
        ("hello\n", "'hello', expected 'ITEM: TIMESTEP'"),
        *(
            (frame(0, ["1 1 1 "]).replace("0 2", two), f"d.dump:7: .*bounds '{two}', expected two")
            for two in ("0", "nan nan", "0 inf", "1 0", "0 0", "0 1 2")
        ),
        (frame(0, ["1 1 1 "], count=-4), "number of atoms is '-4'"),
    ):
        with pytest.raises(DumpError) as error:
            parse(text)
        assert re.search(message, str(error.value)), text
    with pytest.raises(DumpError, match="no column radius among id type x"):
        parse(frame(0, ["1 1 1 "]))[0].column("radius")
    with pytest.raises(DumpError, match="cannot be read"):
        read_dump(tmp_path / "none")
    (tmp_path / "d").write_text("")
    with pytest.raises(DumpError, match="0 frames, expected one"):
        read_frame(tmp_path / "d")
