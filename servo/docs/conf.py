"""Settings of Sphinx for the documentation, which is built from the manuals in the repository.

Build it with `sphinx-build -c servo/docs . OUT`: the source folder is the repository, so that links
and pictures between manuals work as they do in a checkout.
"""

import sys
from importlib.metadata import version as installed
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # where `formulas` and `pages` are

project = "servobench"
author = "The servobench developers"
release = installed("servobench")
root_doc = "servo/docs/index"
include_patterns = [
    "*.md",
    "scenes/*.md",
    "scenes/benchmarks/*.md",
    "servo/**.md",
    "tests/benchmarks/README.md",
    "tracking/*.md",
]
exclude_patterns = [".*", "runs", "dist", "servo/cli/templates", "servo/docs/paper.md"]
extensions = [
    "formulas",
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "pages",
    "sphinx_click",
    "sphinx_copybutton",
]
html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"
html_title = "servobench"
html_show_copyright = False
html_show_sourcelink = False
myst_fence_as_directive = ["math"]  # as GitHub writes formulas
myst_heading_anchors = 4
myst_enable_extensions = ["html_image"]  # a picture with a width, as on GitHub
autodoc_member_order = "groupwise"
autodoc_typehints = "description"
copybutton_exclude = ".linenos, .gp, .go"
