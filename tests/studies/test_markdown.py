"""Markdown of the pages: wrapped lines mean what the long ones meant."""

from validation.engine.markdown import bullets, wrapped


def test_paragraphs_and_items_are_wrapped_and_keep_their_indent():
    text = "- " + "word " * 8 + "\n\n" + "plain " * 6
    assert wrapped(text, 20) == (
        "- word word word\n  word word word\n  word word\n\nplain plain plain\nplain plain plain"
    )


def test_what_has_a_meaning_by_line_stays():
    title, table = "# A title that is longer than the width", "| a cell | another cell |"
    text = f"{title}\n\n{table}\n\n```\nlong code line\n```"
    assert wrapped(text, 12) == text


def test_links_and_code_are_not_broken_and_no_line_becomes_a_list():
    text = (
        "see [a long link](over/there.md) and `some code here` lubrication + kozeny - done "
        "`one` and some more words until `two` follows"
    )
    lines = wrapped(text, 24).split("\n")
    assert "[a long link](over/there.md)" in lines
    assert any("`some code here`" in line for line in lines)
    assert not any(line.startswith(("+ ", "- ")) for line in lines)
    assert max(map(len, lines)) == len("[a long link](over/there.md)")
    assert " ".join(lines) == text


def test_a_percent_sign_stays_with_its_number():
    """A line that begins with it would be a comment, which nobody sees."""
    text = "loses 33 to 36 % by three seeds, and 45 to 52 %."
    for width in range(12, 40):
        lines = wrapped(text, width).split("\n")
        assert not any(line.startswith("%") for line in lines)
        assert " ".join(lines) == text


def test_bullets_are_items():
    assert bullets(["a", "b"]) == "- a\n- b"
