# SPDX-License-Identifier: Apache-2.0
"""Predicted against measured cost of materials."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from wavecomb.bench.analysis_interval import RESAMPLES, SEED
from wavecomb.bench.oracle import ORACLES
from wavecomb.extras import needed

if TYPE_CHECKING:
    import pandas as pd

    from wavecomb.bench.analysis_data import Results

PREDICTIONS = {
    "calibrated_ns": "calibration, before the first pass",
    "predicted_ns": "moving average, after the last pass",
}
LEAST_RECORDS = 256
"""Timed records that a material needs to be in the comparison."""


def material_costs(results: Results) -> pd.DataFrame:
    """One row for each run and material that was timed often enough.

    Columns: ``run_id``, ``stage``, ``policy``, ``lanes``, ``repetition``, ``material``,
    ``program``, ``timed_records``, ``measured_ns``, ``calibrated_ns``, ``predicted_ns``; ns a
    record.
    """
    pandas = needed("pandas", "the analysis")
    settings = results.runs.set_index("run_id")[["stage", "policy", "lanes", "repetition"]]
    known = settings.to_dict("index")
    rows = []
    for record in results.records():
        run_id = record["row"]["run_id"]
        of_run = known.get(run_id)
        if of_run is None or of_run["policy"] in ORACLES:  # their costs are no predictions
            continue
        for entry in (record.get("stats") or {}).get("materials", ()):
            if entry.get("timed_records", 0) >= LEAST_RECORDS and entry.get("ns_per_record", 0) > 0:
                rows.append(
                    {
                        "run_id": run_id,
                        **of_run,
                        "material": entry.get("name", ""),
                        "program": entry.get("program", ""),
                        "timed_records": entry["timed_records"],
                        "measured_ns": entry["ns_per_record"],
                        **{name: entry.get(name) or np.nan for name in PREDICTIONS},
                    }
                )
    return pandas.DataFrame(rows)


def calibration(costs: pd.DataFrame, prediction: str) -> dict[str, Any]:
    """How good predictions are, materials weighted by their timed records.

        r2 = 1 - sum w (measured - predicted)^2 / sum w (measured - mean)^2
        slope, intercept: of the weighted least squares line measured = intercept + slope predicted

    A perfect prediction has r2 = 1, slope 1, intercept 0. r2 is below 0 where the mean would have
    predicted better. Intervals resample materials, over all runs of each: materials are what a new
    scene would bring others of.

    Returns:
        ``r2``, ``slope``, ``intercept`` (ns), ``mean_error`` (relative, weighted), each with
        ``_low`` and ``_high``; ``materials``, ``runs``. Empty with fewer than three materials.
    """
    kept = costs.dropna(subset=[prediction])
    if kept.empty:
        return {}
    names, index = np.unique(
        (kept["stage"] + "|" + kept["material"]).to_numpy(str), return_inverse=True
    )
    if len(names) < 3:
        return {}
    x, y = kept[prediction].to_numpy(float), kept["measured_ns"].to_numpy(float)
    w = kept["timed_records"].to_numpy(float)
    moments = np.stack([w, w * x, w * y, w * x * x, w * x * y, w * y * y, w * np.abs(x - y) / y])
    per_material = np.stack([np.bincount(index, m, len(names)) for m in moments], axis=1)
    rng = np.random.default_rng(SEED)
    weights = rng.multinomial(len(names), np.full(len(names), 1 / len(names)), RESAMPLES)
    value = _line(per_material.sum(axis=0))
    resampled = _line(weights @ per_material)
    result: dict[str, Any] = {"materials": len(names), "runs": int(kept["run_id"].nunique())}
    for k, name in enumerate(("r2", "slope", "intercept", "mean_error")):
        ends = np.nanquantile(resampled[:, k], [0.025, 0.975])
        result |= {name: float(value[k]), f"{name}_low": float(ends[0])}
        result[f"{name}_high"] = float(ends[1])
    return result


def _line(sums: np.ndarray) -> np.ndarray:
    """r2, slope, intercept and mean error from weighted sums, (..., 7) -> (..., 4)."""
    w, wx, wy, wxx, wxy, wyy, we = np.moveaxis(np.asarray(sums, np.float64), -1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        total = wyy - wy**2 / w
        slope = (wxy - wx * wy / w) / (wxx - wx**2 / w)
        r2 = 1.0 - (wyy - 2 * wxy + wxx) / total
        return np.stack([r2, slope, (wy - slope * wx) / w, we / w], axis=-1)
