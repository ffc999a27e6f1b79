// SPDX-License-Identifier: Apache-2.0
/// Statistics of a render as dicts.
#pragma once

#include <nanobind/nanobind.h>

#include "wavecomb/render/statistics/render_statistics.h"

/// Returns the `texture_store` entry of docs/statistics.md.
nanobind::dict texture_store_dict(const wavecomb::StoreStatistics& statistics);

/// Returns the keys of docs/statistics.md that the core provides. `image_bytes` is the memory of
/// the image, or 0 if there is no image yet.
nanobind::dict statistics_dict(const wavecomb::RenderStatistics& statistics,
                               const nanobind::dict& settings, size_t image_bytes);
