"""How Sphinx builds these pages: ``make docs``, warnings as errors."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

HERE = Path(__file__).parent
PROJECT = tomllib.loads((HERE.parent / "pyproject.toml").read_text())["project"]

project = PROJECT["name"]
author = "the topoloc developers"
release = version = PROJECT["version"]

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build"]
myst_heading_anchors = 3

nitpicky = True
nitpick_ignore_regex = [
    ("py:.*", r"(abc|collections|enum|np|numpy|pathlib|threading|typing)\..*"),  # nothing is fetched to link to
    ("py:.*", r"tuple\[.*|ArrayLike|Depth|Figure|Floats|Image|IncrementalPCA|Ints|Pixels"),
    ("py:.*", "Kind|Preprocessing|Runtime|Weighting"),  # words that a setting may be
    ("py:.*", r".*\.(Hypotheses|Matches|MissingPCA|Reference|Scene|Shaped|Shot)"),  # of the inside
    ("py:.*", "MissingPCAConfig|BlockMatchingConfig"),  # both are there, by their full names
]

html_theme = "alabaster"  # comes with Sphinx, loads nothing from elsewhere, and reads well without JavaScript
html_theme_options = {
    "description": PROJECT["description"],
    "page_width": "80em",
    "body_max_width": "62em",
    "sidebar_width": "16em",
    "code_font_size": "0.76em",  # so that lines of 120 fit
}
html_copy_source = False
html_show_copyright = False

add_module_names = False
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_default_options = {"members": True}
# Names of array types are kept as they are written: what they stand for would hide what they mean.
autodoc_type_aliases = {name: name for name in ("ArrayLike", "Depth", "Floats", "Image", "Ints", "Pixels")}
autodoc_preserve_defaults = True
python_maximum_signature_line_length = 100
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False

CODE = re.compile(r"(``.*?``)|\|")
STANDS_FOR = re.compile(r"TypeAliasForwardRef\('(\w+)'\)")
SEVERAL = re.compile(r":?(ivar|param) (\w+(?:, \w+)+):")
LINK = re.compile(r"\[([^\]]*)\]\(([^)#\s]+)[^)]*\)")


def outside_links(app: Sphinx, name: str, source: list[str]) -> None:
    """Links to files of the repository that are no pages work on its web page; here they become the file's path."""
    page = Path(app.env.doc2path(name))
    if page.suffix != ".md":
        return

    def shown(link: re.Match[str]) -> str:
        text, target = link.group(1), (page.parent / link.group(2)).resolve()
        if "://" in link.group(2) or (target.is_relative_to(HERE) and not target.is_dir()):
            return link.group(0)
        path = target.relative_to(HERE.parent) if target.is_relative_to(HERE.parent) else target.name
        return f"`{path}`" if text.strip("`") in str(path) else f"{text} (`{path}`)"

    source[0] = LINK.sub(shown, source[0])


def plain_bars(app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    """Docstrings write a length as |x|; to Sphinx that would be the name of a substitution, outside of code."""
    lines[:] = [CODE.sub(lambda found: found.group(1) or "\\|", line) for line in lines]


def whole_sentences(app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    """Napoleon takes what stands before a colon in an attribute's first line for its type; not so after a comment."""
    if what in ("attribute", "data", "property"):
        lines[:0] = ["..", ""]


def one_by_one(app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    """Where several attributes or arguments are told of at once, each of them gets a line of its own."""
    told: list[str] = []
    for entry in "\n".join(lines).split("\n:"):
        names = SEVERAL.match(entry)
        each = [] if names is None else names.group(2).split(", ")
        told += [entry.replace(names.group(2), one, 1) for one in each] if names else [entry]
    lines[:] = "\n:".join(told).split("\n")


def plain_names(
    app: Sphinx, what: str, name: str, thing: object, options: object, signature: str | None, returned: str | None
) -> tuple[str | None, str | None]:
    """Autodoc shows what stands for the name of a type instead of the name where the type is one of several."""
    shown = (None if text is None else STANDS_FOR.sub(r"\1", text) for text in (signature, returned))
    return next(shown), next(shown)


def setup(app: Sphinx) -> None:
    """Sphinx calls this once."""
    app.connect("source-read", outside_links)
    app.connect("autodoc-process-signature", plain_names)
    app.connect("autodoc-process-docstring", plain_bars)
    app.connect("autodoc-process-docstring", whole_sentences, priority=400)  # before napoleon
    app.connect("autodoc-process-docstring", one_by_one, priority=600)  # after it
