"""Files dropped on a page, as a person would."""

import base64
from collections.abc import Mapping

from playwright.sync_api import Page

_DROP = """(files) => {
  const transfer = new DataTransfer();
  for (const [name, data] of files)
    transfer.items.add(new File([Uint8Array.from(atob(data), (c) => c.charCodeAt(0))], name));
  for (const type of ["dragenter", "dragover", "drop"])
    document.body.dispatchEvent(new DragEvent(type, {bubbles: true, cancelable: true, dataTransfer: transfer}));
}"""


def drop(page: Page, files: Mapping[str, str | bytes]) -> None:
    """Drop files, text or bytes, by their names, all at once."""
    contents = {name: content.encode() if isinstance(content, str) else content for name, content in files.items()}
    page.evaluate(_DROP, [[name, base64.b64encode(content).decode()] for name, content in contents.items()])
