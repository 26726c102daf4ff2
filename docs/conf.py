"""The documentation site: `sphinx-build -W -n docs docs/_build` (pip install '.[docs]'). It reads no network, and neither do its pages."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

from symgen.version import VERSION

project = "symgen"
release = VERSION
copyright = "the symgen authors"
extensions = ["myst_parser", "sphinx.ext.autodoc", "mathml", "plain_docstrings", "generated", "robot_pages"]
exclude_patterns = ["_build"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = f"symgen {VERSION}"
html_math_renderer = "mathml"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
pygments_style = "tango"
nitpick_ignore_regex = [  # types in signatures: of other packages, and short names of our own that an annotation does not resolve
    ("py:(class|obj|data|exc)", r"(?!symgen\.|runtime\.).*"),
    ("py:(class|obj|data)", r".*\.([A-Z]|Array|Estimator|LoopRows)$"),
]
suppress_warnings = ["ref.python"]  # an unresolved short name of a type that two modules have
