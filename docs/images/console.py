"""Take the picture of the console: PYTHONPATH=. python docs/images/console.py."""

import tempfile
from pathlib import Path

from tests.console.browser import chromium
from tests.console.operator import hold, press_with, run
from tests.console.running import running_console

FORCES, ROLES = ("0.5", "1"), ("reference (no inclusion)", "on the target")


def main() -> None:
    """Keep four presses, estimate, and take the picture."""
    with (
        tempfile.TemporaryDirectory() as folder,
        running_console(Path(folder)) as console,
        chromium() as browser,
    ):
        page = browser.new_context(viewport={"width": 1280, "height": 900}, color_scheme="light").new_page()
        page.goto(console.entrance)
        hold(page)
        run(page)
        for role in ROLES:
            page.get_by_role("button", name=role).click()
            for force in FORCES:
                press_with(page, force)
                page.get_by_role("button", name="Snapshot").click()
                page.get_by_text(f"Saved for target 1: {role}, {force} N").wait_for()
        page.get_by_role("button", name="Estimate").click()
        page.get_by_text("Diameter d").wait_for()
        page.wait_for_function("!document.querySelector('.q-notification')")
        page.screenshot(path=Path(__file__).with_name("console.png"))


if __name__ == "__main__":
    main()
