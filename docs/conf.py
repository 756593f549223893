"""How Sphinx builds the manual: `make docs`, without the network."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "extensions"), str(HERE.parent)]

from members import documented_members  # noqa: E402 from this folder

from asperity import __version__  # noqa: E402 from this folder, whatever is installed

project = "Asperity"
author = "the Asperity developers"
release = version = __version__
extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_gallery.gen_gallery",
    "mathml",
    "pictures",
    "results",
    "link_check",
]
templates_path = ["templates"]
exclude_patterns = [
    "_build",
    "extensions",
    "templates",
    "gallery/*.ipynb",
    "gallery/*.py",
    "gallery/*.json",
    "**sg_execution_times*",
]
nitpicky = False
highlight_language = "console"

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4

autosummary_generate = True
autosummary_context = {"documented": documented_members(HERE / "api")}
autodoc_typehints = "none"  # docstrings name types in words
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
numpydoc_validation_checks = {
    *("GL06", "GL07", "PR01", "PR02", "PR03", "PR04", "PR07", "PR10", "RT01", "RT03"),
}
numpydoc_validation_overrides = {
    "PR01": [r"(?m)^Attributes$"],  # fields of classes are described there, once
}
numpydoc_validation_exclude = {  # inherited from Python and pydantic
    r"\.(add_note|with_traceback)$",
    r"\.Body\.__init__$",
    r"\.Reader\.(callback|close|enter_context|pop_all|push)$",
    r"\.Scene(\.(__init__|model_\w+|copy|dict|json|construct|from_orm|parse_(file|obj|raw)))?$",
}

sphinx_gallery_conf = {
    "examples_dirs": "../examples/gallery",
    "gallery_dirs": "gallery",
    "filename_pattern": "/plot_",
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": False,
    "only_warn_on_example_error": False,
    "show_memory": False,
    "show_signature": False,
    "download_all_examples": False,
    "plot_gallery": True,
    "min_reported_time": 1,
    "remove_config_comments": True,
}

html_math_renderer = "mathml"
html_theme = "pydata_sphinx_theme"
html_title = "Asperity"
html_static_path = ["static"]
html_css_files = ["asperity.css"]
html_show_sourcelink = False
html_copy_source = False
ALONE = (
    "architecture",
    "changelog",
    "compatibility",
    "glossary",
    "install",
    "model",
    "references",
)
html_sidebars = {page: [] for page in ALONE}  # pages with none below or beside them
html_theme_options = {
    "navbar_end": ["theme-switcher"],
    "navbar_align": "left",
    "header_links_before_dropdown": 7,
    "show_nav_level": 1,
    "show_prev_next": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "default",
    "pygments_dark_style": "monokai",
}
html_context = {"default_mode": "auto"}
