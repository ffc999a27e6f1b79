# SPDX-License-Identifier: Apache-2.0
"""Standard output and error of commands; ``Stream`` cleans all text for a terminal.

Commands print each message with ``say`` or with a string for ``console``. Both also escape
newlines, so that a newline in a name or path cannot forge a line of output. Only help, JSON and the
code for completion are printed as several lines at once.

Names of prims and files and messages of libraries may contain control characters, which would move
the cursor, hide text or change the window's title. ``Stream`` writes control characters as escapes.
If a stream is closed, its reader has ended or the disk is full, text is lost, but the render
continues.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import re
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

_CONTROL = re.compile(
    # Control characters that are removed from text: the C0 set except tab and newline, the delete
    # character, and the C1 set.
    "[\x00-\x08\x0b-\x1f\x7f-\x9f"
    "\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufeff"  # text direction and separators
    "\ud800-\udfff]"  # bytes of file names that are not UTF-8
)


def clean(text: str) -> str:
    r"""Escapes the control characters of a text except tabs and newlines.

    >>> clean("a\x1b[31mb"), clean("a\udcffb"), clean("\u202egpj.exe")
    ('a\\x1b[31mb', 'a\\xffb', '\\u202egpj.exe')
    """
    return _CONTROL.sub(_escape, text)


def one_line(text: str) -> str:
    r"""Escapes the control characters of a text including newlines.

    >>> one_line("a\nwrote b.exr")
    'a\\nwrote b.exr'
    """
    return clean(text).replace("\n", "\\n")


def say(*lines: str, err: bool = False) -> None:
    """Prints messages, each of which becomes one line.

    Args:
        *lines: The messages.
        err: Whether to print on standard error.
    """
    stream = sys.stderr if err else sys.stdout
    if stream is not None:
        stream.write("".join(f"{one_line(line)}\n" for line in lines))
        stream.flush()


def _escape(match: re.Match[str]) -> str:
    code = ord(match[0])
    # Python represents undecodable bytes of file names by surrogates.
    if 0xDC80 <= code <= 0xDCFF:
        code -= 0xDC00
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


class _Raw(io.FileIO):
    """Wrapper of a file descriptor that never raises an exception when writing.

    Attributes:
        error: The first error that occurred while writing.
    """

    error: OSError | None = None

    def write(self, data: Any) -> int:
        try:
            return super().write(data)
        except OSError as error:
            self.error = self.error or error
            return len(data)


class Stream(io.TextIOWrapper):
    """Standard output or standard error.

    Attributes:
        plain: The same stream without escaping, for text whose control characters are intended.
    """

    def __init__(self, number: int, encoding: str, *, is_prompt: bool, owns: bool = False) -> None:
        """Creates a stream for a descriptor.

        Args:
            number: The descriptor.
            encoding: Encoding of the text; ASCII is replaced by UTF-8.
            is_prompt: Whether each line is written immediately.
            owns: Whether closing the stream also closes the descriptor.
        """
        self._raw = _Raw(number, "w", closefd=owns)
        if encoding.lower() in ("ascii", "us-ascii", "ansi_x3.4-1968", "646"):
            encoding = "utf-8"
        super().__init__(
            io.BufferedWriter(self._raw), encoding, "backslashreplace",
            line_buffering=is_prompt or self._raw.isatty(), write_through=is_prompt,
        )  # fmt: skip
        self.plain = _Plain(self)

    @property
    def error(self) -> OSError | None:
        """Reason why text was lost; None if no text was lost, or if the reader closed the pipe."""
        error = self._raw.error
        return None if error is None or error.errno == errno.EPIPE else error

    def write(self, text: str) -> int:
        """Writes text with escaped control characters."""
        super().write(clean(text))
        return len(text)

    def write_plain(self, text: str) -> int:
        """Writes text unchanged."""
        return super().write(text)


class _Plain:
    """A wrapper of a stream that does not escape control characters, for output of Rich."""

    def __init__(self, stream: Stream) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        return self._stream.write_plain(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


_NAMES = ("stdout", "stderr")


def guard_streams() -> None:
    """Replaces standard output and error by ``Stream`` objects, and opens closed descriptors.

    If descriptor 0, 1 or 2 were closed, the next opened file would get its number and thus receive
    messages. Streams that a program or a test has already replaced stay unchanged.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            other = os.open(os.devnull, os.O_RDWR)
            if other != number:
                os.dup2(other, number)
                os.close(other)
            os.set_inheritable(number, True)
    for number, name in enumerate(_NAMES, 1):
        before = getattr(sys, name)
        if before is not getattr(sys, f"__{name}__") or isinstance(before, Stream):
            continue
        if before is not None:
            with contextlib.suppress(OSError, ValueError):
                before.flush()
        encoding = "utf-8" if before is None else before.encoding
        stream = Stream(number, encoding, is_prompt=name == "stderr")
        _replaced.append(before)
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)


_replaced: list[Any] = []
"""The replaced streams, which stay referenced, since closing them may close their descriptors."""


def flush_streams() -> OSError | None:
    """Flushes standard output and error; returns the error that made standard output lose text."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            with contextlib.suppress(OSError, ValueError):
                stream.flush()
    return sys.stdout.error if isinstance(sys.stdout, Stream) else None


def write_error(text: str) -> None:
    """Writes text to descriptor 2 even without a stream object; ignores errors."""
    with contextlib.suppress(OSError):
        os.write(2, clean(text).encode(errors="backslashreplace"))


def console(**options: Any) -> Console:
    """Returns a Rich console that escapes control characters in strings, including newlines.

    Args:
        **options: Arguments of Rich's Console.
    """
    from rich.console import Console
    from rich.text import Text

    class Cleaning(Console):
        def render_str(self, text: str, **how: Any) -> Text:
            return super().render_str(one_line(text), **how)

    stream = sys.stderr if options.get("stderr") else sys.stdout
    if isinstance(stream, Stream):
        options = {"file": stream.plain, **options}
    return Cleaning(emoji=False, **options)


@contextlib.contextmanager
def lines_above(console: Console) -> Iterator[None]:
    """Prints text of standard output and error above a progress bar while the bar is shown."""
    from rich.file_proxy import FileProxy

    class Proxy(FileProxy):
        def write(self, text: str) -> int:
            return super().write(clean(text))

    before = [getattr(sys, name) for name in _NAMES]
    for name, stream in zip(_NAMES, before, strict=True):
        if stream is not None and console.is_terminal:
            setattr(sys, name, Proxy(console, stream))
    try:
        yield
    finally:
        for name, stream in zip(_NAMES, before, strict=True):
            proxy = getattr(sys, name)
            if isinstance(proxy, Proxy):
                proxy.flush()
                setattr(sys, name, stream)
