# SPDX-License-Identifier: Apache-2.0
"""A fake native module and stage loader, to test the command line without rendering."""

from __future__ import annotations

import functools
import importlib
import os
import signal
import sys
from contextlib import nullcontext
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

import wavecomb
from wavecomb.errors import WavecombError
from wavecomb.load_options import LoadOptions
from wavecomb.options import settings
from wavecomb.run.aovs import core_aovs


class Error(ValueError):
    pass


class Settings:
    adaptive = noise = time_limit = 0.0
    error = crop = False
    region = None
    allocate = "even"
    firefly = "keep"
    transport = "path"
    aovs: tuple[str, ...] = ()

    def __init__(self, **settings: Any) -> None:
        defaults = {"width": 600, "height": 600, "spp": 64, "seed": 0, "threads": 0}
        self.__dict__.update({**defaults, **settings})

    def check(self) -> None:
        if self.__dict__.get("lanes") == 4:
            raise Error("setting lanes: 4 is not built; there are 1, 8")

    def to_dict(self) -> dict[str, Any]:
        return dict(self.__dict__)


class Finding(SimpleNamespace):
    def line(self) -> str:
        return f"{self.what}: {self.place}"

    def as_dict(self) -> dict[str, Any]:
        return {"what": self.what, "count": 1, "places": [self.place]}


class Fake:
    """Behaviour of the fake module, and the calls that it recorded."""

    def __init__(self) -> None:
        self.interrupt_at: float | None = None
        self.nan_pixels = 0
        self.fail: Exception | None = None
        self.loaded: list[dict[str, Any]] = []
        self.rendered: list[dict[str, Any]] = []
        self.policies: list[Any] = []
        self.costs: list[Any] = []
        self.stats: dict[str, Any] = {}

    def load_stage(self, path: Path, chosen: LoadOptions, **how: Any) -> Any:
        options = chosen.as_dict()
        if not Path(path).exists():
            raise WavecombError(f"{path}: no such file")
        if options.get("camera") == "/Nowhere":
            raise WavecombError("no camera /Nowhere\nthere are: /Camera")
        self.loaded.append({"path": path, **options, **how})
        scene = SimpleNamespace(
            triangles=1000,
            instanced_triangles=90000,
            curve_segments=0,
            points=0,
            splats=0,
            mesh_count=2,
            instance_count=90,
            light_count=3,
            lights=[("Key", "rect"), ("Fill", "rect"), ("Sky", "dome")],
            materials=[("Gold", "metal"), ("Silver", "metal"), ("Chalk", "diffuse")],
            textures=[("wood.png", 4_000_000), ("stone.png", 1_000_000)],
            warnings=["mesh /Bad: 3 triangles left out"],
            bounds=((-1.0, 0.0, -1.0), (1.0, 2.0, 1.0)),
        )
        in_scene = functools.partial(self.render, scene)
        report = SimpleNamespace(
            unsupported=[Finding(what="volumes", place="/Smoke")],
            warnings=[Finding(what="missing texture", place="./wood.png")],
            notes=[Finding(what="no light", place="/")],
            counts={"Mesh": 2, "RectLight": 3, "Camera": 1},
        )
        return SimpleNamespace(
            scene=scene,
            report=report,
            camera_path="/Camera",
            volumes=[],
            catchers=(),
            origin=(0.0, 0.0, 0.0),
            working_space="rec709",
            seconds=0.25,
            stage_path=path,
            cameras=("/Camera", "/Closeup"),
            renderer=lambda threads: nullcontext((SimpleNamespace(render=in_scene), True)),
        )

    def peek_products(self, stage: Any, *options: Any, **named: Any) -> tuple[list[Any], Any]:
        nothing = dict.fromkeys(("settings", "product", "resolution", "aovs", "output"))
        return [SimpleNamespace(**nothing, region=lambda width, height: None)], None

    def render(
        self,
        scene: Any,
        settings: Settings,
        progress: Any = None,
        policy: Any = None,
        costs: Any = None,
        watcher: Any = None,
        state: Any = None,
        learned: Any = None,
    ) -> Any:
        if self.fail is not None:
            raise self.fail
        self.rendered.append(settings.to_dict())
        self.policies.append(policy)
        self.costs.append(costs)
        width, height, total = settings.width, settings.height, settings.spp
        total_samples, done, cancelled = width * height * total, 0, False
        for step in range(11):
            done = total_samples * step // 10
            if self.interrupt_at is not None and step / 10 >= self.interrupt_at:
                os.kill(os.getpid(), signal.SIGINT)
            status = {
                "samples_done": done,
                "samples_total": total_samples,
                "resumed_samples": 0,
                "rays": 4 * done,
                "passes": 1 + step // 5,
                "active_pixels": width * height,
                "seconds": 0.05 * step,
                "error": None if step < 5 else 0.25,
            }
            if progress is not None and progress(done, total_samples) is False:
                cancelled = True
            if watcher is not None and watcher.progress(status) == "stop":
                cancelled = True
            if cancelled:
                break
        y, x = np.mgrid[0:height, 0:width].astype(np.float32)
        beauty = np.stack([x / width, y / height, np.full_like(x, 2.0)], axis=2)
        beauty[0, : self.nan_pixels] = np.nan
        return SimpleNamespace(
            beauty=beauty,
            albedo=beauty * 0.5,
            normal=beauty - 0.5,
            depth=np.where(x < 1, np.inf, x + 1).astype(np.float32),
            samples=np.full((height, width), done // (width * height), np.uint32),
            error=None,
            variance=None,
            cancelled=cancelled,
            aovs={},
            manifests={},
            deep=None,
            learned=b"",
            costs={"materials": {"Gold": 50.0, "Chalk": 25.5}, "textures": {"wood.png": 60.0}},
            stats={
                "settings": settings.to_dict(),
                "seconds": {"build": 0.1, "render": 0.5},
                "phases_s": {"trace": 0.3, "shade": 0.2},
                "counts": {"samples": done, "rays": 3 * done, "shadow_rays": done, "records": done},
                "samples_per_s": done / 0.5,
                "rays_per_s": 4 * done / 0.5,
                "peak_rss_bytes": 123_000_000,
                **self.stats,
            },
        )


def install(monkeypatch: pytest.MonkeyPatch) -> Fake:
    """Replaces the native module and the loader by a fake."""
    settings()  # load the tables of the real core first
    core_aovs()
    importlib.import_module("wavecomb.usd.lights.light")
    fake = Fake()
    core = ModuleType("wavecomb._core")
    usd = ModuleType("wavecomb.usd")
    usd.__path__ = [str(Path(wavecomb.__file__).parent / "usd")]
    for name, value in {
        "Error": Error,
        "Settings": Settings,
        "render": fake.render,
        "build_info": lambda: {"version": "0", "library": "fake", "isa": "none"},
        "lane_widths": lambda: [1, 8],
    }.items():
        setattr(core, name, value)
    usd.load_stage = fake.load_stage  # type: ignore[attr-defined]
    usd.peek_products = fake.peek_products  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "wavecomb._core", core)
    monkeypatch.setitem(sys.modules, "wavecomb.usd", usd)
    monkeypatch.setattr(wavecomb, "_core", core, raising=False)
    monkeypatch.setattr(wavecomb, "usd", usd, raising=False)
    return fake
