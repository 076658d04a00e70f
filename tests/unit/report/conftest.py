"""A browser for pages and viewers."""

import os
import shutil

import pytest

ARGUMENTS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
]  # fmt: skip
PATIENCE = 180_000  # ms: pictures are drawn without a GPU


@pytest.fixture
def page(tmp_path):
    """A page of Chromium."""
    driver = pytest.importorskip("playwright.sync_api", reason="pip install playwright")
    chromium = os.environ.get("CHROMIUM") or shutil.which("chromium")
    if chromium is None:
        pytest.skip("no browser: apt-get install chromium, or set CHROMIUM to its path")
    with driver.sync_playwright() as playwright:
        context = playwright.chromium.launch_persistent_context(
            tmp_path / "profile", executable_path=chromium, args=ARGUMENTS, timeout=PATIENCE,
            viewport={"width": 800, "height": 500}, accept_downloads=True,
        )  # fmt: skip
        context.set_default_timeout(PATIENCE)
        yield context.pages[0]
        context.close()
