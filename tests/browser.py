"""A real browser for tests: the one of the system, with software rendering."""

import shutil
from contextlib import contextmanager

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
)


@contextmanager
def page(width=900, height=560):
    """An empty page; the test skips without Playwright, and without a browser."""
    playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright")
    browser = next(filter(None, map(shutil.which, NAMES)), None)
    if browser is None:
        pytest.skip(f"needs a browser: {' or '.join(NAMES)}")
    with playwright.sync_playwright() as driver:
        window = driver.chromium.launch(executable_path=browser, args=FLAGS)
        try:
            page = window.new_page(viewport={"width": width, "height": height})
            page.set_default_timeout(240_000)
            yield page
        finally:
            window.close()
