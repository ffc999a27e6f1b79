# SPDX-License-Identifier: Apache-2.0
"""Wavecomb: a CPU path tracer for OpenUSD stages.

>>> import wavecomb
>>> picture = wavecomb.render("mixed.usdc", size=(600, 600), spp=64)  # doctest: +SKIP
>>> picture.save("mixed.exr")  # doctest: +SKIP

Names are imported on first use, so that ``import wavecomb`` itself is fast.
"""

import _signal  # type: ignore[import-not-found]  # built in, so that its import takes no time
import sys


def _is_command() -> bool:
    """Returns whether this process runs the command ``wavecomb`` instead of a user's program.

    ``sys.argv`` is ``["-m", ...]`` while ``python -m`` imports a package. A process of
    ``multiprocessing`` copies ``sys.argv`` from its parent.
    """
    words, given = sys.orig_argv, sys.argv
    return 0 < len(given) <= len(words) and words[-len(given)].rpartition("/")[2] == "wavecomb"


# Ctrl-C ends the command without a traceback until the command installs its handlers
# (wavecomb.run.progress.keep_interrupts). The import of `typing` alone takes milliseconds.
if _is_command() and _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler:
    try:  # noqa: SIM105 (contextlib takes time to import)
        _signal.signal(_signal.SIGINT, _signal.SIG_DFL)
    except ValueError:  # not the main thread
        pass

from typing import TYPE_CHECKING, Any  # noqa: E402

from wavecomb import isa  # noqa: E402

isa.install()

if TYPE_CHECKING:
    from wavecomb import scenes
    from wavecomb._core import Scene, SceneBuilder, Settings
    from wavecomb.api import load, render
    from wavecomb.errors import Error, WavecombError
    from wavecomb.image import cryptomatte
    from wavecomb.image.compare.comparison import Comparison, compare
    from wavecomb.image.rendered import Picture
    from wavecomb.renderer import Renderer
    from wavecomb.run.sequence import render_frames
    from wavecomb.scheduling import SchedulingPolicy
    from wavecomb.window import Window, view

    __version__: str

__all__ = [
    "Comparison",
    "Error",
    "Picture",
    "Renderer",
    "Scene",
    "SceneBuilder",
    "SchedulingPolicy",
    "Settings",
    "WavecombError",
    "Window",
    "__version__",
    "compare",
    "cryptomatte",
    "load",
    "render",
    "render_frames",
    "scenes",
    "view",
]

_HOMES = {
    "Comparison": "wavecomb.image.compare.comparison",
    "Error": "wavecomb.errors",
    "Picture": "wavecomb.image.rendered",
    "Renderer": "wavecomb.renderer",
    "Scene": "wavecomb._core",
    "SceneBuilder": "wavecomb._core",
    "SchedulingPolicy": "wavecomb.scheduling",
    "Settings": "wavecomb._core",
    "WavecombError": "wavecomb.errors",
    "Window": "wavecomb.window",
    "compare": "wavecomb.image.compare.comparison",
    "load": "wavecomb.api",
    "render": "wavecomb.api",
    "render_frames": "wavecomb.run.sequence",
    "view": "wavecomb.window",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from wavecomb.version import version

        value: Any = version()
    elif name == "cryptomatte":
        from wavecomb.image import cryptomatte as value
    elif name == "scenes":
        # The statement `from wavecomb import scenes` would call this function again, without end.
        from importlib import import_module

        value = import_module("wavecomb.scenes")
    elif name in _HOMES:
        from importlib import import_module

        value = getattr(import_module(_HOMES[name]), name)
    else:
        raise AttributeError(f"module 'wavecomb' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
