"""A table of Markdown cells as docutils nodes, for the directives of this folder."""

from collections.abc import Sequence

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.util.docutils import SphinxDirective


def markdown(directive: SphinxDirective, text: str) -> list[nodes.Node]:
    """The nodes of a piece of Markdown."""
    holder = nodes.Element()
    directive.state.nested_parse(StringList(text.splitlines()), 0, holder)
    return holder.children


def table(
    directive: SphinxDirective,
    header: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    widths: Sequence[int],
    names: Sequence[str] = (),
) -> nodes.table:
    """A table; `widths` are shares of the page, `names` (one a row) become link targets."""
    group = nodes.tgroup(cols=len(header))
    group += [nodes.colspec(colwidth=width) for width in widths]
    group += nodes.thead("", _row(directive, header))
    body = nodes.tbody()
    for number, cells in enumerate(rows):
        row = _row(directive, cells)
        if names:
            row["ids"].append(names[number])
        body += row
    group += body
    return nodes.table("", group, classes=["reference-table"])


def _row(directive: SphinxDirective, cells: Sequence[str]) -> nodes.row:
    row = nodes.row()
    for cell in cells:
        row += nodes.entry("", *markdown(directive, cell))
    return row
