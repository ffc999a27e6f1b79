# SPDX-License-Identifier: Apache-2.0
"""Tests name and contents of the wheel of `make wheels`. `make test-wheel` runs this."""

from __future__ import annotations

import json
import re
import zipfile
from collections import Counter
from pathlib import PurePosixPath

from wheels import package, succeed

WHEEL = package("wavecomb-*.whl")


def libraries() -> list[PurePosixPath]:
    with zipfile.ZipFile(WHEEL) as archive:
        names = [PurePosixPath(name) for name in archive.namelist()]
    return [name for name in names if ".so" in name.suffixes]


def test_name_is_for_every_python_and_a_glibc() -> None:
    assert re.fullmatch(r"wavecomb-[\d.]+-cp310-abi3-manylinux_2_\d+_x86_64\.whl", WHEEL.name)


def test_auditwheel_finds_that_tag() -> None:
    """The wheel's tag permits all symbols of glibc and libstdc++, and only oneTBB is external."""
    tag = WHEEL.stem.rsplit("-", 1)[1]
    found = json.loads(succeed(["auditwheel", "show", "--json", WHEEL]))
    assert found["sym_tag"] == tag
    assert found["policy_upgrades"][tag] == {"libs_to_eliminate": ["libtbb.so.12"]}
    assert not found["unsupported_isa"]


def test_nothing_travels_twice() -> None:
    names = Counter(name.name for name in libraries() if name.name != "_core.abi3.so")
    assert max(names.values()) == 1, names
    assert "libembree4.so.4" in names
    assert not any(name.startswith("libtbb") for name in names), "oneTBB is its own wheel's"
    assert not any(name.parts[0] == "wavecomb.libs" for name in libraries())


def test_modules_are_of_the_stable_abi() -> None:
    modules = {name.name for name in libraries() if not name.name.startswith("lib")}
    assert (
        {"_core.abi3.so", "_cpu.abi3.so"}
        <= modules
        <= {f"{m}.abi3.so" for m in ("_core", "_cpu", "_vdb")}
    )
