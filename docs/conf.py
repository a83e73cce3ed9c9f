"""Configuration of the documentation site: Sphinx, MyST Markdown, the pydata theme."""

import os
import sys
from importlib import metadata
from pathlib import Path

from sphinx.application import Sphinx

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "_ext"))

project = "fdnet"
author = "the fdnet developers"
copyright = "the fdnet developers"
release = version = metadata.version("fdnet")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "folder_links",
    "formulas",
    "shell_cells",
]
exclude_patterns = ["_build", "_ext", "**.ipynb_checkpoints"]
smartquotes_action = "D"  # dashes alone, quotation marks stay straight
nitpicky = True
nitpick_ignore_regex = [("py:class", r".*")]  # types in signatures, of ours and of others

smartquotes_action = "qe"  # no dashes: an option keeps its two hyphens
myst_heading_anchors = 4
myst_enable_extensions = ["attrs_block", "colon_fence", "deflist", "dollarmath"]

nb_execution_mode = os.environ.get("FDNET_DOCS_EXECUTE", "force")
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 300

autodoc_typehints = "description"
autodoc_typehints_description_target = "documented_params"
autodoc_class_signature = "separated"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = False
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True

copybutton_prompt_text = r"\$ "
copybutton_prompt_is_regexp = True
copybutton_exclude = ".linenos, .gp, .go"

html_math_renderer = "mathml"
html_theme = "pydata_sphinx_theme"
html_title = "fdnet"
html_static_path = ["_static"]
html_css_files = ["fdnet.css"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "logo": {"text": "fdnet"},
    "navbar_align": "left",
    "header_links_before_dropdown": 7,
    "show_nav_level": 2,
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "footer_start": ["copyright"],
    "footer_end": [],
}


def setup(app: Sphinx) -> None:
    """Leaves out how classes are constructed: their page names the function that makes one."""
    constructors = {"__init__", "__new__"}
    app.connect("autodoc-skip-member", lambda *of: True if of[2] in constructors else None)
