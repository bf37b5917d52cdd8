"""Sphinx: the pages of `docs/` become the site that `make docs` builds and the service serves at `/help`.

Nothing is fetched, neither while it is built nor by a page: formulas are MathML, fonts are the reader's. No page holds
a script of its own: the service's Content-Security-Policy holds for the site too. Without scripts all but the search works.
"""

import re
from html import unescape
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

project = "Clutchlife"
author = "Clutchlife"
extensions = ["myst_parser"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["requirements.txt"]
myst_enable_extensions = ["deflist", "dollarmath"]
myst_heading_anchors = 4
html_theme = "furo"
html_title = "Clutchlife"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
html_math_renderer = "mathml"
html_theme_options = {"footer_icons": []}
nitpicky = True

#: A script within a page, and what stands there instead: the same as a file.
_INLINE = re.compile(r"<script>(.*?)</script>", flags=re.DOTALL)


def _formula(self: Any, node: nodes.math) -> None:
    self.body.append(tex2mathml(node.astext(), as_block=False))
    raise nodes.SkipNode


def _equation(self: Any, node: nodes.math_block) -> None:
    self.body.append(f'<div class="equation">{tex2mathml(node.astext(), as_block=True)}</div>')
    raise nodes.SkipNode


def _scripts_as_files(app: Sphinx, exception: Exception | None) -> None:
    """Move every inline script of every page into one file a distinct script."""
    if exception is not None or app.builder.name != "html":
        return
    top = Path(app.outdir)
    scripts: dict[str, str] = {}
    for page in top.rglob("*.html"):
        up = "../" * (len(page.relative_to(top).parts) - 1)

        def named(match: re.Match[str], up: str = up) -> str:
            name = scripts.setdefault(match[1].strip(), f"inline-{len(scripts)}.js")
            return f'<script src="{up}_static/{name}"></script>'

        page.write_text(_INLINE.sub(named, page.read_text(encoding="utf-8")), encoding="utf-8")
    for script, name in scripts.items():
        (top / "_static" / name).write_text(script, encoding="utf-8")


def _links_lead_somewhere(app: Sphinx, exception: Exception | None) -> None:
    """Every address within the site is a file of it, and every anchor a place in that file. Raises ExtensionError."""
    if exception is not None or app.builder.name != "html":
        return
    top = Path(app.outdir).resolve()
    pages = {path: path.read_text(encoding="utf-8") for path in top.rglob("*.html")}
    anchors = {path: set(re.findall(r'\bid="([^"]+)"', text)) for path, text in pages.items()}
    dead = []
    for path, text in pages.items():
        for address in set(re.findall(r'(?:href|src)="([^":]*)"', text)):
            name, _, anchor = unescape(address).partition("#")
            target = (path.parent / unquote(name.partition("?")[0])).resolve() if name else path
            if not target.is_file() or (anchor and unquote(anchor) not in anchors.get(target, {unquote(anchor)})):
                dead.append(f"{path.relative_to(top)}: {address}")
    if dead:
        raise ExtensionError("dead links:\n" + "\n".join(sorted(dead)))


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.add_html_math_renderer("mathml", (_formula, None), (_equation, None))
    app.connect("build-finished", _scripts_as_files)
    app.connect("build-finished", _links_lead_somewhere)
