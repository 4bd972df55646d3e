"""What keeps people out of a page who do not see it, or use no mouse: looked for in a real browser's document."""

from __future__ import annotations

import importlib.util
from contextlib import suppress
from importlib.resources import files
from typing import TYPE_CHECKING

from playwright.sync_api import Error

if TYPE_CHECKING:
    from playwright.sync_api import Page

FAULTS = r"""() => {
  const faults = [];
  const shown = (each) => each.checkVisibility({ visibilityProperty: true }) && !each.closest('[aria-hidden="true"]');
  const all = (selector) => [...document.querySelectorAll(selector)].filter(shown);
  const said = (each) => each.outerHTML.slice(0, 160).replace(/\s+/g, " ");
  const words = (text) => (text || "").trim();

  const named = (each) => {
    if (words(each.getAttribute("aria-label")) || words(each.getAttribute("title"))) return true;
    const by = each.getAttribute("aria-labelledby");
    if (by) return by.split(/\s+/).some((id) => words(document.getElementById(id)?.textContent));
    if (each.matches("img")) return each.hasAttribute("alt");
    if ([...(each.labels || [])].some((label) => words(label.innerText))) return true;
    if (each.matches("input, select, textarea")) return false;
    const copy = each.cloneNode(true); // an icon's name is no word, though it stands in the text
    copy.querySelectorAll('[aria-hidden="true"], .q-icon').forEach((icon) => icon.remove());
    return Boolean(words(copy.textContent)) || Boolean(copy.querySelector("img[alt]:not([alt=''])"));
  };

  if (!words(document.documentElement.lang)) faults.push("the page has no language");
  if (!words(document.title)) faults.push("the page has no title");

  const controls = ["a[href]", "button", "select", "textarea", "input:not([type=hidden])", "summary",
    ...["button", "switch", "checkbox", "radio", "tab", "combobox", "slider", "spinbutton", "progressbar", "menuitem",
        "option", "img", "dialog", "alertdialog", "listbox", "radiogroup"].map((role) => `[role=${role}]`), "img"];
  for (const each of all(controls.join(", "))) if (!named(each)) faults.push(`no name: ${said(each)}`);
  for (const each of all("[role=dialog], [role=alertdialog]"))
    if (!words(each.getAttribute("aria-label"))) faults.push(`a dialog without a name: ${said(each)}`);
  for (const each of all("button input, a input, [role=button] input"))
    if (!each.inert) faults.push(`a field inside a control: ${said(each)}`);
  for (const each of all("canvas, svg")) {
    const part = each.closest("[role=img], button, a, [aria-label]");
    if (!part && !each.closest(".q-icon, .q-spinner, .q-field")) faults.push(`a picture without words: ${said(each)}`);
  }

  const ids = [...document.querySelectorAll("[id]")].map((each) => each.id);
  const twice = ids.filter((id, at) => id && ids.indexOf(id) !== at);
  for (const id of new Set(twice)) faults.push(`two elements are #${id}`);

  for (const each of all("button button, a button, button a, a a, [role=button] button"))
    faults.push(`a control inside a control: ${said(each)}`);
  for (const each of document.querySelectorAll('[aria-hidden="true"] :is(button, a[href], input, select, textarea)'))
    if (each.checkVisibility({ visibilityProperty: true }) && each.tabIndex >= 0 && !each.disabled)
      faults.push(`hidden from readers, yet it takes the focus: ${said(each)}`);
  for (const each of document.querySelectorAll("[tabindex]"))
    if (each.tabIndex > 0) faults.push(`it jumps the order of the focus: ${said(each)}`);
  for (const each of all("table"))
    if (!each.querySelector("th")) faults.push(`a table without headings: ${said(each)}`);

  const levels = all("h1, h2, h3, h4, h5, h6, [role=heading]").map((each) => [
    Number(each.getAttribute("aria-level") || each.tagName.slice(1)), words(each.textContent),
  ]);
  if (levels.filter(([level]) => level === 1).length !== 1) faults.push("there must be one heading of level 1");
  let before = 0;
  for (const [level, text] of levels) {
    if (level > before + 1) faults.push(`heading "${text}" of level ${level} follows one of level ${before}`);
    before = level;
  }
  if (all("main").length !== 1) faults.push(`there must be one main; got ${all("main").length}`);
  const navigation = all("nav").map((each) => each.getAttribute("aria-label"));
  if (!navigation.length || navigation.some((name) => !name) || new Set(navigation).size !== navigation.length)
    faults.push(`each nav must have a name of its own; got ${navigation}`);
  return faults;
}"""

WIDER = """() => {
  const [root, width] = [document.scrollingElement, document.documentElement.clientWidth];
  if (root.scrollWidth <= width) return [];
  const wide = [...document.querySelectorAll("body *")].filter(
    (each) => each.getBoundingClientRect().right > width + 1);
  return [`the page is ${root.scrollWidth} wide in a window of ${width}: ${wide[0]?.outerHTML.slice(0, 160)}`];
}"""


AXE = "axe_playwright_python"  # brings axe-core, whose rules are those of WCAG 2.2
BROKEN = """async () => {
  const passing = document.getAnimations().filter((each) => each.effect.getTiming().iterations !== Infinity);
  await Promise.all(passing.map((each) => each.finished.catch(() => {}))); // what fades has little contrast
  const dialog = document.querySelector("[role=dialog], [role=alertdialog]"); // its backdrop passes for the background
  const options = { resultTypes: ["violations"], rules: { "color-contrast": { enabled: !dialog } } };
  return (await axe.run(document, options)).violations.flatMap(
    (rule) => rule.nodes.map((node) => `axe, ${rule.id}: ${node.html.slice(0, 160)}`));
}"""


SETTLES_MS = 10_000  # a part that the server completes later is no fault; a fault costs a failing test this wait


def faults(page: Page) -> list[str]:
    """What is wrong with the page once it has settled; empty when nothing was found."""
    with suppress(Error):
        page.wait_for_function(f"() => ({FAULTS})().length === 0", timeout=SETTLES_MS)
    result: list[str] = page.evaluate(FAULTS)
    return result + broken_rules(page)


def broken_rules(page: Page) -> list[str]:
    """The elements that break a rule of axe-core, where that is installed.

    What is found is looked for again: a message may begin to fade while the rules are applied. The pointer leaves the
    page first: what appears under it shows a tooltip, which lies outside every landmark.
    """
    if importlib.util.find_spec(AXE) is None:
        return []
    page.mouse.move(0, 0)
    page.wait_for_function("() => !document.querySelector('.q-tooltip')")
    page.evaluate((files(AXE) / "axe.min.js").read_text(encoding="utf-8"))
    result: list[str] = page.evaluate(BROKEN)
    again = page.evaluate(BROKEN) if result else []
    return [each for each in result if each in again]


def too_wide(page: Page) -> list[str]:
    """What makes the page scroll sideways; empty when it does not."""
    result: list[str] = page.evaluate(WIDER)
    return result
