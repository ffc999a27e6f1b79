# SPDX-License-Identifier: Apache-2.0
"""Tests the cache of reference images: keys, images that are reused, and images that are
rendered."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import references
from references import Cache, Reference, key_of


@dataclass
class Thing:
    name: str
    values: Any


def test_keys_are_of_all_content() -> None:
    base = {"a": 1, "b": [np.zeros(3, np.float32), "x"], "c": Thing("n", (1.0, None))}
    same = {"c": Thing("n", [1.0, None]), "b": (np.zeros(3, np.float32), "x"), "a": 1}
    assert key_of(base) == key_of(same) and len(key_of(base)) == 64
    others: list[Any] = [
        {**base, "a": 2},
        {**base, "a": 1.0},
        {**base, "a": "1"},
        {**base, "a": True},
        {**base, "d": None},
        {**base, "b": [np.zeros(3, np.float64), "x"]},
        {**base, "b": [np.zeros((3, 1), np.float32), "x"]},
        {**base, "b": [np.array([0, 0, 1e-30], np.float32), "x"]},
        {**base, "c": Thing("m", (1.0, None))},
        [base],
    ]
    assert len({key_of(base), *map(key_of, others)}) == len(others) + 1
    assert key_of("ab", "c") != key_of("a", "bc")
    with pytest.raises(TypeError, match="cannot hash a object"):
        key_of({"a": object()})


def test_an_image_is_made_once(tmp_path: Path) -> None:
    calls = []

    def make(value: float) -> Any:
        def made() -> Any:
            calls.append(value)
            return np.full((2, 2, 3), value, np.float32)

        return made

    cache = Cache(tmp_path / "kept")
    for _ in range(2):
        assert cache.get("a", make(1)).tolist() == np.ones((2, 2, 3)).tolist()
    assert cache.get("b", make(2))[0, 0, 0] == 2
    assert calls == [1, 2]
    (tmp_path / "kept" / "a.npy").write_bytes(b"\x93NUMPY cut off")
    assert cache.get("a", make(3))[0, 0, 0] == 3
    assert sorted(path.name for path in (tmp_path / "kept").iterdir()) == ["a.npy", "b.npy"]


def test_what_was_used_longest_ago_goes_first(tmp_path: Path) -> None:
    cache = Cache(tmp_path, most_bytes=3 * (128 + 4 * 100))
    for age, key in enumerate(("a", "b", "c")):
        cache.get(key, lambda: np.zeros(100, np.float32))
        os.utime(tmp_path / f"{key}.npy", (1000 + age, 1000 + age))
    cache.get("a", lambda: pytest.fail("it is there"))
    cache.get("d", lambda: np.zeros(100, np.float32))
    assert sorted(path.stem for path in tmp_path.iterdir()) == ["a", "c", "d"]


def test_a_reference_is_of_scene_settings_and_seed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Uses a stand-in renderer that counts calls; Mitsuba is not needed."""
    from mitsuba_bridge import PeerSettings
    from recorded import Recorded

    monkeypatch.setattr(references, "FOLDER", tmp_path)
    monkeypatch.delenv("WAVECOMB_REFERENCES", raising=False)
    renders: list[int] = []

    class Peer:
        def __init__(self, *_: Any) -> None:
            pass

        def render(self, spp: int, seed: int) -> Any:
            renders.append(seed)
            return np.full((1, 1, 3), seed, np.float32)

    def image(albedo: float, width: int, spp: int, seed: int, version: str = "3.9") -> float:
        mitsuba: Any = SimpleNamespace(__version__=version, variant=lambda: "scalar_rgb")
        recorded = Recorded(
            materials=[{"program": "diffuse", "albedo": albedo}],
            textures=[{"pixels": np.zeros((1, 1, 3)), "name": f"folder of run {len(renders)}"}],
        )
        peer: Any = Peer
        made = Reference(mitsuba, recorded, PeerSettings(width, 4), peer).render(spp, seed)
        return float(made[0, 0, 0])

    assert [image(0.5, 4, 8, 1), image(0.5, 4, 8, 1)] == [1, 1] and renders == [1]
    for changed in ((0.6, 4, 8, 1), (0.5, 5, 8, 1), (0.5, 4, 9, 1), (0.5, 4, 8, 2)):
        image(*changed)
    image(0.5, 4, 8, 1, "3.10")
    assert len(renders) == 6
    monkeypatch.setenv("WAVECOMB_REFERENCES", "0")
    image(0.5, 4, 8, 1)
    assert len(renders) == 7
