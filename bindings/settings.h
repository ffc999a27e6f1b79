// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nanobind/nanobind.h>

#include "wavecomb/core/settings.h"

/// Returns all settings by name, for Settings.to_dict().
nanobind::dict settings_dict(const wavecomb::Settings& settings);
