// SPDX-License-Identifier: Apache-2.0
/// Conversion of a render's statistics to Python dicts.
#pragma once

#include <nanobind/nanobind.h>

#include "wavecomb/render/statistics/render_statistics.h"

/// Converts statistics of the texture store to the dict `texture_store` that docs/statistics.md
/// describes.
nanobind::dict texture_store_dict(const wavecomb::StoreStatistics& statistics);

/// Converts statistics of a render to the dict that docs/statistics.md describes, without the keys
/// that Python code adds. `image_bytes` is the memory of the image, or 0 before the first image.
nanobind::dict statistics_dict(const wavecomb::RenderStatistics& statistics,
                               const nanobind::dict& settings, size_t image_bytes);
