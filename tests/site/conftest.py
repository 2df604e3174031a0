"""The system's Chromium, without a window, for pages that the report writes."""

import shutil
from contextlib import contextmanager

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
SOFTWARE = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]  # WebGL2 without a GPU


@pytest.fixture(scope="module")
def browser():
    """One for each file of tests: as long as it is open, its event loop runs, and nothing else can start one."""
    api = pytest.importorskip("playwright.sync_api", reason="no playwright: pip install playwright")
    path = next((found for name in NAMES if (found := shutil.which(name))), None)
    if path is None:
        pytest.skip(f"no Chromium ({', '.join(NAMES)}) on this machine")
    with api.sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=path, args=SOFTWARE)
        yield opened
        opened.close()


@contextmanager
def pages(browser):
    """A function that opens a file as file://; at the end no page may have complained or asked for the network.

    Its arguments: width, height of the window [pixels]; before, a script that runs before those of the page; fragment
    of the address, with its #; and settings of a browser's context.
    """
    complaints, contexts = [], []

    def opened(path, width=1000, height=900, before="", fragment="", **settings):
        contexts.append(browser.new_context(viewport={"width": width, "height": height}, **settings))
        page = contexts[-1].new_page()
        page.set_default_timeout(60_000)
        page.on("console", lambda told: complaints.append(told.text) if _complains(told) else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda asked: complaints.append(asked.url) if asked.url.startswith("http") else None)
        if before:
            page.add_init_script(before)
        page.goto(f"{path.as_uri()}{fragment}")
        return page

    try:
        yield opened
    finally:
        for context in contexts:
            context.close()
    assert complaints == []


def _complains(told):
    """Errors, and warnings such as those of OpenGL; that waiting for results takes time is none."""
    return told.type in ("error", "warning") and "OpenGL, Performance" not in told.text


@pytest.fixture
def open_page(browser):
    """`pages` for one test."""
    with pages(browser) as opened:
        yield opened


@pytest.fixture(scope="module")
def open_shared_page(browser):
    """`pages` for a file of tests."""
    with pages(browser) as opened:
        yield opened
