# SPDX-License-Identifier: Apache-2.0
"""Help > About: versions of Wavecomb and of what it stands on."""

from __future__ import annotations

import importlib.metadata

from PySide6.QtWidgets import QMessageBox, QWidget

_PARTS = ("usd-core", "numpy", "openimageio", "PySide6-Essentials", "pyqtgraph", "pyoidn")


def about_text() -> str:
    """As lines."""
    from wavecomb.isa import library_text
    from wavecomb.version import version

    parts = []
    for name in _PARTS:
        try:
            parts.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            parts.append(f"{name}: not installed")
    return (
        f"Wavecomb {version()}\nCPU wavefront path tracer for OpenUSD stages\n"
        f"{library_text()}\n\n" + "\n".join(parts) + "\n\nApache License 2.0"
    )


def make_about(parent: QWidget) -> QMessageBox:
    """The dialog, not shown yet."""
    box = QMessageBox(parent)
    box.setObjectName("about")
    box.setWindowTitle("About Wavecomb")
    box.setText(about_text())
    return box
