# SPDX-License-Identifier: Apache-2.0
"""Actions of the window and the menus that contain them."""

from __future__ import annotations

from typing import Any

from PySide6.QtGui import QAction, QActionGroup
from PySide6.QtWidgets import QMenu

from wavecomb.gui import theme
from wavecomb.gui.actions import Entry, keypad, make_action
from wavecomb.gui.recent_stages import RecentStages

Window = Any
"""Type of a ``main_window.MainWindow``. ``main_window`` imports this module, so this module cannot
import the class."""

MENUS: tuple[tuple[str, tuple[str, ...]], ...] = (
    (
        "&File",
        ("open", "recent", "reload", "-", "save", "save_as", "-", "save_picture", "-",
         "quit"),
    ),
    ("&Edit", ("undo", "redo", "-", "move", "rotate", "scale", "-", "parent")),
    (
        "&Render",
        ("pause", "stop", "restart", "-", "region", "clear_region", "fit_size", "-", "denoise",
         "-", "play", "farm"),
    ),
    (
        "&Camera",
        ("frame", "frame_all", "stage_camera", "-", "front", "right", "top", "opposite", "-",
         "view_back", "view_forth"),
    ),
    (
        "&Picture",
        (
            "brighter", "darker", "exposure_0", "-", "next_layer", "last_layer", "beauty",
            "expression", "-", "fit", "full", "zoom_in", "zoom_out",
        ),
    ),
    (
        "&View",
        (
            "panels", "-", "compare", "keep_a", "keep_b", "-",
            "theme", "full_screen", "reset_layout",
        ),
    ),
    ("&Help", ("shortcuts", "about")),
)  # fmt: skip
"""Title of each menu with the names of the menu's actions; "-" is a separator."""
CHECKED = ("region",)


def entries(window: Window) -> list[Entry]:
    """Returns all actions of the window."""
    viewport, display, session = window.viewport, window.display, window.session
    scene = window.scene

    def view(name: str, digit: int) -> Entry:
        return Entry(
            name, f"From the {name}", lambda: viewport.view_from(name), keypad(digit), local=True
        )

    def expose(by: float) -> None:
        display.set_exposure(viewport.look.exposure + by)

    return [
        Entry("open", "&Open\u2026", window.ask_open, ["Ctrl+O"], "Open a USD stage"),
        Entry(
            "reload", "Re&load", window.reload, ["Ctrl+R"],
            "Reload the stage from disk and drop edits",
        ),
        Entry(
            "save", "&Save edits", scene.save, ["Ctrl+S"],
            "Write the edits as a small USD layer over the stage, which is chosen the first time",
        ),
        Entry("save_as", "Save edits &as layer\u2026", scene.ask_save, [], "Write another layer"),
        Entry(
            "save_picture", "Save &picture\u2026", window.save_as, ["Ctrl+Shift+S"],
            "Write all layers (EXR) or the displayed picture (PNG)",
        ),
        Entry("undo", "&Undo", scene.edits.undo, ["Ctrl+Z"], "Undo the last edit"),
        Entry(
            "redo", "&Redo", scene.edits.redo, ["Ctrl+Shift+Z", "Ctrl+Y"],
            "Redo the last undone edit",
        ),
        *(
            Entry(
                name, f"&{name.capitalize()}", lambda name=name: viewport.gizmo.set_mode(name),
                [key], f"{name.capitalize()} the selected light or object by handles", local=True,
            )
            for name, key in (("move", "W"), ("rotate", "E"), ("scale", "R"))
        ),
        Entry(
            "parent", "Select &parent", scene.select_parent, ["P"],
            "Select the prim that contains the selected one", local=True,
        ),
        Entry("quit", "&Quit", window.close, ["Ctrl+Q"]),
        Entry(
            "pause", "&Pause", window.toggle_pause, ["Space"], "Pause or continue", local=True
        ),
        Entry("stop", "S&top", session.stop, ["Ctrl+."], "Stop the render and keep the picture"),
        Entry("restart", "&Restart", session.restart, ["F5"], "Restart from the first sample"),
        Entry(
            "region", "Re&gion", viewport.set_region_mode, ["Ctrl+B"],
            "Drag a rectangle to render only that region", checkable=True,
        ),
        Entry(
            "clear_region", "&Whole picture", viewport.clear_region, ["Ctrl+Alt+B"],
            "Render the whole picture again",
        ),
        Entry(
            "fit_size", "Si&ze of the viewport", window.fit_size, ["Ctrl+Shift+F"],
            "Render at the pixel size of the viewport",
        ),
        Entry(
            "denoise", "&Denoise on, off", window.docks["render"].widget().denoise.toggle,
            ["Shift+D"], "Denoise the picture with Open Image Denoise",
        ),
        Entry(
            "play", "Pla&y", window.timeline.toggle, ["Shift+Space"],
            "Play or stop the frames of an animated stage", local=True,
        ),
        Entry(
            "farm", "Send to a &farm\u2026", window.send_to_farm, [],
            "Render the stage with its edits as a job for many workers",
        ),
        Entry("frame", "&Frame selected", viewport.frame_selected, ["F"], local=True),
        Entry("frame_all", "Frame &all", viewport.frame_all, ["Home", "A"], local=True),
        Entry(
            "stage_camera", "The stage's &camera", window.look_through_camera, keypad(0), local=True
        ),
        view("front", 1),
        view("right", 3),
        view("top", 7),
        Entry(
            "view_back", "&Back from", window.views.stack.undo, ["Ctrl+Alt+Z"],
            "Move the camera back to its previous view; keeps edits",
        ),
        Entry(
            "view_forth", "For&ward to", window.views.stack.redo, ["Ctrl+Alt+Shift+Z"],
            "Move the camera forward to the next view",
        ),
        Entry("opposite", "From the other side", viewport.view_opposite, keypad(9), local=True),
        Entry("brighter", "&Brighter", lambda: expose(0.5), ["]"], "By half a stop", local=True),
        Entry("darker", "&Darker", lambda: expose(-0.5), ["["], "By half a stop", local=True),
        Entry(
            "exposure_0", "Exposure &0", lambda: display.set_exposure(0.0), ["\\"], local=True
        ),
        Entry("next_layer", "&Next layer", lambda: display.step_layer(1), ["."], local=True),
        Entry("last_layer", "&Last layer", lambda: display.step_layer(-1), [","], local=True),
        Entry("beauty", "Bea&uty", lambda: display.choose_layer("beauty"), ["B"], local=True),
        Entry(
            "expression", "Light &path expression\u2026", display.ask_expression, [],
            "Show the light of paths that match an expression as a layer",
        ),
        Entry("fit", "&Fit the picture", lambda: viewport.set_zoom(None), ["Ctrl+0"]),
        Entry("full", "&100 %", lambda: viewport.set_zoom(1.0), ["Ctrl+1"]),
        Entry(
            "zoom_in", "Zoom &in", lambda: viewport.set_zoom(2.0 * viewport.zoom()),
            ["Ctrl++", "Ctrl+="],
        ),
        Entry(
            "zoom_out", "Zoom &out", lambda: viewport.set_zoom(0.5 * viewport.zoom()), ["Ctrl+-"]
        ),
        Entry(
            "compare", "&Compare\u2026", window.show_compare, ["Ctrl+D"],
            "Compare two pictures or live renders, side by side or with a wipe",
        ),
        *(
            Entry(
                f"keep_{which.lower()}", f"Keep as &{which}",
                lambda which=which: window.docks["compare"].widget().keep(which),
                [f"Ctrl+Shift+{which}"],
                f"Use the current picture as {which} in Compare",
            )
            for which in "AB"
        ),
        Entry("full_screen", "F&ull screen", window.toggle_full_screen, ["F11"]),
        Entry("reset_layout", "&Reset the panels", window.reset_layout),
        Entry("shortcuts", "&Keyboard shortcuts", window.show_shortcuts, ["F1"]),
        Entry("about", "&About Wavecomb", window.show_about),
    ]  # fmt: skip


def make_menus(window: Window) -> tuple[dict[str, QAction], RecentStages]:
    """Fills the menu bar of a window.

    Returns:
        The window's actions by name, and the menu of recently opened stages.
    """
    actions: dict[str, QAction] = {}
    by_name = {entry.name: entry for entry in entries(window)}
    recent = RecentStages(window.settings, window)
    recent.chosen.connect(window.open)
    for title, names in MENUS:
        menu = window.menuBar().addMenu(title)
        menu.setObjectName("menu." + title.replace("&", "").lower())
        menu.setToolTipsVisible(True)
        for name in names:
            if name == "-":
                menu.addSeparator()
            elif name == "recent":
                menu.addMenu(recent)
            elif name == "theme":
                menu.addMenu(_theme_menu(window))
            elif name == "panels":
                menu.addActions([dock.toggleViewAction() for dock in window.docks.values()])
            else:
                actions[name] = make_action(by_name[name], window, window.viewport)
                menu.addAction(actions[name])
    return actions, recent


def _theme_menu(window: Window) -> QMenu:
    menu = QMenu("&Colours", window)
    group = QActionGroup(window)
    for choice in theme.CHOICES:
        action = QAction(choice.capitalize(), menu)
        action.setObjectName(f"theme.{choice}")
        action.setCheckable(True)
        action.setChecked(theme.choice() == choice)
        action.triggered.connect(lambda checked=False, choice=choice: window.set_theme(choice))
        group.addAction(action)
    menu.addActions(group.actions())
    return menu
