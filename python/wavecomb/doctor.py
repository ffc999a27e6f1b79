# SPDX-License-Identifier: Apache-2.0
"""Checks the installation and names the command that installs or repairs each part."""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.extras import EXTRAS, install_command, missing_modules

OK, MISSING, BROKEN = "ok", "missing", "broken"


@dataclass(frozen=True)
class Check:
    """Result of one check.

    Attributes:
        name: Name of the checked part for users.
        state: "ok", "missing" or "broken".
        text: A version or an error, one line.
        needed: Whether rendering needs this part.
        do: Command or instruction that fixes the problem; "" if there is no problem.
    """

    name: str
    state: str
    text: str
    needed: bool
    do: str = ""


def examine() -> dict[str, list[Check]]:
    """Runs all checks; returns results by heading. Takes about a second.

    Broken libraries are reported in the results and never raise exceptions.
    """
    return {
        "Wavecomb": [_package(), _try("native library", _native), _try("test image", _picture)],
        "Libraries": [
            _library("OpenUSD", "usd-core", _usd_version),
            _library("OpenImageIO", "openimageio", _oiio_version),
            _library("NumPy", "numpy", _numpy_version),
            _try("Embree", _embree_version),
            _try("oneTBB", _tbb_version),
            _try("OpenSubdiv", _subdiv_version),
            _library("MaterialX", "materialx", _materialx_version, needed=False),
            _openvdb(),
        ],
        "Extras": [_extra(name) for name in EXTRAS] + [_display()],
        "Machine": _machine(),
    }


def is_fit(found: dict[str, list[Check]]) -> bool:
    """Returns whether all parts that are needed for rendering are in the state "ok"."""
    return all(one.state == OK or not one.needed for group in found.values() for one in group)


def as_plain(found: dict[str, list[Check]]) -> dict[str, Any]:
    """Returns the results as plain data for JSON."""
    groups = {name.lower(): [asdict(one) for one in group] for name, group in found.items()}
    return {"schema": "wavecomb-doctor/1", "fit": is_fit(found), **groups}


def lines(found: dict[str, list[Check]]) -> list[str]:
    """Returns the results as lines of text."""
    out: list[str] = []
    width = max(len(one.name) for group in found.values() for one in group)
    for title, group in found.items():
        out.append(title)
        for one in group:
            state = one.state.upper() if one.state == BROKEN else one.state
            out.append(f"  {state:7}  {one.name:{width}}  {one.text}")
            if one.do:
                out.append(f"  {'':7}  {'':{width}}  -> {one.do}")
    return out


def _try(name: str, look: Callable[[], str]) -> Check:
    """Checks a native part by calling ``look``, which returns a description of the part.

    The part counts as broken if ``look`` raises an exception.
    """
    try:
        return Check(name, OK, look(), True)
    # Any exception counts as a failed check.
    except Exception as error:
        return Check(name, BROKEN, _why(error), True, _rebuild())


def _why(error: Exception) -> str:
    """Returns an error as one line."""
    return " ".join(str(error).split()) or type(error).__name__


def _rebuild() -> str:
    """Returns how to rebuild the native part of a source tree or of an installed wheel."""
    is_source = (Path(__file__).resolve().parents[2] / "CMakeLists.txt").is_file()
    return (
        "make build"
        if is_source
        else "pip install --force-reinstall WHEEL, the wheel that was installed"
    )


def _package() -> Check:
    from wavecomb.version import version

    python = ".".join(map(str, sys.version_info[:3]))
    return Check("version", OK, f"{version()}, Python {python}, {Path(__file__).parent}", True)


def _native() -> str:
    from wavecomb.isa import library_text

    return library_text()


def _picture() -> str:
    """Renders a wall under a uniform sky and checks its colour."""
    import time

    import numpy as np

    from wavecomb._core import SceneBuilder, Settings, render

    start = time.perf_counter()
    builder = SceneBuilder()
    paint = builder.add_material("diffuse", name="Paint", base_color=(0.5, 0.5, 0.5))
    points = np.array([[-9, -9, -2], [9, -9, -2], [9, 9, -2], [-9, 9, -2]], np.float32)
    wall = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    builder.add_to_group(0, builder.add_mesh(points, wall, material=paint))
    builder.add_light("dome", np.eye(4), color=(1, 1, 1))
    builder.set_camera(np.eye(4), window=(-0.5, 0.5, -0.5, 0.5))
    result = render(builder.build(), Settings(width=16, height=8, spp=16))
    mean = float(result.beauty.mean())
    if not abs(mean - 0.5) < 0.05:
        raise WavecombError(f"a white sky over a grey wall rendered as {mean:.3g}, not 0.5")
    return f"rendered correctly in {1000 * (time.perf_counter() - start):.0f} ms"


def _library(name: str, package: str, look: Callable[[], str], *, needed: bool = True) -> Check:
    """Checks a library that a Python package provides."""
    try:
        return Check(name, OK, look(), needed)
    except ModuleNotFoundError as error:
        return Check(name, MISSING, _why(error), needed, f"pip install {package}")
    except Exception as error:
        do = f"pip install --force-reinstall {package}"
        return Check(name, BROKEN, _why(error), needed, do)


def _openvdb() -> Check:
    """Checks the OpenVDB plug-in, which is optional."""
    from wavecomb import vdb

    if version := vdb.version():
        nano = vdb.nano_version()
        named = f"NanoVDB {nano}" if nano else "without NanoVDB"
        return Check("OpenVDB", OK, f"{version}, {named}", False)
    do = vdb.BRING if _rebuild() == "make build" else "a wheel that was built with OpenVDB"
    return Check("OpenVDB", MISSING, "volumes are left out", False, do)


def _usd_version() -> str:
    major, *others = importlib.import_module("pxr.Usd").GetVersion()
    return ".".join(f"{part:02d}" for part in ([major] if major else []) + others)


def _oiio_version() -> str:
    return str(importlib.import_module("OpenImageIO").VERSION_STRING)


def _numpy_version() -> str:
    return str(importlib.import_module("numpy").__version__)


def _materialx_version() -> str:
    return str(importlib.import_module("MaterialX").getVersionString())


def _embree_version() -> str:
    """Returns the version of the Embree library that the native core has loaded."""
    import ctypes

    from wavecomb import _core  # noqa: F401

    embree = ctypes.CDLL(_loaded("libembree4"))
    embree.rtcNewDevice.restype = ctypes.c_void_p
    embree.rtcGetDeviceProperty.restype = ctypes.c_ssize_t
    embree.rtcGetDeviceProperty.argtypes = [ctypes.c_void_p, ctypes.c_int]
    embree.rtcReleaseDevice.argtypes = [ctypes.c_void_p]
    device = embree.rtcNewDevice(b"threads=1")
    if not device:
        raise WavecombError("Embree cannot create a device")
    version = embree.rtcGetDeviceProperty(device, 0)  # property 0 is RTC_DEVICE_PROPERTY_VERSION
    embree.rtcReleaseDevice(device)
    return f"{version // 10000}.{version // 100 % 100}.{version % 100}"


def _tbb_version() -> str:
    from wavecomb import _core

    return str(_core.build_info()["tbb"])


def _subdiv_version() -> str:
    from wavecomb import _core  # noqa: F401

    name = Path(_loaded("libosdCPU")).name
    found = re.search(r"so\.([\d.]+)", name)
    return found[1] if found else name


def _loaded(library: str) -> str:
    """Returns the file of a library that this process has loaded."""
    for line in Path("/proc/self/maps").read_text(errors="replace").splitlines():
        path = line[73:].strip() if "/" in line else ""
        if Path(path).name.startswith(library):
            return path
    raise WavecombError(f"{library} is not loaded")


def _extra(name: str) -> Check:
    extra = EXTRAS[name]
    title = f"[{name}]"
    missing = missing_modules(name)
    if missing:
        return Check(
            title, MISSING, f"{extra.brings}: no {', '.join(missing)}", False, install_command(name)
        )
    try:
        for module in extra.modules:
            importlib.import_module(module)
    except ImportError as error:
        what = f"{extra.brings}: {_why(error)}"
        return Check(title, BROKEN, what, False, install_command(name))
    return Check(title, OK, extra.brings, False)


def _display() -> Check:
    """Checks that Qt can start on the display."""
    from wavecomb.gui.needs import NO_DISPLAY, has_display, start_qt

    if not has_display():
        what, _, do = NO_DISPLAY.partition(": ")
        return Check("display", MISSING, what, False, do)
    if missing_modules("gui"):
        return Check("display", OK, "found; Qt is not installed", False)
    platform, problem = start_qt()
    if platform:
        return Check("display", OK, f"Qt opens a window ({platform})", False)
    what, found, do = problem.partition(": apt ")
    return Check("display", BROKEN, what, False, f"apt {do}" if found else "")


def _machine() -> list[Check]:
    """Returns the rows of ``wavecomb info --machine``."""
    from wavecomb.info import machine_info, machine_rows

    try:
        info = machine_info()
    except Exception as error:
        return [Check("machine", BROKEN, _why(error), False, _rebuild())]
    listed_above = ("native", "openvdb", "nanovdb")
    rows = [(name, text) for name, text in machine_rows(info) if name not in listed_above]
    why_not = info["sandbox"]["obstacle"]
    return [
        Check(name, MISSING if name == "sandbox" and why_not else OK, text, False)
        for name, text in rows
    ]
