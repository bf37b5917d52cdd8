"""Whether something was drawn: seen in the pixels of a screenshot, not in the nodes. The browser itself decodes it."""

import base64
from dataclasses import dataclass

from playwright.sync_api import Locator

_COUNT = """async (png) => {
  const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${png}`)).blob());
  const context = new OffscreenCanvas(image.width, image.height).getContext("2d");
  context.drawImage(image, 0, 0);
  const pixels = context.getImageData(0, 0, image.width, image.height).data;
  const count = new Map();
  for (let at = 0; at < pixels.length; at += 4) {
    const packed = (pixels[at] << 16) | (pixels[at + 1] << 8) | pixels[at + 2];
    count.set(packed, (count.get(packed) ?? 0) + 1);
  }
  const ground = [...count].reduce((a, b) => (b[1] > a[1] ? b : a))[0];
  const shade = (packed) => [packed >> 16, (packed >> 8) & 255, packed & 255];
  let drawn = 0, saturated = 0;
  for (const [packed, times] of count) {
    const rgb = shade(packed);
    if (Math.max(...rgb.map((value, index) => Math.abs(value - shade(ground)[index]))) > 24) drawn += times;
    if (Math.max(...rgb) - Math.min(...rgb) > 60) saturated += times;
  }
  const all = image.width * image.height;
  return [drawn / all, saturated / all, ground];
}"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """Shares of the pixels that differ from the ground, and that have a strong colour; the ground as 0xRRGGBB."""

    drawn: float
    coloured: float
    ground: int

    @property
    def is_chart(self) -> bool:
        """Text and axes differ from the ground; only lines, bands and surfaces have a strong colour, too."""
        return self.drawn > 0.01 and self.coloured > 0.0015

    @property
    def is_dark(self) -> bool:
        """Whether the ground is dark."""
        return max(self.ground >> 16, (self.ground >> 8) & 255, self.ground & 255) < 80


def seen(place: Locator) -> Seen:
    """What is in a place of a page, in an empty page of the same browser: the place's own may not read pictures."""
    png, browser = place.screenshot(), place.page.context.browser
    assert browser is not None
    page = browser.new_page()
    drawn, coloured, ground = page.evaluate(_COUNT, base64.b64encode(png).decode())
    page.close()
    return Seen(drawn=drawn, coloured=coloured, ground=ground)
