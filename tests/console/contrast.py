"""Contrast of text against what it stands on, as WCAG 2.2 defines it, read off a real browser's computed colours."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from playwright.sync_api import Page

LEAST, LEAST_LARGE = 4.5, 3.0  # success criterion 1.4.3

TEXTS = r"""() => {
  const found = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    const part = node.parentElement;
    if (!node.textContent.trim()) continue;
    if (!part.checkVisibility({ visibilityProperty: true, opacityProperty: true })) continue;
    if (part.closest("style, script, svg, [disabled], .disabled, [aria-disabled=true], .unseen, .q-icon")) continue;
    const grounds = [];
    let opacity = 1;
    for (let each = part; each; each = each.parentElement) {
      const style = getComputedStyle(each);
      opacity *= Number(style.opacity);
      grounds.push(style.backgroundColor);
    }
    const style = getComputedStyle(part);
    const size = parseFloat(style.fontSize);
    found.push({
      text: node.textContent.trim().slice(0, 60), colour: style.color, grounds, opacity,
      large: size >= 24 || (size >= 18.66 && Number(style.fontWeight) >= 700),
    });
  }
  return found;
}"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Text:
    """A piece of text with its contrast and what that must be at least."""

    text: str
    contrast: float
    least: float


def texts(page: Page) -> list[Text]:
    """Every piece of text that is shown."""
    return [
        Text(
            text=item["text"],
            contrast=contrast_on(item["colour"], item["grounds"], item["opacity"]),
            least=LEAST_LARGE if item["large"] else LEAST,
        )
        for item in page.evaluate(TEXTS)
    ]


def contrast_on(colour: str, grounds: list[str], opacity: float = 1.0) -> float:
    """Contrast of a colour on grounds that lie one over another, the uppermost first."""
    behind = (255.0, 255.0, 255.0)
    for ground in reversed(grounds):
        behind = _over(_rgba(ground), behind)
    red, green, blue, alpha = _rgba(colour)
    return contrast(_over((red, green, blue, alpha * opacity), behind), behind)


def contrast(one: tuple[float, float, float], other: tuple[float, float, float]) -> float:
    """Contrast ratio of two colours, from 1 to 21."""
    dark, light = sorted((_luminance(one), _luminance(other)))
    return (light + 0.05) / (dark + 0.05)


def _luminance(colour: tuple[float, float, float]) -> float:
    linear = [
        fraction / 12.92 if fraction <= 0.04045 else ((fraction + 0.055) / 1.055) ** 2.4
        for fraction in (channel / 255 for channel in colour)
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def _rgba(text: str) -> tuple[float, float, float, float]:
    numbers = [float(item) for item in re.findall(r"[\d.]+", text)]
    assert text.startswith("rgb"), text
    return numbers[0], numbers[1], numbers[2], numbers[3] if len(numbers) > 3 else 1.0


def _over(colour: tuple[float, float, float, float], behind: tuple[float, float, float]) -> tuple[float, float, float]:
    alpha = colour[3]
    mixed = [alpha * front + (1 - alpha) * back for front, back in zip(colour[:3], behind, strict=True)]
    return mixed[0], mixed[1], mixed[2]
