"""The documentation site: `sphinx-build -W -n docs docs/_build` (pip install '.[docs]'). It reads
no network, and neither do its pages.

Its reference pages are written by docs/write_reference.py beforehand; the gallery is made here.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

from symgen.version import VERSION

project = "symgen"
release = VERSION
copyright = "the symgen authors"
extensions = ["myst_parser", "mathml", "robot_pages", "llms"]
exclude_patterns = ["_build", "examples"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = f"symgen {VERSION}"
html_math_renderer = "mathml"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
pygments_style = "tango"
