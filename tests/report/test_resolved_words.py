"""Which permeabilities are by resolved flow, in words."""

import pytest

from fdnet.report.resolved_words import resolved_words, run_flags


def rows(initial, damaged, count=3):
    return [
        {
            "section": number,
            "k_initial_resolved": int(number in initial),
            "k_damaged_resolved": int(number in damaged),
        }
        for number in range(1, count + 1)
    ]


@pytest.mark.parametrize(
    ("initial", "damaged", "words"),
    [
        (
            (1, 2, 3),
            (1,),
            "of sections 1, 2 and 3 without fines and of section 1 with fines",
        ),
        ((2,), (), "of section 2 without fines"),
    ],
)
def test_the_sections_are_named(initial, damaged, words):
    assert (
        resolved_words(rows(initial, damaged))
        == f"By resolved flow on coarse grids: the permeability {words}."
    )


def test_one_section_alone_is_not_numbered():
    words = resolved_words(rows((1,), (1,), 1))
    assert words.endswith("coarse grids: the permeability without fines and with fines.")


def test_nothing_is_said_where_all_are_by_the_network():
    assert resolved_words(rows((), ())) == ""
    assert resolved_words([{"section": 1}]) == ""  # a run of an earlier version


def test_a_row_of_fdnet_stokes_says_what_the_run_took():
    row = {"section": 2, "network_k_initial_resolved": 1, "network_k_damaged_resolved": 0}
    assert run_flags(row) == rows((2,), ())[1]
