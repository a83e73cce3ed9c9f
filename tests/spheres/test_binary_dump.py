import struct

import numpy as np
import pytest

from fdnet.dem.liggghts import Launch, run_deck
from fdnet.errors import DumpError
from fdnet.spheres.dump import read_binary_frame, read_frame

COLUMNS = ("id", "x", "radius")
ROWS = np.array([[3.0, 0.1, 1e-5], [1.0, 0.2, 2e-5], [2.0, -0.3, 3e-5]])
BOX = (0.0, 1.0, 0.0, 2.0, -1.0, 3.0)
SHOWN, FORM = "id type x y z vx vy vz radius", "%d %d" + 7 * " %.17g"
DECK = """
units si
atom_style granular
atom_modify map array
boundary f f f
newton off
communicate single vel yes
region box block 0 1 0 1 0 1 units box
create_box 1 box
{create}
set group all diameter 0.02
set group all density 2500
variable speed atom sin(37*x+y+z*z)
velocity all set v_speed 0.0 v_speed units box
neighbor 0.001 bin
fix m1 all property/global kn peratomtypepair 1 1e4
fix m2 all property/global kt peratomtypepair 1 1e4
fix m3 all property/global gamman peratomtypepair 1 0
fix m4 all property/global gammat peratomtypepair 1 0
fix m5 all property/global coefficientFriction peratomtypepair 1 0
pair_style gran model hooke/stiffness tangential history
pair_coeff * *
timestep 1e-6
fix integ all nve/sphere
run 3
write_dump all custom a.dump {shown} modify format "{form}"
write_dump all custom a.bin {shown}
print "DECK_DONE"
"""


def dump_of(blocks, *, columns=3, slanted=0, count=None):
    """The bytes of a dump whose rows lie in such blocks, as DumpCustom::header_binary says."""
    rows = sum(len(block) for block in blocks) if count is None else count
    data = struct.pack("<qqi6i6dii", 7, rows, slanted, *[1] * 6, *BOX, columns, len(blocks))
    for block in blocks:
        data += struct.pack("<i", block.size) + block.astype("<f8").tobytes()
    return data


@pytest.fixture
def read(tmp_path):
    def frame_of(data):
        (tmp_path / "a.bin").write_bytes(data)
        return read_binary_frame(tmp_path / "a.bin", COLUMNS)

    return frame_of


@pytest.mark.parametrize("blocks", [[ROWS], [ROWS[:1], ROWS[1:]], [ROWS, ROWS[:0]]])
def test_rows_of_all_ranks_come_sorted_by_id(read, blocks):
    frame = read(dump_of(blocks))
    assert (frame.step, frame.columns) == (7, COLUMNS)
    assert np.array_equal(frame.box, np.reshape(BOX, (3, 2)))
    assert np.array_equal(frame.rows, ROWS[[1, 2, 0]])


def test_a_dump_may_hold_no_sphere(read):
    assert read(dump_of([ROWS[:0]])).rows.shape == (0, 3)


def test_a_file_that_was_cut_anywhere_is_refused(read):
    whole = dump_of([ROWS[:2], ROWS[2:]])
    for length in range(len(whole)):
        with pytest.raises(DumpError, match="The run was cut"):
            read(whole[:length])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (dump_of([ROWS]) + b"more", "4 bytes follow the frame"),
        (dump_of([ROWS], count=2), "9 values, expected 3 for each of 2 atoms"),
        (dump_of([ROWS], columns=4), "4 columns of 3 atoms"),
        (dump_of([ROWS], slanted=1), "slanted box 1; expected"),
        (dump_of([ROWS], count=-1), "-1 atoms"),
        (dump_of([np.full((1, 3), np.nan)]), "a value is not finite"),
        (dump_of([ROWS])[:-76] + struct.pack("<i", -9), "a block of -9 values"),
    ],
)
def test_what_is_no_whole_frame_is_refused(read, data, message):
    with pytest.raises(DumpError, match=message) as refused:
        read(data)
    assert "a.bin" in str(refused.value)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(DumpError, match=r"none\.bin: cannot be read"):
        read_binary_frame(tmp_path / "none.bin", COLUMNS)


@pytest.mark.liggghts
@pytest.mark.parametrize("ranks", [1, 2])
def test_the_binary_dump_of_liggghts_holds_what_its_text_holds(binary, tmp_path, ranks):
    places = np.random.default_rng(1).permutation(64)
    create = "\n".join(
        f"create_atoms 1 single {0.1 + 0.2 * (n % 4)} {0.1 + 0.2 * (n // 4 % 4)} "
        f"{0.1 + 0.2 * (n // 16)} units box"
        for n in places
    )
    (tmp_path / "in.dump").write_text(DECK.format(create=create, shown=SHOWN, form=FORM))
    run_deck(tmp_path, "in.dump", Launch(binary=binary, ranks=ranks))
    text = read_frame(tmp_path / "a.dump")
    frame = read_binary_frame(tmp_path / "a.bin", tuple(SHOWN.split()))
    assert np.all(frame.column("vx") != 0.0)
    assert np.array_equal(frame.rows, text.rows)
    assert (frame.step, frame.columns) == (text.step, text.columns)
    assert np.array_equal(frame.box, text.box)
