# SPDX-License-Identifier: Apache-2.0
"""A filter of system calls: what Landlock does not keep a process from.

No sockets of any kind, no programs, nothing of other processes, no rights of files, no keys typed
into the terminal, and nothing of the system that only those who run it need.
"""

from __future__ import annotations

import ctypes
import errno
import os
import platform
import struct
import sys

# Of linux/bpf_common.h and linux/seccomp.h.
_LOAD, _EQUAL, _AT_LEAST, _ANY_BIT, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
_ALLOW, _ERRNO = 0x7FFF0000, 0x00050000
_NUMBER, _MACHINE, _ARGUMENTS = 0, 4, 16
_SET_MODE_FILTER, _ALL_THREADS = 1, 1

_TIOCSTI, _TIOCLINUX = 0x5412, 0x541C
_NEW_NAMESPACES = 0x7E020000
"""Flags of clone."""

# name: (x86_64, aarch64)
_REFUSED = {
    "socket": (41, 198),
    "execve": (59, 221), "execveat": (322, 281),
    "ptrace": (101, 117), "process_vm_readv": (310, 270), "process_vm_writev": (311, 271),
    "pidfd_getfd": (438, 438), "pidfd_send_signal": (424, 424), "process_madvise": (440, 440),
    "process_mrelease": (448, 448), "tkill": (200, 130), "rt_sigqueueinfo": (129, 138),
    "rt_tgsigqueueinfo": (297, 240),
    "chmod": (90, None), "fchmod": (91, 52), "fchmodat": (268, 53), "fchmodat2": (452, 452),
    "chown": (92, None), "lchown": (94, None), "fchown": (93, 55), "fchownat": (260, 54),
    "setxattr": (188, 5), "lsetxattr": (189, 6), "fsetxattr": (190, 7), "setxattrat": (463, 463),
    "removexattr": (197, 14), "lremovexattr": (198, 15), "fremovexattr": (199, 16),
    "removexattrat": (466, 466),
    "utime": (132, None), "utimes": (235, None), "futimesat": (261, None), "utimensat": (280, 88),
    "io_uring_setup": (425, 425), "io_uring_enter": (426, 426), "io_uring_register": (427, 427),
    "mount": (165, 40), "umount2": (166, 39), "pivot_root": (155, 41), "chroot": (161, 51),
    "fsopen": (430, 430), "fsconfig": (431, 431), "fsmount": (432, 432), "fspick": (433, 433),
    "open_tree": (428, 428), "move_mount": (429, 429), "mount_setattr": (442, 442),
    "unshare": (272, 97), "setns": (308, 268), "open_by_handle_at": (304, 265),
    "bpf": (321, 280), "perf_event_open": (298, 241), "fanotify_init": (300, 262),
    "keyctl": (250, 219), "add_key": (248, 217), "request_key": (249, 218),
    "kexec_load": (246, 104), "kexec_file_load": (320, 294), "init_module": (175, 105),
    "finit_module": (313, 273), "delete_module": (176, 106), "acct": (163, 89),
    "swapon": (167, 224), "swapoff": (168, 225), "reboot": (169, 142), "quotactl": (179, 60),
    "sethostname": (170, 161), "setdomainname": (171, 162), "settimeofday": (164, 170),
    "clock_settime": (227, 112), "adjtimex": (159, 171), "clock_adjtime": (305, 266),
    "syslog": (103, 116), "iopl": (172, None), "ioperm": (173, None),
}  # fmt: skip
_IOCTL, _KILL, _TGKILL, _PRLIMIT = (16, 29), (62, 129), (234, 131), (302, 261)
_CLONE, _CLONE3 = (56, 220), 435

_MACHINES = {"x86_64": (0, 0xC000003E), "aarch64": (1, 0xC00000B7)}
"""Column of the table, and AUDIT_ARCH."""
_SECCOMP = {"x86_64": 317, "aarch64": 277}


def is_known() -> bool:
    """Whether there is a filter for this system, which may have it."""
    return (
        sys.platform == "linux"
        and platform.machine() in _MACHINES
        and struct.calcsize("P") == 8
        and sys.byteorder == "little"
        and os.path.exists("/proc/sys/kernel/seccomp/actions_avail")
    )


def _step(code: int, value: int, yes: int = 0, no: int = 0) -> bytes:
    return struct.pack("=HBBI", code, yes, no, value & 0xFFFFFFFF)


def _fail(number: int) -> bytes:
    return _step(_RETURN, _ERRNO | number)


def _when(call: int, *checks: bytes) -> list[bytes]:
    """Steps for one system call, which end in an answer; with its number loaded again after."""
    steps = [*checks, _step(_RETURN, _ALLOW)]
    return [_step(_EQUAL, call, 0, len(steps)), *steps]


def _argument(index: int, upper: bool = False) -> bytes:
    return _step(_LOAD, _ARGUMENTS + 8 * index + 4 * upper)


def program() -> bytes:
    """The filter, for this process: instructions of classic BPF."""
    column, machine = _MACHINES[platform.machine()]
    steps = [_step(_LOAD, _MACHINE), _step(_EQUAL, machine, 1, 0), _fail(errno.ENOSYS)]
    steps += [_step(_LOAD, _NUMBER)]
    if column == 0:  # x32 has numbers of its own
        steps += [_step(_AT_LEAST, 0x40000000, 0, 1), _fail(errno.ENOSYS)]
    for numbers in _REFUSED.values():
        if (number := numbers[column]) is not None:
            steps += [_step(_EQUAL, number, 0, 1), _fail(errno.EACCES)]
    # What it holds cannot be looked at; the C library goes on with clone.
    steps += [_step(_EQUAL, _CLONE3, 0, 1), _fail(errno.ENOSYS)]
    steps += _when(_CLONE[column], _argument(0), _step(_ANY_BIT, _NEW_NAMESPACES, 0, 1),
                   _fail(errno.EPERM))  # fmt: skip
    steps += _when(
        _IOCTL[column], _argument(1), _step(_EQUAL, _TIOCSTI, 1, 0),
        _step(_EQUAL, _TIOCLINUX, 0, 1), _fail(errno.EPERM),
    )  # fmt: skip
    own = os.getpid()
    # Signal 0 only asks whether a process is there.
    steps += _when(
        _KILL[column], _argument(1), _step(_EQUAL, 0, 3, 0), _argument(0),
        _step(_EQUAL, own, 1, 0), _fail(errno.EPERM),
    )  # fmt: skip
    steps += _when(_TGKILL[column], _argument(0), _step(_EQUAL, own, 1, 0), _fail(errno.EPERM))
    steps += _when(
        _PRLIMIT[column], _argument(0), _step(_EQUAL, 0, 2, 0), _step(_EQUAL, own, 1, 0),
        _fail(errno.EPERM),
    )  # fmt: skip
    return b"".join([*steps, _step(_RETURN, _ALLOW)])


def apply() -> None:
    """Filters the calls of all threads of this process, which has no_new_privs. Raises OSError."""
    code = program()
    buffer = ctypes.create_string_buffer(code, len(code))
    head = struct.pack("=H6xQ", len(code) // 8, ctypes.addressof(buffer))
    libc = ctypes.CDLL(None, use_errno=True)
    result = libc.syscall(_SECCOMP[platform.machine()], _SET_MODE_FILTER, _ALL_THREADS, head)
    if result != 0:
        error = ctypes.get_errno()
        raise OSError(error, os.strerror(error))
