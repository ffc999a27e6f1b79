// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nanobind/nanobind.h>

#include "wavecomb/core/settings.h"

/// All settings by name, as Settings.to_dict() gives them.
nanobind::dict settings_dict(const wavecomb::Settings& settings);
