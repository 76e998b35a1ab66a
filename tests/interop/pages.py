"""The browser of browser.py against a page whose faults are known: what it does not see, it sees in no page."""

import struct
import tempfile
from pathlib import Path

from browser import Browser

PAGE = """<!DOCTYPE html><html lang="en"><head><title>page</title><style>
body { margin: 0; background: white } p { width: 600px; height: 2000px; margin: 0 }
@media (prefers-color-scheme: dark) { body { background: black } } @media print { .screen { display: none } }
</style></head><body><p>wide</p><b class="screen">screen</b>%s</body></html>"""
FAULTY = '<script>console.log("fine"); console.error("broken")</script><img src="missing.png" alt="">'


def size(png):
    assert png[:8] == b"\x89PNG\r\n\x1a\n", png[:8]
    return struct.unpack(">II", png[16:24])


def browser_sees_errors_schemes_widths_and_paper(_):
    with tempfile.TemporaryDirectory() as folder, Browser() as browser:
        faulty, sound = Path(folder) / "faulty.html", Path(folder) / "sound.html"
        faulty.write_text(PAGE % FAULTY)
        sound.write_text(PAGE % "")
        browser.open(faulty)
        errors = "\n".join(browser.errors())
        assert errors.count("\n") == 1 and '"broken"' in errors and "missing.png" in errors, errors
        background = "return getComputedStyle(document.body).backgroundColor"
        for is_dark, colour in [(False, "rgb(255, 255, 255)"), (True, "rgb(0, 0, 0)")]:
            browser.open(sound, width=390, height=844, is_dark=is_dark)
            assert (browser.errors(), browser.script(background)) == ([], colour)
            assert browser.overflow() == 210, browser.overflow()
            assert size(browser.screenshot()) == (390, 844)
            width, height = size(browser.screenshot(is_whole=True))
            assert width >= 600 and height >= 2000, (width, height)
        browser.open(sound, width=800)
        assert browser.overflow() == 0
        assert browser.script("return document.querySelector('.screen').offsetWidth") > 0
        browser.open(sound, is_print=True)
        assert browser.script("return document.querySelector('.screen').offsetWidth") == 0
        assert browser.pdf()[:5] == b"%PDF-"


TESTS = [browser_sees_errors_schemes_widths_and_paper]
