# SPDX-License-Identifier: Apache-2.0
"""The sandbox of a process that reads what others wrote: docs/decisions/sandbox.md.

``enter`` comes before anything of a stage is read: from then on this process writes nowhere but to
folders of its own, opens no socket and starts no program. ``narrow`` comes when the stage is
composed: from then on it reads what the stage named, and what the programs here need.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.picture import files
from wavecomb.run.isolate import landlock, seccomp, trail
from wavecomb.run.isolate.broker import Client, Outputs

MODES = ("auto", "on", "off")

SYSTEM = (
    "/usr", "/lib", "/lib32", "/lib64", "/bin", "/opt", "/nix/store", "/gnu/store",
    "/etc/ld.so.cache", "/etc/ld.so.conf", "/etc/ld.so.conf.d", "/etc/ld.so.preload",
    "/etc/localtime", "/etc/nsswitch.conf", "/etc/passwd", "/etc/group", "/etc/machine-id",
    "/etc/fonts", "/etc/OpenCL", "/etc/alternatives", "/proc", "/sys",
    "/dev/null", "/dev/zero", "/dev/urandom", "/dev/random", "/dev/full", "/dev/tty",
)  # fmt: skip
"""What libraries read. /proc of other processes is refused as tracing them is."""

SEARCHED = (
    "PXR_AR_DEFAULT_SEARCH_PATH",
    "PXR_PLUGINPATH_NAME",
    "PXR_MTLX_PLUGIN_SEARCH_PATHS",
    "PXR_MTLX_STDLIB_SEARCH_PATHS",
    "MATERIALX_SEARCH_PATH",
    "OIIO_LIBRARY_PATH",
    "OCIO",
    "LD_LIBRARY_PATH",
    "PYTHONPATH",
)
"""Variables that name files and folders of the user's own."""

GPU = ("/dev/dri", "/dev/nvidiactl", "/dev/nvidia-uvm", "/dev/nvidia-uvm-tools", "/dev/kfd")
"""For Open Image Denoise, where it is asked for."""


@dataclass
class Box:
    """What holds this process.

    Attributes:
        mode: Of ``MODES``.
        client: Who gives files their names; None: this process does.
        files: Whether Landlock keeps it from writing elsewhere.
        calls: Whether system calls are filtered.
        narrowed: Whether it reads only what was composed.
        gpu: Whether devices may be used.
        own: Folders that it may do anything in.
        listed: Folders whose names it may list.
    """

    mode: str = "auto"
    client: Client | None = None
    files: bool = False
    calls: bool = False
    narrowed: bool = False
    gpu: bool = False
    own: list[str] = field(default_factory=list)
    listed: list[str] = field(default_factory=list)


_box: Box | None = None
_asked = Box()
"""What the supervisor and the options say before ``enter``."""


def ask(mode: str | None = None, client: Client | None = None) -> None:
    """Notes the mode, and who gives files their names, for ``enter``."""
    if mode is not None:
        _asked.mode = mode
    if client is not None:
        _asked.client = client


def current() -> Box | None:
    """What holds this process; None: nothing."""
    return _box


def obstacles() -> list[str]:
    """What of the sandbox this system lacks, in words."""
    found = []
    version = landlock.version()
    if version == 0:
        found.append("no Landlock (Linux 5.13, and among the kernel's LSMs): files are open")
    elif version < 3:
        found.append(f"Landlock {version}, before Linux 6.2: files can be cut short")
    if not seccomp.is_known():
        found.append("no seccomp filter for this machine: sockets and programs are open")
    return found


def enter(
    outputs: Outputs,
    *,
    reads: Iterable[str] | None = None,
    gpu: bool = False,
    temporary: str | None = None,
) -> None:
    """Puts this process, which is expendable and has one thread, into the sandbox.

    Args:
        outputs: What it is going to write.
        reads: All that it is going to read beside the system's; None: a stage says that, later.
        gpu: Whether it may use devices.
        temporary: A folder of its own, where nobody gives files their names: it has no outputs.

    Raises:
        WavecombError: It has to be (``--sandbox on``), and cannot.
    """
    global _box
    mode = _asked.mode
    if _box is not None or mode == "off":
        return
    lacking = obstacles()
    if not trail.is_expendable():
        if mode == "on":
            raise WavecombError("--sandbox on: there is no child process; leave --isolate off out")
        return
    if mode == "on" and lacking:
        raise WavecombError(f"--sandbox on: this system has {lacking[0]}")
    box = Box(mode, _asked.client, gpu=gpu)
    own = [] if temporary is None else [temporary]
    may_write = box.client is not None or not outputs.folders()
    if box.client is not None and landlock.version():
        own = list(box.client.seal(outputs))
        files.publisher = box.client
        temporary = box.client.temporary()
        if temporary is not None:
            import tempfile

            os.environ["TMPDIR"] = temporary
            tempfile.tempdir = None
    box.own, box.listed = own, outputs.folders()
    try:
        landlock.no_new_privileges()
        landlock.drop_capabilities()
        if landlock.version() and may_write:
            refused = landlock.known(0xFFFF & ~landlock.READS)
            rules = landlock.Ruleset(refused, network=True)
            rules.allow(own, landlock.KEEPS)
            rules.allow(_devices(gpu), landlock.WRITE_FILE | landlock.IOCTL_DEV)
            rules.apply()
            box.files = True
        if seccomp.is_known():
            seccomp.apply()
            box.calls = True
    except OSError as error:
        if mode == "on":
            raise WavecombError(f"--sandbox on: the system refuses it: {error}") from None
    _box = box
    if reads is not None:
        narrow(reads)


def _devices(gpu: bool) -> list[str]:
    names = ["/dev/null", "/dev/full", "/dev/zero", "/dev/tty"]
    if gpu:
        names += [*GPU, *(str(path) for path in Path("/dev").glob("nvidia[0-9]*"))]
    return names


def is_to_be_narrowed() -> bool:
    """Whether ``narrow`` would do something."""
    return _box is not None and _box.files and not _box.narrowed


def narrow(paths: Iterable[str]) -> None:
    """From now on this process, all its threads, reads these files and folders and the system's.

    Raises:
        WavecombError: It has to be, and cannot.
    """
    box = _box
    if box is None or not is_to_be_narrowed():
        return
    rules = landlock.Ruleset(landlock.READS)
    try:
        rules.allow(library_places(), landlock.READS)
        # Names may be listed where files are written; what is in them is nobody's business.
        rules.allow(box.listed, landlock.READ_DIR)
        rules.allow(box.own, landlock.READS)
        rules.allow(_devices(box.gpu), landlock.READS)
        rules.allow(paths, landlock.READS)
        if len(os.listdir("/proc/self/task")) == 1:
            rules.apply()
        else:
            from wavecomb import _core

            _core.restrict_threads(rules.descriptor)
            rules.close()
        box.narrowed = True
    except (OSError, ValueError) as error:
        if box.mode == "on":
            raise WavecombError(f"--sandbox on: the system refuses it: {error}") from None


def library_places() -> list[str]:
    """Files and folders of programs: the system's, Python's, and what variables name."""
    import wavecomb

    places: list[str | None] = [
        *SYSTEM, sys.prefix, sys.base_prefix, sys.exec_prefix, sys.base_exec_prefix,
        *wavecomb.__path__,
    ]  # fmt: skip
    here = os.path.realpath(os.getcwd())
    places += [p for p in sys.path if p and os.path.realpath(p) != here and not holds_home(p)]
    for name in SEARCHED:
        places += os.environ.get(name, "").split(os.pathsep)
    places += _mapped()
    return list(dict.fromkeys(path for path in places if path and os.path.isabs(path)))


def holds_home(path: str) -> bool:
    """Whether a folder is the user's home or above it: too much to be read for one file."""
    home, folder = os.path.realpath(os.path.expanduser("~")), os.path.realpath(path)
    return os.path.commonpath([home, folder]) == folder


def _mapped() -> list[str]:
    """Folders of the libraries that are loaded."""
    try:
        lines = Path("/proc/self/maps").read_text(errors="replace").splitlines()
    except OSError:
        return []
    named = {line.split(maxsplit=5)[5] for line in lines if line.count(" /") and ".so" in line}
    return [os.path.dirname(name) for name in named if name.startswith("/")]


def describe() -> dict[str, Any]:
    """What the sandbox of this system is, for ``wavecomb info --machine``."""
    version = landlock.version()
    return {
        "landlock": version,
        "files": version > 0,
        "tcp": version >= 4,
        "signals": version >= 6 or seccomp.is_known(),
        "seccomp": seccomp.is_known(),
        "lacks": obstacles(),
    }
