# SPDX-License-Identifier: Apache-2.0
"""Measure the noise of renderers at equal samples: relMSE against converged images."""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from renderers import RENDERERS, Job, Process

Picture = NDArray[np.float64]
_BATCH = 256
"""Samples per pixel of one batch of a converged image; a square, as multijitter requires."""
_REFERENCE = {"mitsuba": "mitsuba-llvm-multijitter", "cycles": "cycles-no-tree"}
"""Renderer that makes a family's converged image; in other families, each renderer makes one."""


_OUTLIERS = 1e-3
"""Fraction of the pixels that the trimmed error leaves out; these have the largest errors."""


def rel_errors(picture: Picture, reference: Picture) -> Picture:
    """Return (x - r)^2 / (r^2 + 0.01) per pixel in ascending order; the mean is the relMSE."""
    errors = (picture - reference) ** 2 / (reference**2 + 0.01)
    return np.sort(errors.mean(axis=2).ravel())


class Noise:
    """Images and errors of one stage, cached in a folder."""

    def __init__(
        self, job: Job, cache: Path, spp: int, seeds: int, reference_spp: int, ours: dict[str, Any]
    ) -> None:
        self.job = job
        self.cache = cache
        self.spp = spp
        self.seeds = seeds
        self.reference_spp = reference_spp
        self.ours = ours

    def measure(self, name: str) -> dict[str, Any]:
        """Measure the relMSE of each seed, minus the error of the converged image, and their mean.

        A few pixels with bright caustic paths make relMSE vary by chance. The trimmed error leaves
        out the worst 0.1 % of pixels. It is divided by 1 + N / N_ref, and the error of the
        converged image is not subtracted.
        """
        options = self.ours if name == "wavecomb" else {}
        family = RENDERERS[name].family
        with _Lazy(name, self.job, self.cache, options) as process:
            key = process.key()
            file = self.cache / f"{key}-noise{self.spp}.npz"
            if not file.exists() or len(np.load(file)["pictures"]) < self.seeds:
                pictures, spp = [], 0
                for k in range(self.seeds):
                    picture, spp = process.picture(self.spp, k + 1)
                    pictures.append(picture.astype(np.float32))
                np.savez(file, pictures=np.array(pictures), spp=spp)
        found = np.load(file)
        reference, own = self._converged(_REFERENCE.get(family, name))
        pixels = [rel_errors(p, reference) for p in found["pictures"][: self.seeds]]
        errors = [float(e.mean()) - own for e in pixels]
        kept = round(reference.shape[0] * reference.shape[1] * (1.0 - _OUTLIERS))
        doubt = 1.0 + int(found["spp"]) / self.reference_spp
        trimmed = [float(e[:kept].sum() / len(e) / doubt) for e in pixels]
        return {
            "spp": int(found["spp"]),
            "relmse": float(np.mean(errors)),
            "relmse_of_seeds": errors,
            "relmse_of_reference": own,
            "trimmed": float(np.mean(trimmed)),
            "trimmed_of_seeds": trimmed,
            "mean": [float(v) for v in reference.mean(axis=(0, 1))],
        }

    def converged(self, name: str) -> Picture:
        """Return the converged image of a renderer."""
        return self._converged(_REFERENCE.get(RENDERERS[name].family, name))[0]

    def noisy(self, name: str) -> Picture:
        """Return the image of the first seed."""
        options = self.ours if name == "wavecomb" else {}
        with _Lazy(name, self.job, self.cache, options) as process:
            found = np.load(self.cache / f"{process.key()}-noise{self.spp}.npz")["pictures"][0]
        return np.asarray(found, np.float64)

    def _converged(self, name: str) -> tuple[Picture, float]:
        """Return the mean of batches with other seeds, and the relMSE of this mean.

        The expected (x - r)^2 of an image x and a reference r is var x + var r, so var r is
        subtracted. If errors fall as 1 / N, this has the same effect as division by 1 + N / N_ref.
        The relMSE of the mean is estimated from the spread of the batches.
        """
        options = self.ours if name == "wavecomb" else {}
        batches = max(2, self.reference_spp // _BATCH)
        with _Lazy(name, self.job, self.cache, options) as process:
            file = self.cache / f"{process.key()}-converged{batches * _BATCH}.npz"
            if not file.exists():
                total, squares = np.zeros(()), np.zeros(())
                for k in range(batches):
                    picture, _ = process.picture(_BATCH, 1000 + k)
                    total, squares = total + picture, squares + picture**2
                mean = total / batches
                spread = np.maximum(squares / batches - mean**2, 0.0) / (batches - 1)
                np.savez(file, mean=mean, own=np.mean(spread / (mean**2 + 0.01)))
        found = np.load(file)
        return found["mean"], float(found["own"])


class _Lazy:
    """Process of a renderer; it starts when an image or the renderer's version is first needed."""

    _versions: ClassVar[dict[str, str]] = {}

    def __init__(self, name: str, job: Job, cache: Path, options: dict[str, Any]) -> None:
        self.name, self.job, self.cache, self.options = name, job, cache, options
        self._process: Process | None = None

    def __enter__(self) -> _Lazy:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process:
            self._process.close()

    def _started(self) -> Process:
        if self._process is None:
            log = self.cache / f"{self.name}.log"
            self._process = Process(self.name, self.job, log, self.options)
            self._versions[RENDERERS[self.name].kind] = self._process.facts["version"]
        return self._process

    def key(self) -> str:
        """Cache key of the images: renderer, version, stage and settings."""
        kind = RENDERERS[self.name].kind
        if kind not in self._versions:
            self._started()
        told = [self._versions[kind], self.options, RENDERERS[self.name].options]
        told += [self.job.size, self.job.max_depth]
        told.append(self.job.digest)
        number = hashlib.sha1(json.dumps(told, sort_keys=True).encode()).hexdigest()[:10]
        return f"{self.job.stage.stem}-{self.name}-{number}"

    def picture(self, spp: int, seed: int) -> tuple[Picture, int]:
        """Render an image; return it with the number of samples per pixel that it has."""
        file = self.cache / "picture.npy"
        answer = self._started().render(spp, seed, file)
        print(f"{self.name}: {spp} spp, {answer['seconds']:.1f} s", file=sys.stderr)
        return np.load(file).astype(np.float64), answer["spp"]
