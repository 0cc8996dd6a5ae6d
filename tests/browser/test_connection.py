"""A daemon that dies and comes back under the open page, and a proxy in between."""

from collections.abc import Callable

from playwright.sync_api import Page, Request, expect

from tests.browser.daemons import Daemon
from tests.browser.proxy import proxied

Open = Callable[..., Page]


def test_a_dead_daemon_looks_dead_and_comes_back_by_itself(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.address)
    canvas, home = page.locator("canvas").first, page.get_by_role("button", name="Home pan", exact=True)
    expect(canvas).to_have_attribute("data-points", "20")
    expect(home).to_be_enabled()
    page.evaluate("window.opened = true")
    room = page.locator(".frame").bounding_box()
    daemon.kill()
    expect(page.get_by_role("alert").get_by_text("The daemon does not answer")).to_be_visible()
    expect(home).to_be_disabled()
    expect(canvas).to_be_hidden()
    expect(canvas).not_to_have_attribute("data-points", "20")
    after = page.locator(".frame").bounding_box()
    assert room is not None
    assert after is not None
    assert after["height"] == room["height"]  # what is below has not moved under anybody's finger
    expect(page.locator(".position").first).to_have_text("–")
    in_3d = page.get_by_role("region", name="Rig in 3-D")
    expect(in_3d).to_contain_text("not known without a connection")
    page.keyboard.press("Escape")
    expect(page.get_by_text("Use the switch that cuts the motors")).to_be_visible()
    daemon.start()
    expect(home).to_be_enabled()
    expect(canvas).to_have_attribute("data-points", "20")
    expect(page.get_by_text("The daemon does not answer. Nothing")).to_be_hidden()
    expect(in_3d).to_contain_text("once the rig is calibrated")
    assert page.evaluate("window.opened")  # it was not loaded again


def test_it_works_under_a_path_of_a_proxy_and_asks_nothing_elsewhere(daemon: Daemon, open_page: Open) -> None:
    with proxied(daemon.address) as address:
        page = open_page("about:blank")
        asked: list[str] = []

        def note(request: Request) -> None:
            asked.append(request.url)

        page.on("request", note)
        page.on("websocket", lambda socket: asked.append(socket.url.replace("ws", "http", 1)))
        page.goto(address)
        expect(page.locator("canvas").first).to_have_attribute("data-points", "20")
        page.get_by_role("link", name="Judge").click()
        expect(page.get_by_role("heading", name="Verdict")).to_be_visible()
        page.keyboard.press("Escape")
        expect(page.get_by_role("button", name="Acknowledge")).to_be_visible()
        page.get_by_role("button", name="Acknowledge").click()
        expect(page.get_by_role("button", name="Acknowledge")).to_be_hidden()
        page.close()
    assert any(url.endswith("/api/v1/live") for url in asked)
    assert all(url.startswith(address) for url in asked)


def test_nothing_is_asked_of_the_camera_for_a_tab_that_nobody_sees(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.address, bypass_csp=True)  # which has no room for what is waited for here
    expect(page.locator("canvas").first).to_have_attribute("data-points", "20")
    page.evaluate("""() => {
      window.asked = 0;
      const send = WebSocket.prototype.send;
      WebSocket.prototype.send = function (data) { if (data === "next") window.asked += 1; send.call(this, data); };
      Object.defineProperty(document, "hidden", { configurable: true, get: () => window.away });
    }""")
    page.wait_for_function("window.asked > 2")
    page.evaluate("window.away = true; document.dispatchEvent(new Event('visibilitychange'))")
    expect(page.locator(".rate")).to_have_text("")
    asked = page.evaluate("window.asked")
    page.evaluate("window.away = false; document.dispatchEvent(new Event('visibilitychange'))")
    page.wait_for_function(f"window.asked > {asked} + 2")
