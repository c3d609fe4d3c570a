"""A real browser opens the report of a real run. Report: Chromium, driven by Playwright; nothing is asked of a network,
nothing complained of; hovering, clicking, sorting, dark, narrow and print work; axe-core finds no violation.

`CONESPOT_SCREENSHOTS=FOLDER` keeps what was seen.
"""

import os
import shutil
from pathlib import Path

import pytest

from conespot.campaigns.cropping import keep_crops
from conespot.campaigns.pool import LocalPool
from conespot.campaigns.session import report
from conespot.campaigns.session import run_campaign as carry_out
from conespot.results import load_run
from conespot.results.report.beside import lay_beside

pytestmark = pytest.mark.slow
_OFFLINE = ("no-sandbox", "disable-gpu", "disable-background-networking", "disable-component-update", "disable-sync",
            "no-first-run", "enable-unsafe-swiftshader")  # fmt: skip


@pytest.fixture(scope="module")
def page_of_a_run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    kept = os.environ.get("CONESPOT_REPRODUCED")
    if kept and (Path(kept) / "crops.json").is_file():
        return Path(kept) / "report.html"
    run = carry_out(
        "reproduce_ci", folder / "run", workers=2, settings={"poses": "5", "scene.camera.resolution": "700"}
    )
    keep_crops(run, 1, LocalPool(2))
    report(run)
    return run / "report.html"


@pytest.fixture(scope="module")
def chromium():
    found = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if found is None:
        pytest.skip("no Chromium on this machine: `apt-get install chromium` installs one")
    api = pytest.importorskip("playwright.sync_api")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=[f"--{word}" for word in _OFFLINE])
        yield browser
        browser.close()


@pytest.fixture
def opened(chromium, page_of_a_run, request):
    """Opens the report; fails for whatever it asks of a network or complains of."""
    complaints = []

    def open_page(**options):
        page = chromium.new_context(**{"viewport": {"width": 1280, "height": 900}, **options}).new_page()
        page.set_default_timeout(60_000)
        page.on("console", lambda said: complaints.append(said.text) if said.type == "error" else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda asked: complaints.append(asked.url) if _outside(asked.url, page_of_a_run) else None)
        page.goto(page_of_a_run.as_uri())
        return page

    yield open_page
    assert not complaints


def _outside(url, page):
    return not url.startswith(("data:", "blob:")) and url != page.as_uri()


def _drawn(page, selector):
    plot = page.locator(selector).first
    plot.scroll_into_view_if_needed()
    plot.locator(".plot-container").first.wait_for()
    return plot


def _keep(page, name):
    folder = os.environ.get("CONESPOT_SCREENSHOTS")
    if folder:
        Path(folder).mkdir(parents=True, exist_ok=True)
        page.screenshot(path=Path(folder) / f"{name}.png")


def test_a_box_tells_its_statistics_and_a_frame_shows_its_picture(opened):
    page = opened()
    figure = page.locator("figure.chart", has_text="Fig. 10").first
    figure.scroll_into_view_if_needed()
    box = figure.locator(".boxlayer path.box").first
    box.wait_for()
    at = box.bounding_box()
    page.mouse.move(at["x"] + at["width"] / 2, at["y"] + at["height"] / 2, steps=3)
    page.locator(".hoverlayer text", has_text="median").first.wait_for()
    _keep(page, "box")
    crop = page.locator(".crop").first
    crop.click()
    dialog = page.locator("dialog[open]")
    assert dialog.locator(".view image").count() >= 1
    assert dialog.locator(".view path.true").first.is_visible()
    dialog.locator("input[value=true]").uncheck()
    assert not dialog.locator(".view path.true").first.is_visible()
    _keep(page, "frame")
    page.keyboard.press("Escape")
    assert page.locator("dialog[open]").count() == 0


def test_a_click_on_a_chart_s_frame_opens_it(opened):
    page = opened()
    figure = page.locator("figure.chart", has_text="Fig. 8").first
    figure.scroll_into_view_if_needed()
    figure.locator(".scatterlayer .trace").first.wait_for()
    told = figure.locator(".plot").evaluate(
        "plot => { const i = plot.data.findIndex(t => t.name.startsWith('overall'));"
        " const t = plot.data[i], a = plot._fullLayout.xaxis, b = plot._fullLayout.yaxis;"
        " const r = plot.getBoundingClientRect(), n = t.y.findIndex(y => y !== null);"
        " return [r.left + a._offset + a.l2p(t.x[n]), r.top + b._offset + b.l2p(t.y[n])]; }"
    )
    page.mouse.move(told[0], told[1], steps=3)
    page.locator(".hoverlayer .hovertext").first.wait_for()
    page.mouse.click(*told)
    page.locator("dialog[open]").wait_for()


def test_a_table_sorts_by_keyboard_and_back(opened):
    page = opened()
    table = page.locator("#published table").first
    before = table.locator("tbody tr").all_inner_texts()
    head = table.locator("thead button", has_text="ratio")
    head.focus()
    page.keyboard.press("Enter")
    column = table.locator("thead th").all_inner_texts().index(head.inner_text())
    cells = [float(row.split("\t")[column]) for row in table.locator("tbody tr").all_inner_texts()]
    assert cells == sorted(cells)
    assert table.locator("th[aria-sort=ascending]").count() == 1
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")
    assert table.locator("tbody tr").all_inner_texts() == before


def test_the_needles_stand_in_space(opened):
    page = opened()
    plot = _drawn(page, "#paths .plot")
    page.wait_for_timeout(500)
    names = plot.evaluate("plot => plot.data.map(trace => trace.name)")
    assert {"true tips", "found tips", "true needles", "found needles"} <= set(names)
    _keep(page, "path")


@pytest.mark.parametrize(
    "how",
    [
        {},
        {"viewport": {"width": 390, "height": 844}, "color_scheme": "dark"},
    ],
    ids=["light", "dark phone"],
)
def test_everybody_can_read_it(opened, how, request):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    page = opened(**how)
    _keep(page, request.node.callspec.id)
    _drawn(page, "#figures .plot")
    found = axe.Axe().run(page).response["violations"]
    assert [(v["id"], v["nodes"][0]["html"][:200]) for v in found] == []
    # nothing sticks out sideways but what scrolls in itself
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_runs_side_by_side_can_be_read_too(chromium, page_of_a_run, tmp_path):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    run = load_run(page_of_a_run.parent)
    place = tmp_path / "side_by_side.html"
    place.write_bytes(lay_beside([run, run])[0])
    page = chromium.new_context(viewport={"width": 1280, "height": 900}).new_page()
    page.set_default_timeout(60_000)
    complaints = []
    page.on("console", lambda said: complaints.append(said.text) if said.type == "error" else None)
    page.on("request", lambda asked: complaints.append(asked.url) if _outside(asked.url, place) else None)
    page.goto(place.as_uri())
    plot = _drawn(page, "#figures .plot")
    low, high = plot.evaluate("plot => plot._fullLayout.yaxis.range")
    tops = plot.evaluate("plot => plot.data.filter(t => t.yaxis === 'y').flatMap(t => t.upperfence)")
    assert low == 0
    assert max(tops) < high < 2 * max(tops)
    _keep(page, "side_by_side")
    assert [v["id"] for v in axe.Axe().run(page).response["violations"]] == []
    assert complaints == []


def test_the_reader_may_choose_the_other_colours(opened):
    page = opened(color_scheme="dark")
    ground = "getComputedStyle(document.body).backgroundColor"
    dark = page.evaluate(ground)
    page.get_by_role("button", name="Use light colours").click()
    assert page.evaluate(ground) == "rgb(255, 255, 255)" != dark


def test_it_prints_with_its_charts_in_light_colours(opened, tmp_path):
    page = opened(color_scheme="dark")
    page.evaluate("document.querySelectorAll('figure.chart').forEach((one, i) => i > 1 && one.remove())")
    page.evaluate("document.querySelector('#paths')?.remove()")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    assert page.evaluate("document.documentElement.dataset.tone") == "light"
    assert page.locator("figure.chart .plot-container").count() == 2
    assert not page.locator("nav.contents").is_visible()
    assert page.pdf(format="A4")[:5] == b"%PDF-"
