# SPDX-License-Identifier: Apache-2.0
"""Tests `wavecomb doctor`: installed and missing parts, and commands that install them."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from parts import needs

from wavecomb import doctor
from wavecomb.cli import main
from wavecomb.errors import WavecombError
from wavecomb.extras import EXTRAS, check_installed, install_command, missing_modules
from wavecomb.gui import needs as qt

try:
    import tomllib
except ModuleNotFoundError:
    import tomli as tomllib  # type: ignore[no-redef]


PYPROJECT = Path(__file__).resolve().parents[2] / "pyproject.toml"


def run(*arguments: str) -> Result:
    return CliRunner().invoke(main, ["doctor", *arguments])


@needs("wavecomb._core", "pxr", "OpenImageIO", "MaterialX")
def test_a_machine_that_is_well() -> None:
    found = doctor.examine()
    by_name = {one.name: one for group in found.values() for one in group}
    assert doctor.is_fit(found)
    assert "rendered correctly" in by_name["test image"].text
    assert by_name["Embree"].text.startswith("4.")
    assert by_name["OpenUSD"].text[:1].isdigit()
    assert "lanes" in by_name["native library"].text
    assert set(found) == {"Wavecomb", "Libraries", "Extras", "Machine"}
    text = "\n".join(doctor.lines(found))
    for name in ("OpenUSD", "MaterialX", "Embree", "[denoise]", "[gui]", "[farm]", "sandbox"):
        assert name in text


def test_what_is_missing_comes_with_its_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "missing_modules", lambda name: ["pyoidn"])
    monkeypatch.setattr(doctor, "_usd_version", _not_there)
    monkeypatch.setattr(doctor, "_picture", _wrong)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.delenv("QT_QPA_PLATFORM", raising=False)
    result = run()
    assert result.exit_code == 2
    lines = result.stdout.splitlines()

    def after(name: str) -> list[str]:
        at = next(k for k, line in enumerate(lines) if name in line)
        return lines[at : at + 2]

    assert "missing" in after("OpenUSD")[0] and "pip install usd-core" in after("OpenUSD")[1]
    assert "missing" in after("[denoise]")[0]
    assert "pip install 'pyoidn>=2.5'" in after("[denoise]")[1]
    assert "BROKEN" in after("test image")[0] and "make build" in after("test image")[1]
    assert "set DISPLAY" in after("display")[1]
    plain = json.loads(run("--json").stdout)
    assert plain["fit"] is False and plain["schema"] == "wavecomb-doctor/1"
    assert {one["state"] for one in plain["extras"]} == {"missing"}


def test_a_missing_extra_is_no_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "missing_modules", lambda name: ["nothing"])
    assert doctor.is_fit({"Extras": [doctor._extra(name) for name in EXTRAS]})


def _not_there() -> str:
    raise ModuleNotFoundError("No module named 'pxr'")


def _wrong() -> str:
    raise WavecombError("a white sky over a grey wall rendered as 0, not 0.5")


def test_extras_are_those_of_the_project(pytestconfig: Any) -> None:
    project = tomllib.loads((pytestconfig.rootpath / "pyproject.toml").read_text())["project"]
    there = {name for name in project["optional-dependencies"]}
    assert set(EXTRAS) <= there
    for name in EXTRAS:
        wanted = " ".join(project["optional-dependencies"][name]).lower().replace("-", "_")
        for module in EXTRAS[name].modules:
            assert module.partition(".")[0].lower() in wanted


def test_an_extra_is_asked_for_without_importing_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    before = set(sys.modules)
    assert missing_modules("gui") == ["PySide6", "pyqtgraph"]
    with pytest.raises(WavecombError, match=r"the window needs PySide6 and pyqtgraph: pip install"):
        check_installed("gui", "the window")
    assert "PySide6" not in set(sys.modules) - before


@pytest.mark.parametrize("extra", sorted(EXTRAS))
def test_install_commands_name_the_packages_of_an_extra(extra: str) -> None:
    with PYPROJECT.open("rb") as file:
        listed = tomllib.load(file)["project"]["optional-dependencies"][extra]
    names = {re.split(r"[<>=]", line)[0] for line in listed}
    command = install_command(extra)
    assert command.startswith("pip install '")
    assert set(re.findall(r"'([A-Za-z][\w-]*)[<>=~!]", command)) == names
    assert len(re.findall("'", command)) == 2 * len(names)


def test_qt_libraries_that_are_missing_come_with_their_packages(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """From ldd's list of missing libraries, doctor and the window name the packages to install."""
    ldd = tmp_path / "ldd"
    ldd.write_text(
        "#!/bin/sh\n"
        "echo '  libxcb-icccm.so.4 => not found'\n"
        "echo '  libxcb-keysyms.so.1 => not found'\n"
        "echo '  libc.so.6 => /lib/libc.so.6 (0x0)'\n"
    )
    ldd.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    missing = qt.missing_libraries("libqxcb.so")
    assert missing == ["libxcb-icccm.so.4", "libxcb-keysyms.so.1"]
    assert qt.libraries_message(missing).endswith("apt install libxcb-icccm4 libxcb-keysyms1")


@needs("PySide6.QtWidgets")
def test_the_display_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    assert doctor._display().text == "Qt opens a window (offscreen)"
    monkeypatch.setenv("QT_QPA_PLATFORM", "nonsense")
    assert doctor._display().state == "broken"
    monkeypatch.setattr(qt, "missing_libraries", lambda: ["libxcb-icccm.so.4"])
    found = doctor._display()
    assert (found.state, found.do) == ("broken", "apt install libxcb-icccm4")
