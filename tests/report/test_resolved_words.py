"""Which sections are by resolved flow, in words."""

import pytest

from fdnet.report.resolved_words import resolved_words


def rows(initial, damaged):
    return [
        {
            "section": number,
            "k_initial_resolved": int(number in initial),
            "k_damaged_resolved": int(number in damaged),
        }
        for number in (1, 2, 3)
    ]


@pytest.mark.parametrize(
    ("initial", "damaged", "words"),
    [
        ((1, 2, 3), (1,), "sections 1, 2 and 3 without fines; section 1 with fines"),
        ((2,), (), "section 2 without fines"),
    ],
)
def test_the_sections_are_named(initial, damaged, words):
    start, end = "By resolved flow on coarse grids: ", ". The others are by the network."
    assert resolved_words(rows(initial, damaged)) == f"{start}{words}{end}"


def test_the_network_is_left_out_where_it_gave_nothing():
    words = resolved_words(rows((1, 2, 3), (1, 2, 3)))
    assert words.endswith("sections 1, 2 and 3 without fines; sections 1, 2 and 3 with fines.")


def test_nothing_is_said_where_all_are_by_the_network():
    assert resolved_words(rows((), ())) == ""
    assert resolved_words([{"section": 1}]) == ""  # a run of an earlier version
