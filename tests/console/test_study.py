"""The page Study, in a real browser: a whole blinded study, from the list of targets to its report."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING

import httpx
import pytest
from playwright.sync_api import expect
from tests.console.accessible import faults, too_wide
from tests.console.browser import needs_browser, picture
from tests.console.contrast import texts
from tests.console.filled_store import still
from tests.console.operator import TABLET, tab
from tests.waiting import HANGS_S

from tsis.present.study import study_page
from tsis.study.analysis import analyse
from tsis.study.folder import new_study, open_study, printed_targets, verify_study
from tsis.study.readings import UNCERTAINTY_COLUMNS, import_table

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser, Page
    from tests.console.running import RunningConsole

pytestmark = [pytest.mark.system, needs_browser]
DEVICE = "virtual tsis-domed"
HEADINGS = "code,score,operator,repeat,diameter_mm,depth_mm,young_kpa"
TRUTH = ("detection-", "blank-", "inclusion")


@pytest.fixture
def page(console: RunningConsole, browser: Browser) -> Iterator[Page]:
    with tab(browser, console, "/study", expected="status of 4|status of 5", color_scheme="light") as opened:
        opened.get_by_role("button", name="Create the study").wait_for()
        yield opened


def position(console: RunningConsole, name: str) -> Path:
    return console.workspace / "studies" / name


def make(page: Page, name: str, **fields: str) -> None:
    """Fill the form, all fields being as at first but those given, and make the study."""
    given = {"With an inclusion": "2", "Blanks": "2", "Forces": "1", "Seed": "3", **fields}
    for label, text in {"Name": name, **given}.items():
        page.get_by_label(label, exact=True).fill(text)
    page.get_by_role("button", name="Create the study").click()


def complained(page: Page, words: str) -> None:
    """Wait for what was complained of; where it is not a field's, close it."""
    reported = page.get_by_role("alert").filter(has_text=words)
    reported.first.wait_for()
    close = reported.get_by_role("button", name="Close")
    if close.count():
        close.first.click()
        reported.first.wait_for(state="hidden")


def readable(page: Page) -> None:
    still(page)
    assert faults(page) == []
    assert too_wide(page) == []
    assert [item for item in texts(page) if item.contrast < item.least] == []


def upload(page: Page, content: bytes, *, device: str = "palpation", threshold: str = "3", file: str = "r.csv") -> None:
    """Import a table in the open dialog."""
    dialog = page.get_by_role("dialog")
    dialog.get_by_label("Device").fill(device)
    dialog.get_by_label("Threshold").fill(threshold)
    page.locator("input[type=file]").set_input_files({"name": file, "mimeType": "text/csv", "buffer": content})


def rows_of(codes: tuple[str, ...], scores: tuple[str, ...]) -> bytes:
    rows = [f"{code},{score},Ben,1,8,," for code, score in zip(codes, scores, strict=True)]
    return "\n".join([HEADINGS, *rows]).encode()


@pytest.mark.slow
def test_a_whole_study(page: Page, console: RunningConsole, browser: Browser) -> None:
    make(page, "trial")
    page.get_by_text("Study trial", exact=True).wait_for()
    page.get_by_role("cell", name="left").nth(3).wait_for()
    picture(page, "study-blind-light")
    readable(page)
    page.get_by_role("button", name="Unblind and analyse").click()
    page.get_by_role("dialog").get_by_label("Done by").fill("Eve")
    page.get_by_role("dialog").get_by_role("button", name="Unblind and analyse").click()
    complained(page, "a study must have a reading before it is unblinded")
    page.get_by_role("dialog").get_by_role("button", name="Cancel").click()

    page.get_by_label("Operator").fill("Ada")
    page.get_by_role("button", name="Run on the virtual probe").click()
    page.get_by_text(re.compile(r"^Reading target")).wait_for()
    assert (
        httpx.get(f"{console.address}/files/study/trial/report.html", headers=console.key, timeout=HANGS_S).status_code
        == 404
    )
    page.get_by_text("4 readings entered", exact=False).wait_for()
    page.get_by_text("Ada: 4 of 4 read").wait_for()
    expect(page.get_by_role("cell", name="read", exact=True)).to_have_count(4)
    blind = open_study(position(console, "trial"))
    assert [item.operator for item in blind.readings] == ["Ada"] * 4
    assert page.locator("tbody tr").all_inner_texts() == [
        f"{at}\t{code}\tread" for at, code in enumerate(blind.plan.codes, start=1)
    ]
    assert not any(word in page.inner_text("main") for word in TRUTH)

    page.get_by_role("button", name="Verify").click()
    page.get_by_text("The study is unchanged, all 5 lines of its log.").wait_for()
    page.get_by_label("Log head saved elsewhere").fill("0" * 12)
    page.get_by_role("button", name="Compare").click()
    page.get_by_text("The study was CHANGED").wait_for()
    with page.expect_download() as saved:
        page.get_by_role("button", name=f"Export readings of {DEVICE}").click()
    assert saved.value.suggested_filename == "trial-virtual-tsis-domed.csv"
    lines = Path(saved.value.path()).read_text().splitlines()
    assert lines[0] == ",".join((HEADINGS, *UNCERTAINTY_COLUMNS))
    assert sorted(line.split(",")[0] for line in lines[1:]) == sorted(blind.plan.codes)

    page.get_by_role("button", name="Import readings").click()
    upload(page, rows_of(blind.plan.codes[:3], ("4", "1", "")))
    page.get_by_text("Ben: 3 of 4 read, 1 undecided").wait_for()
    page.get_by_role("button", name="Unblind and analyse").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_text("cannot be undone").wait_for()
    dialog.get_by_label("Done by").fill("Eve")
    still(page)
    picture(page, "study-unblinding")
    dialog.get_by_role("button", name="Unblind and analyse").click()
    complained(page, "every target must be read before a study is unblinded")
    assert open_study(position(console, "trial")).unblinded is None
    dialog.get_by_text("even if incomplete").click()
    dialog.get_by_role("button", name="Unblind and analyse").click()
    dialog.wait_for(state="hidden")
    page.get_by_role("link", name="Report", exact=True).wait_for()
    page.get_by_role("img", name="Curve of each").wait_for()

    study = open_study(position(console, "trial"))
    assert study.unblinded is not None
    assert study.unblinded.actor == "Eve"
    assert verify_study(study.folder).sound
    for card in study_page(analyse(study)).cards[1:]:
        reported = page.locator(".card").filter(has=page.get_by_text(card.title, exact=True))
        assert reported.locator(".number").inner_text() == card.value
        assert card.detail in reported.inner_text()
    cells = page.locator("tbody tr").all_inner_texts()
    assert sum("\tinclusion\t" in row for row in cells) == 2
    assert sum("\tblank\t" in row for row in cells) == 2
    assert page.get_by_role("button", name="Run on the virtual probe").is_hidden()
    assert page.get_by_role("button", name="Import readings").is_hidden()
    page.get_by_role("button", name="Close").first.click()
    picture(page, "study-unblinded-light")
    readable(page)
    with page.context.expect_page() as opened:
        page.get_by_role("link", name="Report", exact=True).click()
    report = opened.value
    report.get_by_role("heading", name="Study trial").wait_for()
    picture(report, "study-report")
    for form, begins in (("html", b"<!"), ("pdf", b"%PDF")):
        answer = httpx.get(f"{console.address}/files/study/trial/report.{form}", headers=console.key, timeout=HANGS_S)
        assert answer.content.startswith(begins)
        assert "script-src 'self' 'nonce-" in answer.headers["content-security-policy"]
        assert answer.headers["cache-control"] == "private, no-store"
    with tab(browser, console, "/study/trial", size=TABLET, color_scheme="dark") as tablet:
        tablet.get_by_role("img", name="Curve of each").wait_for()
        picture(tablet, "study-unblinded-dark")
        readable(tablet)
        tablet.get_by_role("link", name="All studies").click()
        tablet.get_by_role("row", name="trial").get_by_text(re.compile("^unblinded .* by Eve$")).wait_for()
        picture(tablet, "study-list-dark")

    (study.folder / "analysis" / "report.html").write_text("<script>alert(1)</script>")
    answer = httpx.get(f"{console.address}/files/study/trial/report.html", headers=console.key, timeout=HANGS_S)
    assert answer.status_code == 503
    assert answer.text.startswith("report.html must be as it was written; it was changed")


@pytest.mark.slow
def test_a_run_is_ended_goes_on_and_is_one_at_a_time(page: Page, console: RunningConsole, browser: Browser) -> None:
    make(page, "long", **{"With an inclusion": "8", "Blanks": "8"})
    page.get_by_label("Operator").fill("Ada")
    with tab(browser, console, "/study/long") as other:  # anybody sees it, and may not begin another
        page.get_by_role("button", name="Run on the virtual probe").click()
        other.get_by_role("button", name="Run on the virtual probe", disabled=True).wait_for()
        page.get_by_text(re.compile(r"^Ada: [1-9]\d* of 16 read$")).wait_for()
        other.get_by_role("button", name="Cancel", exact=True).click()
        other.get_by_text("Readings are saved: run it again to continue.").wait_for()
        left = 16 - len(open_study(position(console, "long")).readings)
        assert 0 < left < 16
        other.reload()
        other.get_by_role("button", name="Run on the virtual probe", disabled=False).wait_for()
        expect(other.get_by_label("Operator")).to_have_value("Ada")
        other.get_by_role("button", name="Run on the virtual probe").click()
        other.get_by_text(f"{left} readings entered").wait_for()
    study = open_study(position(console, "long"))
    assert sorted(item.code for item in study.readings) == sorted(study.plan.codes)
    assert {item.operator for item in study.readings} == {"Ada"}


@pytest.mark.slow
def test_what_cannot_be_made_is_said(page: Page, console: RunningConsole) -> None:
    requested: tuple[tuple[dict[str, str], str], ...] = (
        ({"Name": "../up"}, "you entered '../up'"),
        ({"Name": "/etc/x"}, "you entered '/etc/x'"),
        ({"Name": "<b>x</b>"}, "you entered '<b>x</b>'"),
        ({"Name": ""}, "name must be 1 to 60 letters, digits, dashes and underscores (nothing was entered)"),
        ({"With an inclusion": "-1"}, "Targets with an inclusion must be 0–"),
        ({"With an inclusion": "1e9"}, "you entered 1e+09"),
        ({"With an inclusion": "1e999"}, "targets with an inclusion must be a whole number"),
        ({"With an inclusion": "0", "Blanks": "0"}, "blanks must"),
        ({"Forces": "0.5, much"}, "force must be a number"),
        ({"Forces": "1 1"}, "different forces"),
        ({"Repeats": "1.5"}, "repeats must be a whole number"),
        ({"Threshold": "high"}, "threshold must be a number"),
        ({"Seed": "-2"}, "Seed must be 0–"),
    )
    usual = {"Repeats": "1", "Threshold": "0.5"}
    for fields, message in requested:
        make(page, fields.get("Name", "wrong"), **{**usual, **{at: fields[at] for at in fields if at != "Name"}})
        complained(page, message)
    studies = console.workspace / "studies"
    assert not (studies / "wrong").exists()
    assert not studies.exists() or all(re.fullmatch(r"[\w-]+", item.name) for item in studies.iterdir())


def test_a_study_of_another_device_is_unblinded(page: Page, console: RunningConsole) -> None:
    created = new_study(position(console, "other"), printed_targets(2, 2), seed=1, actor="Ada")
    import_table(created, rows_of(created.plan.codes, ("4", "1", "2", "5")), "r.csv", device="palpation", threshold=3)
    page.get_by_role("link", name="other").click()  # it is listed though another program has made it
    page.get_by_text("Ben: 4 of 4 read").wait_for()
    assert not any(word in page.inner_text("main") for word in TRUTH)
    page.get_by_role("button", name="Unblind and analyse").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_text("The study has 4 readings.").wait_for()
    assert dialog.get_by_text("even if incomplete").is_hidden()
    dialog.get_by_label("Done by").fill("Ada")
    dialog.get_by_role("button", name="Unblind and analyse").click()
    page.get_by_role("link", name="Report", exact=True).wait_for()
    page.get_by_role("cell", name="detection-1", exact=True).wait_for()
    expect(page.locator(".card").filter(has_text="Area under the curve")).to_have_count(1)
    page.get_by_role("heading", name="Targets").scroll_into_view_if_needed()
    picture(page, "study-truth")


@pytest.mark.slow
def test_hostile_tables_and_addresses_are_refused_in_a_sentence(page: Page, console: RunningConsole) -> None:
    make(page, "hostile")
    page.get_by_text("Study hostile", exact=True).wait_for()
    codes = open_study(position(console, "hostile")).plan.codes
    page.get_by_role("button", name="Import readings").click()
    for content, message in (
        (b"", "must"),
        (b"\x00\xff\xfe\x00", "must"),
        (b"code,score\nx,1", "must"),
        (HEADINGS.encode(), "it has headings alone"),
        (f"{HEADINGS}\n<script>alert(1)</script>,1,Ben,1,,,".encode(), "code must be one of this study's codes"),
        (f"{HEADINGS}\n{codes[0]},nan,Ben,1,,,".encode(), "score must be a finite number"),
        (f"{HEADINGS}\n{codes[0]},1,Ben,1,,,\n{codes[0]},1,Ben,1,,,".encode(), "are there already"),
        (f'{HEADINGS}\n{codes[0]},1,"Ben\nA",1,,,'.encode(), "operator must be"),
    ):
        upload(page, content)
        complained(page, message)
    upload(page, rows_of(codes, ("1",) * 4), device=DEVICE)
    complained(page, "device must not be")
    upload(page, rows_of(codes, ("1",) * 4), device="")
    complained(page, "device must be 1 to 120 printable letters")
    upload(page, rows_of(codes, ("1",) * 4), threshold="x")
    complained(page, "threshold must be a number")
    assert open_study(position(console, "hostile")).readings == ()
    hostile = "<img src=x onerror=alert(1)>"
    upload(page, rows_of(codes, ("1", "2", "3", "4")), device=hostile, file="..\\..\\x<b>.csv")
    page.get_by_text(hostile, exact=True).first.wait_for()
    assert page.locator("main img[src=x]").count() == 0
    log = (position(console, "hostile") / "log.jsonl").read_text(encoding="utf-8")
    assert [json.loads(line)["content"]["file"] for line in log.splitlines() if '"imported"' in line] == ["x<b>.csv"]

    for name in ("absent", "..%2F..%2Frecords", "%3Cscript%3E", "a" * 300, "%E2%82%AC"):
        page.goto(f"{console.address}/study/{name}")
        page.get_by_role("alert").get_by_text(re.compile("must be")).or_(
            page.get_by_text("no page at this")
        ).first.wait_for()
        answer = httpx.get(f"{console.address}/files/study/{name}/report.html", headers=console.key, timeout=HANGS_S)
        assert answer.status_code in (400, 404)
        assert str(console.folder) not in answer.text
    answer = httpx.get(f"{console.address}/files/study/hostile/report.csv", headers=console.key, timeout=HANGS_S)
    assert answer.status_code == 404

    (position(console, "hostile") / "study.json").write_text("{")
    page.goto(f"{console.address}/study/hostile")
    page.get_by_role("alert").get_by_text("study.json").wait_for()
    page.get_by_role("link", name="All studies").click()
    page.get_by_role("row", name="hostile").get_by_text("study.json").wait_for()
    picture(page, "study-damaged")
