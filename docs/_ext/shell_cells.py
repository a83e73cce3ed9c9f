"""Cells of a tutorial that start with `%%bash`: shown as what a reader types into a shell.

The output of a shell command reaches a notebook in pieces; they are joined before they are shown.
"""

from functools import partialmethod

from docutils import nodes
from nbclient import NotebookClient
from sphinx.application import Sphinx
from sphinx.transforms.post_transforms import SphinxPostTransform

MARK = "%%bash\n"


class ShellCells(SphinxPostTransform):
    """Drop the line that hands a cell to the shell, and highlight what follows as shell."""

    default_priority = 100

    def run(self, **_: object) -> None:
        for block in self.document.findall(nodes.literal_block):
            text = block.astext()
            if text.startswith(MARK):
                shown = nodes.Text(text.removeprefix(MARK))
                block.children = []
                block += shown
                block.rawsource = shown.astext()
                block["language"] = "bash"


def setup(app: Sphinx) -> dict[str, bool]:
    """Make the transform known to Sphinx, and have pieces of output joined."""
    initialise = partialmethod(NotebookClient.__init__, coalesce_streams=True)
    NotebookClient.__init__ = initialise  # type: ignore[method-assign]
    app.add_post_transform(ShellCells)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
