# SPDX-License-Identifier: Apache-2.0
"""Comparison of predicted and measured shading costs of materials."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.bench.analysis.interval import bca
from wavecomb.bench.oracle import ORACLES
from wavecomb.extras import needed

if TYPE_CHECKING:
    import pandas as pd

    from wavecomb.bench.analysis.data import Results

PREDICTIONS = {
    "calibrated_ns": "calibration, before the first pass",
    "predicted_ns": "moving average, after the last pass",
}
MIN_RECORDS = 256
"""Smallest number of timed records with which a material enters the comparison."""


def material_costs(results: Results) -> pd.DataFrame:
    """Returns one row per run and material with enough timed records.

    Columns: ``run_id``, ``stage``, ``policy``, ``lanes``, ``repetition``, ``material``,
    ``program``, ``timed_records``, ``measured_ns``, ``calibrated_ns``, ``predicted_ns``; times in
    ns per record. Oracles are left out, because their costs are not predictions.
    """
    pandas = needed("pandas", "the analysis")
    found = pandas.DataFrame(
        {"run_id": record["row"]["run_id"], **entry}
        for record in results.records()
        for entry in (record.get("stats") or {}).get("materials", ())
    )
    renamed = {"name": "material", "ns_per_record": "measured_ns"}
    columns = ["material", "program", "timed_records", "measured_ns", *PREDICTIONS]
    found = found.rename(columns=renamed).reindex(columns=["run_id", *columns])
    settings = results.runs[["run_id", "stage", "policy", "lanes", "repetition"]]
    settings = settings[~settings["policy"].isin(ORACLES)]
    found = settings.merge(found, on="run_id")
    numbers = ["timed_records", "measured_ns", *PREDICTIONS]
    found[numbers] = found[numbers].astype(np.float64)
    found[[*PREDICTIONS]] = found[[*PREDICTIONS]].replace(0.0, np.nan)
    timed = (found["timed_records"] >= MIN_RECORDS) & (found["measured_ns"] > 0)
    return found[timed].reset_index(drop=True)


def calibration(costs: pd.DataFrame, prediction: str) -> dict[str, Any]:
    """Computes the quality of predictions, with materials weighted by their timed records.

        r2 = 1 - sum w (measured - predicted)^2 / sum w (measured - mean)^2
        slope, intercept: of the weighted least squares line measured = intercept + slope predicted

    A perfect prediction has r2 = 1, slope 1, intercept 0. r2 is negative if the mean would have
    predicted better. Intervals resample materials, each with all its runs, since a new scene would
    have other materials.

    Returns:
        ``r2``, ``slope``, ``intercept`` (ns), ``mean_error`` (relative, weighted), each with
        ``_low`` and ``_high``; ``materials``, ``runs``. Empty with fewer than three materials.
    """
    kept = costs.dropna(subset=[prediction])
    if kept.empty:
        return {}
    x, y, w = (kept[name] for name in (prediction, "measured_ns", "timed_records"))
    moments = needed("pandas", "the analysis").concat(
        [w, w * x, w * y, w * x * x, w * x * y, w * y * y, w * (x - y).abs() / y], axis=1
    )
    sums = moments.groupby([kept["stage"], kept["material"]]).sum().to_numpy(np.float64)
    if len(sums) < 3:
        return {}

    def of_materials(index: NDArray[np.intp], axis: int = -1) -> NDArray[np.float64]:
        return _line(np.moveaxis(sums[index].sum(axis=-2), -1, 0))

    value = of_materials(np.arange(len(sums)))
    low, high = bca(of_materials, len(sums), widened=False)
    result: dict[str, Any] = {"materials": len(sums), "runs": int(kept["run_id"].nunique())}
    for k, name in enumerate(("r2", "slope", "intercept", "mean_error")):
        result |= {name: float(value[k])}
        result |= {f"{name}_low": float(low[k]), f"{name}_high": float(high[k])}
    return result


def _line(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Computes r2, slope, intercept and mean error, (4, ...), from weighted sums, (7, ...)."""
    w, wx, wy, wxx, wxy, wyy, we = sums
    with np.errstate(divide="ignore", invalid="ignore"):
        total = wyy - wy**2 / w
        slope = (wxy - wx * wy / w) / (wxx - wx**2 / w)
        r2 = 1.0 - (wyy - 2 * wxy + wxx) / total
        return np.stack([r2, slope, (wy - slope * wx) / w, we / w])
