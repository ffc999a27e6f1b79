# SPDX-License-Identifier: Apache-2.0
"""Summarises the contents of a stage as Wavecomb would render it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

    from wavecomb.usd import LoadedStage


_MOST_VOLUMES = 16
"""Maximum number of volumes that the text output lists."""


def stage_info(loaded: LoadedStage, stage: str) -> dict[str, Any]:
    """Returns the summary of a stage as a dictionary.

    Args:
        loaded: Result of ``wavecomb.load``.
        stage: Name of the file.
    """
    from wavecomb.isa import library_info

    scene, report = loaded.scene, loaded.report
    low, high = scene.bounds
    programs = Counter(program for _, program in scene.materials)
    return {
        "stage": stage,
        "camera": loaded.camera_path,
        "seconds": {"load": float(loaded.seconds)},
        "triangles": {"unique": scene.triangles, "instanced": scene.instanced_triangles},
        "curve_segments": scene.curve_segments,
        "points": scene.points,
        "splats": scene.splats,
        "meshes": scene.mesh_count,
        "instances": scene.instance_count,
        "bounds": [list(low), list(high)],
        "materials": {
            "count": len(scene.materials),
            "by_program": dict(sorted(programs.items())),
        },
        "textures": {
            "count": len(scene.textures),
            "bytes": sum(size for _, size in scene.textures),
            "files": [{"name": name, "bytes": size} for name, size in scene.textures],
        },
        "volumes": [volume.as_dict() for volume in loaded.volumes],
        "lights": scene.light_count,
        "lights_by_kind": dict(sorted(Counter(kind for _, kind in scene.lights).items())),
        "cameras": list(loaded.cameras),
        "prims": dict(sorted(report.counts.items())),
        "unsupported": [finding.as_dict() for finding in report.unsupported],
        "warnings": [finding.as_dict() for finding in report.warnings]
        + [{"what": line, "count": 1, "places": []} for line in scene.warnings],
        "notes": [finding.as_dict() for finding in report.notes],
        "native": library_info(),
    }


def machine_info() -> dict[str, Any]:
    """Returns the resources and features of this machine as a dictionary."""
    from wavecomb import _core, vdb
    from wavecomb.isa import library_info
    from wavecomb.machine import memory_bytes, usable_cores
    from wavecomb.run.isolation import sandbox
    from wavecomb.run.isolation.memory import machine_limit

    return {
        "cores": usable_cores(),
        "memory_bytes": memory_bytes(),
        "memory_limit_bytes": machine_limit(),
        "native": library_info(),
        "texture_store": {"obstacle": _core.TextureStore.obstacle() or None},
        "openvdb": vdb.version(),
        "nanovdb": vdb.nano_version(),
        "sandbox": sandbox.describe(),
    }


def machine_rows(info: dict[str, Any]) -> list[tuple[str, str]]:
    """Returns the machine's resources as pairs of name and text."""
    from wavecomb.isa import library_text

    memory, limit = info["memory_bytes"], info["memory_limit_bytes"]
    has, may = (memory or 0) / 1e9, (limit or 0) / 1e9
    return [
        ("cores", str(info["cores"])),
        ("memory", f"{has:.1f} GB; limit of a child process {may:.1f} GB"),
        ("native", library_text()),
        ("texture limit", info["texture_store"]["obstacle"] or "supported by this system"),
        ("openvdb", info["openvdb"] or "none: volumes are left out"),
        ("nanovdb", str(info["nanovdb"] or "none: .nvdb files are not read")),
        ("sandbox", info["sandbox"]["obstacle"] or "bubblewrap"),
    ]


def machine_lines(info: dict[str, Any]) -> list[str]:
    """Returns the machine's resources as lines of text."""
    return [f"{name:13}  {text}" for name, text in machine_rows(info)]


def print_info(info: dict[str, Any], loaded: LoadedStage, console: Console) -> None:
    """Prints the summary of a stage to the console."""
    from rich.markup import escape
    from rich.table import Table

    from wavecomb.isa import library_text

    table = Table(show_header=False, box=None, pad_edge=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")

    def row(name: str, text: str) -> None:
        table.add_row(name, escape(text))

    triangles = info["triangles"]
    row("stage", info["stage"])
    row("camera", str(info["camera"] or "none: one that sees everything"))
    row("triangles", f"{triangles['unique']:,} ({triangles['instanced']:,} with instances)")
    if info["curve_segments"]:
        row("curve segments", f"{info['curve_segments']:,}")
    if info["points"]:
        row("points", f"{info['points']:,}")
    if info["splats"]:
        row("splats", f"{info['splats']:,}")
    row("meshes", f"{info['meshes']:,}")
    row("instances", f"{info['instances']:,}")
    low, high = info["bounds"]
    row("bounds", f"{_point(low)} to {_point(high)}")
    row("materials", f"{info['materials']['count']}{_counts(info['materials']['by_program'])}")
    textures = info["textures"]
    row("textures", f"{textures['count']}, {textures['bytes'] / 1e6:.1f} MB")
    for entry in sorted(textures["files"], key=lambda entry: -int(entry["bytes"]))[:8]:
        row("", f"{entry['bytes'] / 1e6:8.1f} MB  {entry['name']}")
    if textures["count"] > 8:
        row("", f"and {textures['count'] - 8} more (--json has all)")
    for volume in info["volumes"][:_MOST_VOLUMES]:
        _volume_rows(row, volume)
    if len(info["volumes"]) > _MOST_VOLUMES:
        row("", f"and {len(info['volumes']) - _MOST_VOLUMES} more volumes (--json has all)")
    row("lights", f"{info['lights']}{_counts(info['lights_by_kind'])}")
    others = [path for path in info["cameras"] if path != info["camera"]]
    if others:
        more = f" and {len(others) - 8} more" if len(others) > 8 else ""
        row("other cameras", ", ".join(others[:8]) + more)
    row("prims", _counts(info["prims"]).removeprefix(": ") or "none")
    row("native", library_text())
    row("loaded in", f"{info['seconds']['load']:.2f} s")
    console.print(table)
    for title, findings in (
        ("not supported", loaded.report.unsupported),
        ("notes", loaded.report.notes),
    ):
        if findings:
            console.print(f"[bold]{title}[/bold]")
            for finding in findings:
                console.print(f"  {escape(finding.line())}", highlight=False)


def _volume_rows(row: Callable[[str, str], None], volume: dict[str, Any]) -> None:
    """Adds table rows for a volume and its grids."""
    low, high = volume["bounds"]
    times = f" x {volume['count']}" if volume["count"] > 1 else ""
    what = "" if volume["grids"] else ", homogeneous"
    row("volume", f"{volume['name']}{times}{what}, {_point(low)} to {_point(high)}")
    for grid in volume["grids"]:
        named = f"{grid['grid']} ({grid['value']}) of {grid['file']}"
        size = f"{grid['voxels']:,} voxels, {grid['bytes'] / 1e6:.1f} MB"
        row("", f"{grid['use']}: {named}, {size}")


def _counts(counts: dict[str, int]) -> str:
    text = ", ".join(f"{count} {name}" for name, count in counts.items())
    return f": {text}" if text else ""


def _point(values: list[float]) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in values) + ")"
