// SPDX-License-Identifier: Apache-2.0
/// What a render took, as a dict.
#pragma once

#include <nanobind/nanobind.h>

#include "wavecomb/render/render_statistics.h"

/// What `texture_store` of docs/statistics.md holds.
nanobind::dict texture_store_dict(const wavecomb::StoreStatistics& statistics);

/// The keys of docs/statistics.md that the core knows of. `picture_bytes`: 0 where there is no
/// picture yet.
nanobind::dict statistics_dict(const wavecomb::RenderStatistics& statistics,
                               const nanobind::dict& settings, size_t picture_bytes);
