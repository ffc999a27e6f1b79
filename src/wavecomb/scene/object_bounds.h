// SPDX-License-Identifier: Apache-2.0
/// Where objects of a scene are, by their names.
#pragma once

#include <string_view>

#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// World bounds, over the time that the shutter is open, of all meshes that are a prim or are in it
/// (ObjectNames): of "/World/Forest" the object "/World/Forest[12]/Leaves", too. Empty where there
/// are none. Looks at every object: for who asks once.
Bounds object_bounds(const Scene& scene, std::string_view prim);

}  // namespace wavecomb
