"""Sphinx: the pages of `docs/` become the site that `make docs` builds and the service serves at `/help`.

Nothing is fetched, neither while it is built nor by a page: formulas are MathML, fonts are the reader's. No page holds
a script or a style of its own: the service's Content-Security-Policy holds for the site too. Without scripts all but the
search works.
"""

import hashlib
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

#: A script or style within a page and a picture within a style, which are moved to files; and the theme's styles within
#: elements, with what stands in their place.
_INLINE = re.compile(r"<(script|style)>(.*?)</\1>", flags=re.DOTALL)
_PICTURE = re.compile(r"""url\((["'])data:image/svg\+xml;charset=utf-8,(.*?)\1\)""")
_STYLES = {'style="opacity: 50%"': 'opacity="0.5"', 'style="display: none;"': 'display="none"'}


def _formula(self: Any, node: nodes.math) -> None:
    self.body.append(tex2mathml(node.astext(), as_block=False))
    raise nodes.SkipNode


def _equation(self: Any, node: nodes.math_block) -> None:
    self.body.append(f'<div class="equation">{tex2mathml(node.astext(), as_block=True)}</div>')
    raise nodes.SkipNode


def _nothing_inline(app: Sphinx, exception: Exception | None) -> None:
    """Move every inline script, style and picture into a file of its own. Raises ExtensionError for a style that stays."""
    if exception is not None or app.builder.name != "html":
        return
    top = Path(app.outdir)
    files: dict[tuple[str, str], str] = {}
    for page in top.rglob("*.html"):
        up = "../" * (len(page.relative_to(top).parts) - 1)

        def named(match: re.Match[str], up: str = up) -> str:
            ending = {"script": "js", "style": "css"}[match[1]]
            address = f"{up}_static/" + files.setdefault((match[1], match[2].strip()), f"inline-{len(files)}.{ending}")
            return (
                f'<script src="{address}"></script>'
                if ending == "js"
                else f'<link rel="stylesheet" href="{address}" />'
            )

        text = _INLINE.sub(named, page.read_text(encoding="utf-8"))
        for style, attribute in _STYLES.items():
            text = text.replace(style, attribute)
        if 'style="' in text:
            raise ExtensionError(f"{page.relative_to(top)} has a style that the Content-Security-Policy refuses")
        page.write_text(text, encoding="utf-8")
    for (_, content), name in files.items():
        (top / "_static" / name).write_text(content, encoding="utf-8")
    for sheet in top.rglob("*.css"):

        def pictured(match: re.Match[str], folder: Path = sheet.parent) -> str:
            name = f"{hashlib.sha256(match[2].encode()).hexdigest()[:16]}.svg"
            (folder / name).write_text(unquote(match[2]), encoding="utf-8")
            return f"url({name})"

        sheet.write_text(_PICTURE.sub(pictured, sheet.read_text(encoding="utf-8")), encoding="utf-8")


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
    app.connect("build-finished", _nothing_inline)
    app.connect("build-finished", _links_lead_somewhere)
