"""Sphere tables: nothing is lost by writing, nothing wrong gets in by reading."""

import numpy as np
import pytest
from report_demo import demo_damaged, snapshot_of

from fdnet.errors import CaseError
from fdnet.spheres.readers import read_csv, write_spheres
from fdnet.spheres.snapshot import Kind


def columns(path, **units):
    """Position, radius and kind; without a column kind all are grains."""
    rows = read_csv(path, **units)
    kind = np.full(len(rows.radius), Kind.GRAIN) if rows.kind is None else rows.kind
    return rows.position, rows.radius, kind


def csv_of(folder, text, *, encoding="utf-8"):
    path = folder / "in.csv"
    path.write_bytes(text.encode(encoding))
    return path


def test_a_written_table_reads_back_to_the_same_doubles(tmp_path):
    snapshot = demo_damaged()
    position, radius, kind = columns(write_spheres(tmp_path / "s.csv", snapshot))
    assert np.array_equal(position, snapshot.position)
    assert np.array_equal(radius, snapshot.radius)
    assert np.array_equal(kind, snapshot.kind)


def test_spheres_just_off_a_section_edge_stay_on_their_side(tmp_path):
    edge = 0.003
    depth = np.array([np.nextafter(edge, 0), edge, np.nextafter(edge, 1), -5e-324, 0.0])
    fines = snapshot_of(np.column_stack([depth, depth * 0, depth * 0]), 1e-5, Kind.FINE)
    position, _, _ = columns(write_spheres(tmp_path / "s.csv", fines))
    assert (position[:, 0] >= edge).tolist() == [False, True, True, False, False]
    assert (position[:, 0] >= 0).tolist() == [True, True, True, False, True]


@pytest.mark.parametrize(
    ("units", "metres"), [("m", 1.0), ("cm", 0.01), ("mm", 0.001), ("um", 1e-6)]
)
def test_plain_columns_are_in_the_given_unit(tmp_path, units, metres):
    path = csv_of(tmp_path, "x,y,z,radius\n1,2,-3,4e0\n")
    position, radius, kind = columns(path, units=units)
    assert position[0] == pytest.approx([metres, 2 * metres, -3 * metres], rel=1e-15)
    assert radius[0] == pytest.approx(4 * metres, rel=1e-15)
    assert kind.tolist() == [Kind.GRAIN]


def test_comments_blank_lines_bom_crlf_quotes_and_column_order_are_fine(tmp_path):
    path = csv_of(
        tmp_path,
        '\ufeff# pack\r\n\r\n"kind", radius_m ,z_m,y_m,x_m\r\n# more\r\n'
        '"fine",4,3,2,1\r\n grain,8,7,6,5',
    )
    position, radius, kind = columns(path)
    assert position.tolist() == [[1, 2, 3], [5, 6, 7]]
    assert radius.tolist() == [4, 8]
    assert kind.tolist() == [Kind.FINE, Kind.GRAIN]


HEADER = "x,y,z,radius,kind\n"
GOOD = "1,2,3,1,grain\n"
BROKEN = {
    "nan": (HEADER + GOOD + "1,nan,3,1,grain\n", ":3: y is 'nan', expected a finite number"),
    "infinite": (HEADER + "1e999,2,3,1,grain\n", ":2: x is '1e999'"),
    "text": ("# c\n\n" + HEADER + GOOD + "1,2,zwei,1,grain\n", ":5: z is 'zwei'"),
    "empty value": (HEADER + "1,2,,1,grain\n", ":2: z is ''"),
    "python's underscore": (HEADER + "1_0,2,3,1,grain\n", ":2: x is '1_0'"),
    "negative radius": (
        HEADER + "1,2,3,-0.5,fine\n",
        ":2: radius is -0.5, expected a number above 0",
    ),
    "zero radius": (HEADER + "1,2,3,0,fine\n", ":2: radius is 0, expected"),
    "unknown kind": (HEADER + "1,2,3,1,sand\n", ":2: kind is 'sand', expected grain or fine"),
    "short row": (HEADER + GOOD + "1,2,3,1\n", ":3: 4 values, expected 5"),
    "long row": (HEADER + "1,2,3,1,grain,9\n", ":2: 6 values, expected 5"),
    "missing column": ("x,y,radius\n1,2,3\n", ":1: no column z"),
    "misspelt column": (
        "x,y,z,radiu\n",
        ":1: no column radius among 'x,y,z,radiu' (is 'radiu' meant?)",
    ),
    "column twice": ("x,y,z,radius,x\n", ":1: column 'x' occurs twice"),
    "two unit systems": ("x_m,y,z,radius\n", ":1: its columns are in different units (m, none)"),
    "no header": ("1,2,3,4,5\n", ":1: no header above 5 columns of numbers"),
    "a comment on diameters": ("# diameters\n1,2,3,4\n", ":2: no header above 4 columns"),
    "mixed separators": ("x;y;z;radius\n1;2,3,4\n", ":2: 2 values, expected 4"),
    "two radii": (
        "x,y,z,radius,diameter\n1,2,3,1,2\n1,2,3,1,3\n",
        ":3: diameter is 3, expected what radius says",
    ),
    "parts of no box": ("xs,ys,zs,radius\n0,0,0,1\n", ":1: no column x, y, z among"),
    "an unknown unit": ("x_nm,y_nm,z_nm,radius_nm\n0,0,0,1\n", ":1: no column x, y, z, radius"),
    "empty file": ("", "the file is empty"),
    "comments only": ("# a\n# b\n", "the file is empty"),
    "header only": (HEADER, "no spheres after the header"),
    "open quote": (HEADER + '"1,2,3,1,grain\n', ":2: unexpected end of data"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_every_malformed_table_is_refused_with_file_and_line(tmp_path, name):
    text, message = BROKEN[name]
    path = csv_of(tmp_path, text)
    with pytest.raises(CaseError) as caught:
        read_csv(path, units="mm")
    assert str(caught.value).startswith(str(path))
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("header", "units", "message"),
    [
        ("x_m,y_m,z_m,radius_m", "mm", "is in m; leave out"),
        ("x,y,z,radius", None, "give --units"),
        ("x,y,z,radius", "inch", "units 'inch': expected one of m, cm, mm, um"),
    ],
)
def test_units_are_given_exactly_when_the_columns_have_none(tmp_path, header, units, message):
    path = csv_of(tmp_path, header + "\n1,2,3,4\n")
    with pytest.raises(CaseError, match=message):
        read_csv(path, units=units)


def test_what_is_no_text_file_is_refused(tmp_path):
    with pytest.raises(CaseError, match="No such file"):
        read_csv(tmp_path / "none.csv", units="m")
    with pytest.raises(CaseError, match="irectory"):
        read_csv(tmp_path, units="m")
    with pytest.raises(CaseError, match="radius is '4 µm'"):
        read_csv(csv_of(tmp_path, "x,y,z,radius\n1,2,3,4 µm", encoding="latin-1"), units="m")
