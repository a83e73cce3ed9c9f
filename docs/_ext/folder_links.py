"""Links to folders of the project, which work where the pages are browsed in the repository.

A site of pages has nothing to show for a folder, so there the text of such a link stands alone.
"""

from pathlib import Path

from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.transforms.post_transforms import SphinxPostTransform


class FolderLinks(SphinxPostTransform):
    """Replace a link to a folder, not to a page of the same name, by its text."""

    default_priority = 8  # before MyST looks for the target, at 9

    def run(self, **_: object) -> None:
        folder = Path(self.env.doc2path(self.env.docname)).parent
        for node in list(self.document.findall(pending_xref)):
            page = node.get("refdomain") == "doc"
            if node["reftype"] == "myst" and not page and (folder / node["reftarget"]).is_dir():
                node.replace_self(node.children)


def setup(app: Sphinx) -> dict[str, bool]:
    """Make the transform known to Sphinx."""
    app.add_post_transform(FolderLinks)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
