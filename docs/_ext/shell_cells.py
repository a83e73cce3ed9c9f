"""Cells of a tutorial that start with `%%bash` are shown as what a reader types into a shell."""

from docutils import nodes
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
    """Make the transform known to Sphinx."""
    app.add_post_transform(ShellCells)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
