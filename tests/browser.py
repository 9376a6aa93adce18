"""A headless Chromium without a network, driven through its debugging protocol over a pipe."""

import base64
import json
import os
import shutil
import subprocess
import time

import pytest

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


class Browser:
    """One page of a browser; ends with the `with` block."""

    def __init__(self, profile, width=1280, height=800):
        if CHROMIUM is None:
            pytest.skip("no chromium found; apt-get install chromium")
        to, self._write = os.pipe()
        self._read, back = os.pipe()
        command = [
            CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
            "--remote-debugging-pipe", "--host-resolver-rules=MAP * ~NOTFOUND",
            f"--user-data-dir={profile}", f"--window-size={width},{height}",
        ]  # fmt: skip
        # The browser reads from descriptor 3 and writes to 4.
        shell = ["bash", "-c", f'exec "$@" 3<&{to} 4>&{back}', "bash", *command]
        self._process = subprocess.Popen(shell, pass_fds=(to, back), stderr=subprocess.DEVNULL)
        os.close(to)
        os.close(back)
        self._number, self._left, self.said = 0, b"", []
        target = self._ask("Target.createTarget", {"url": "about:blank"})["targetId"]
        self._session = self._ask("Target.attachToTarget", {"targetId": target, "flatten": True})["sessionId"]
        for domain in ("Runtime", "Log", "Page"):
            self.ask(f"{domain}.enable")
        self.resize(width, height)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._process.terminate()
        self._process.wait(timeout=20)
        os.close(self._write)
        os.close(self._read)

    def _ask(self, method, parameters=None, session=None):
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters or {}}
        if session:
            message["sessionId"] = session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]

    def _next(self):
        while b"\0" not in self._left:
            part = os.read(self._read, 1 << 20)
            assert part, "the browser ended"
            self._left += part
        message, self._left = self._left.split(b"\0", 1)
        message = json.loads(message)
        if message.get("method") in ("Runtime.consoleAPICalled", "Runtime.exceptionThrown", "Log.entryAdded"):
            self.said.append(json.dumps(message["params"])[:2000])
        return message

    def ask(self, method, **parameters):
        """What a method of the protocol answers for the page."""
        return self._ask(method, parameters, self._session)

    def resize(self, width, height, mobile=False):
        size = {"width": width, "height": height, "deviceScaleFactor": 2 if mobile else 1, "mobile": mobile}
        self.ask("Emulation.setDeviceMetricsOverride", **size)
        self.ask("Emulation.setTouchEmulationEnabled", enabled=mobile)

    def open(self, path, fragment=""):
        self.ask("Page.navigate", url=path.resolve().as_uri() + fragment)

    def value(self, expression):
        """The value of an expression in the page; of a promise, what it gives."""
        found = self.ask("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def wait(self, expression, seconds=60):
        """The value of an expression once it is true."""
        end = time.monotonic() + seconds
        while not (found := self.value(expression)):
            assert time.monotonic() < end, f"{expression} did not come true; the page said {self.said}"
            time.sleep(0.02)
        return found

    def mouse(self, kind, x, y, button="left"):
        held = {"mousePressed": 1, "mouseMoved": 1, "mouseReleased": 0}[kind]
        about = {"button": button, "buttons": held, "clickCount": 1}
        self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, **about)

    def drag(self, start, end, steps=8):
        self.mouse("mousePressed", *start)
        for step in range(1, steps + 1):
            share = step / steps
            place = (a + share * (b - a) for a, b in zip(start, end, strict=True))
            self.mouse("mouseMoved", *place)
        self.mouse("mouseReleased", *end)

    def touch(self, start, end, steps=8):
        """A finger put down, moved and lifted."""
        self.ask(
            "Input.dispatchTouchEvent", type="touchStart", touchPoints=[dict(zip("xy", start, strict=True))]
        )
        for step in range(1, steps + 1):
            share = step / steps
            x, y = (a + share * (b - a) for a, b in zip(start, end, strict=True))
            self.ask("Input.dispatchTouchEvent", type="touchMove", touchPoints=[{"x": x, "y": y}])
        self.ask("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def key(self, name, **about):
        """A key pressed and released; `modifiers` 2 is Ctrl, 8 Shift."""
        for kind in ("keyDown", "keyUp"):
            self.ask("Input.dispatchKeyEvent", type=kind, key=name, **about)

    def click(self, name):
        """A click on the element with an id."""
        self.value(f"document.getElementById('{name}').click()")

    def picture(self, path):
        """Save a screenshot."""
        path.write_bytes(base64.b64decode(self.ask("Page.captureScreenshot", format="png")["data"]))
