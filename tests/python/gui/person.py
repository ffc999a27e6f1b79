# SPDX-License-Identifier: Apache-2.0
"""A simulated user: an X server, a window manager, a mouse and a keyboard (xdotool)."""

import contextlib
import json
import os
import select
import subprocess
import sys
import time
from pathlib import Path

WINDOW = Path(__file__).with_name("person_window.py")
WIDE, HIGH = 1280, 800


@contextlib.contextmanager
def screen():
    """Starts an X server with a window manager and yields its DISPLAY."""
    read, write = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", f"{WIDE}x{HIGH}x24", "-nolisten", "tcp"],
        pass_fds=[write], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    os.close(write)
    manager = None
    try:
        with os.fdopen(read) as pipe:
            number = pipe.readline().strip()
        assert number, "Xvfb did not start"
        display = f":{number}"
        manager = subprocess.Popen(
            ["openbox"], env=os.environ | {"DISPLAY": display},
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        yield display
    finally:
        for process in (manager, server):
            if process is not None:
                process.terminate()
                process.wait(10)


class Person:
    """A simulated user who sees one window and operates it through the X server."""

    def __init__(self, display, home, *arguments, size=(160, 120), spp=4):
        self.home = Path(home)
        read, write = os.pipe()
        self.env = os.environ | {
            "DISPLAY": display, "QT_QPA_PLATFORM": "xcb", "HOME": str(home),
            "XDG_CONFIG_HOME": str(self.home / "config"), "XDG_DATA_HOME": str(self.home / "data"),
            "XDG_RUNTIME_DIR": str(self.home), "PYTHONUNBUFFERED": "1",
        }  # fmt: skip
        for name in ("QT_SCALE_FACTOR", "QT_LOGGING_RULES", "WAVECOMB_DEBUG"):
            self.env.pop(name, None)
        options = ["--size", *map(str, size), "--spp", str(spp)]
        self.err = (self.home / "stderr.txt").open("w+")
        self.process = subprocess.Popen(
            [sys.executable, str(WINDOW), str(write), "view", *map(str, arguments), *options],
            env=self.env, pass_fds=[write], stdin=subprocess.PIPE, stdout=self.err, stderr=self.err,
            text=True,
        )  # fmt: skip
        os.close(write)
        self._answers = os.fdopen(read)
        self.wait(lambda: self.ask("state")["active"] is not None, "the window to have the focus")

    # ---- looking -------------------------------------------------------------------------------

    def ask(self, *question, seconds=60):
        """Calls a method of ``person_window.Look`` in the window's process."""
        self.process.stdin.write(json.dumps(question) + "\n")
        self.process.stdin.flush()
        ready, _, _ = select.select([self._answers], [], [], seconds)
        assert ready, f"no answer to {question} within {seconds} s: {self.told()}"
        line = self._answers.readline()
        assert line, f"the window has gone at {question}: {self.told()}"
        return json.loads(line)

    def wait(self, met, what, seconds=90):
        """Waits until a condition is met."""
        until = time.monotonic() + seconds
        while not met():
            assert self.process.poll() is None, f"the window has gone: {self.told()}"
            assert time.monotonic() < until, f"waited for {what}: {self.ask('state')}"
            time.sleep(0.03)

    def settled(self):
        """Waits until the newest image is complete and displayed."""

        def met():
            state = self.ask("state")
            return not state["busy"] and state["final"] and state["shown"]

        self.wait(met, "the last picture")
        return self.ask("state")

    def told(self):
        """Returns the output of the process on stdout and stderr."""
        return (self.home / "stderr.txt").read_text()

    def faults(self):
        """Returns the crash reports."""
        return [str(path) for path in (self.home / "data").rglob("fault*")]

    def look(self, path):
        """Saves a screenshot and returns its pixels (h, w, 3) from 0 to 1."""
        import OpenImageIO as oiio

        assert self.ask("grab", str(path))
        pixels = oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT)
        assert pixels.shape[:2] == (HIGH, WIDE)
        return pixels[..., :3]

    def picture(self, path):
        """Returns the part of the screen that shows the rendered image."""
        x, y, wide, high = self.ask("picture")
        return self.look(path)[y : y + high, x : x + wide]

    # ---- hands ---------------------------------------------------------------------------------

    def do(self, *words):
        """Runs xdotool."""
        subprocess.run(
            ["xdotool", *map(str, words)], env=self.env, check=True, capture_output=True, timeout=30
        )

    def click(self, rect, button=1):
        """Clicks the centre of a rectangle."""
        assert rect is not None
        x, y, wide, high = rect
        self.do("mousemove", x + wide // 2, y + high // 2, "sleep", 0.03, "click", button)

    def drag(self, start, by, button=2):
        """Drags in steps with a pressed button."""
        words = ["mousemove", *start, "mousedown", button]
        for step in range(1, 7):
            words += ["mousemove", start[0] + by[0] * step // 6, start[1] + by[1] * step // 6]
            words += ["sleep", 0.02]
        self.do(*words, "mouseup", button)

    def key(self, *keys):
        """Presses keys such as "ctrl+z"."""
        self.do("key", "--delay", 20, *keys)

    def type(self, text):
        """Types text."""
        self.do("type", "--delay", 12, text)

    def menu(self, title, entry):
        """Chooses an entry of the menu bar."""
        self.click(self.ask("menu", title))
        self.wait(lambda: self.ask("menu", title, entry), f"the menu {title}")
        self.click(self.ask("menu", title, entry))

    def answer(self, dialog, text):
        """Types a name into a dialog and confirms it."""
        self.wait(lambda: self.ask("state")["active"] == dialog, f"a {dialog}")
        # The dialog reads its folder first.
        self.wait(lambda: (self.ask("focus") or [""])[0] == "QLineEdit", "a field for the name")
        self.key("ctrl+a")
        self.type(text)
        self.wait(lambda: self.ask("field") == text, "the name to be typed")
        self.key("Return")
        self.wait(lambda: self.ask("state")["active"] != dialog, f"the {dialog} to close")

    def leave(self):
        """Quits by keyboard, and asserts that there is no output and no crash report."""
        self.key("ctrl+q")
        try:
            assert self.process.wait(30) == 0, self.told()
        finally:
            self.close()
        assert self.told() == ""
        assert self.faults() == []

    def close(self):
        """Ends the process, whatever its state."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait(10)
        self.process.stdin.close()
        self._answers.close()
        self.err.close()
