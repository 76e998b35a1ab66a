"""`frhc view` for screen readers and keyboards: axe-core (MPL 2.0, by npm, fetched by scripts/setup.sh) finds no serious fault in any state of the page."""

import functools
import tarfile
import tempfile

from browser import SOFTWARE_GL, Browser
from telemetry_feed import ROOT, Feed, Motion, description
from view import PAGE_TIMEOUT_S, WIDTHS, drawn, page, until

AXE = ROOT / "target/interop/axe-core-4.14.1.tgz"
SEVERE = ("serious", "critical")
RUN = "const done = arguments[0]; axe.run(document, { resultTypes: ['violations'] }).then((found) => done(found), (error) => done(String(error)));"


@functools.cache
def axe():
    """Returns the text of the script, which the driver runs in the page whatever its Content-Security-Policy says."""
    with tarfile.open(AXE) as archive:
        return archive.extractfile("package/axe.min.js").read().decode()


def has_no_severe_fault(browser, name):
    """Fails at a violation that axe-core calls serious or critical."""
    browser.script(axe())
    found = browser.command("POST", "/execute/async", script=RUN, args=[])
    severe = [(fault["id"], node["html"][:200], node["failureSummary"][:300]) for fault in found["violations"] if fault["impact"] in SEVERE for node in fault["nodes"]]
    assert len(found["passes"]) > 10 and not severe, (name, severe)
    print(f"  {name}: {len(found['passes'])} rules passed, {[fault['id'] for fault in found['violations']]} less than serious", flush=True)


def view_has_no_serious_fault_for_axe(_):
    if not AXE.exists():
        print(f"NOT RUN: {AXE} is missing; scripts/setup.sh browser fetches it by npm", flush=True)
        return
    with tempfile.TemporaryDirectory() as folder, page(folder) as (url, node), Browser(SOFTWARE_GL) as browser:
        browser.command("POST", "/timeouts", script=1000 * PAGE_TIMEOUT_S)
        browser.open_url(url)
        until(browser, "document.getElementById('mode-text').textContent.includes('No node offers')", "the reason")
        has_no_severe_fault(browser, "no node")
        for name, stop_at in (("engaged", None), ("stopped", 0.0)):
            with Feed(node, Motion(description(), stop_at)):
                for device, (width, height) in WIDTHS.items():
                    for is_dark in (False, True):
                        browser.open_url(url, width, height, is_dark)
                        drawn(browser)
                        has_no_severe_fault(browser, f"{name}, {device}, {'dark' if is_dark else 'light'}")
        browser.open_url(url)
        until(browser, "document.getElementById('mode-text').textContent.includes('No node offers')", "the reason")
        # A fault that axe must see, so that its silence means something.
        browser.script("document.body.append(Object.assign(document.createElement('img'), { src: 'icon.svg' }))")
        try:
            has_no_severe_fault(browser, "a picture without a text")
        except AssertionError:
            return
        raise AssertionError("axe does not see a picture without a text")


TESTS = [view_has_no_serious_fault_for_axe]
