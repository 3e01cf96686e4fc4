"""Site: Sphinx with MyST Markdown, notebooks as text, and generated pages.

The mark ``<!-- generated: NAME -->`` of a page is replaced by text of :mod:`docs.making`. Notebooks
are executed unless ``PFSC_NOTEBOOKS=off``.
"""

import logging
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
# notebook kernels use the same code
os.environ["PYTHONPATH"] = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])

from docs.making.commands import command_line  # noqa: E402
from docs.making.gallery import gallery  # noqa: E402
from docs.making.interface import interface  # noqa: E402
from docs.making.recordings import copy_recordings  # noqa: E402
from docs.making.scenario_keys import scenario_keys  # noqa: E402
from pfsc_drake import __version__ as version  # noqa: E402

GENERATED: dict[str, Callable[[], str]] = {
    "scenario_keys": scenario_keys,
    "command_line": command_line,
    "interface": interface,
    "gallery": gallery,
}

project = "pfsc_drake"
author = "the pfsc_drake authors"
copyright = author
release = version
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_design",
    "sphinx-mathjax-offline",
]
exclude_patterns = ["making", "**/out", "**/.ipynb_checkpoints"]
default_role = "code"

myst_enable_extensions = [
    "amsmath",
    "attrs_block",
    "attrs_inline",
    "colon_fence",
    "deflist",
    "dollarmath",
]
myst_heading_anchors = 4
# cells that were not executed have no language
suppress_warnings = ["myst-nb.lexer"]
nb_execution_mode = "off" if os.environ.get("PFSC_NOTEBOOKS") == "off" else "cache"
nb_execution_cache_path = str(ROOT / "docs" / "tutorials" / "out" / "notebooks")
nb_execution_timeout = 900  # s, of a cell
nb_execution_raise_on_error = True
nb_merge_streams = True

autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autodoc_member_order = "bysource"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_custom_sections = [("Ports", "params_style")]
python_maximum_signature_line_length = 88

html_theme = "furo"
html_title = "pfsc_drake"
html_static_path = ["style"]
html_css_files = ["site.css"]
html_js_files = ["tables.js"]
html_copy_source = False
html_show_sourcelink = False


def _marker(name: str) -> str:
    return f"<!-- generated: {name} -->"


def _fill(app: Any, docname: str, source: list[str]) -> None:
    """Replace the marks of a page by generated text."""
    for name, generate in GENERATED.items():
        if _marker(name) in source[0]:
            source[0] = source[0].replace(_marker(name), generate())


def _generated_pages(app: Any, env: Any, *changes: set[str]) -> list[str]:
    """Return the pages with generated text, which every build reads again."""
    pages = {name: Path(env.doc2path(name)).read_text(encoding="utf-8") for name in env.found_docs}
    return [name for name, text in pages.items() if any(_marker(key) in text for key in GENERATED)]


def setup(app: Any) -> None:
    """Connect the generated text to the build."""
    # a chapter without pages is no error
    logging.getLogger("sphinx.sphinx.directives.other").addFilter(
        lambda record: "didn't match any documents" not in str(record.msg)
    )
    app.connect("source-read", _fill)
    app.connect("env-get-outdated", _generated_pages)
    app.connect("build-finished", copy_recordings)
