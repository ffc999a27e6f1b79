// SPDX-License-Identifier: Apache-2.0
/// Edits that move objects.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// Transforms in world space by prim path, as in SceneEdit::moves.
using Moves = std::map<std::string, Affine>;

/// Returns the transform that moves apply to an object: the product of the moves of its prim and of
/// all ancestor prims, with the outermost prim applied last. Returns the identity if no move
/// applies to the object.
Affine move_of(const Moves& moves, std::string_view object);

/// Returns the geometry of a scene with its objects moved.
///
/// Moved meshes of the world become instances. All other meshes of the world together become a
/// single instance, so that the next move does not rebuild their acceleration structure. Meshes
/// keep their ids and arrays. Throws Error if a transform is singular, or if a path contains
/// neither objects nor lights, names a part of an instance, or contains volumes.
std::shared_ptr<const SceneGeometry> moved_geometry(const Scene& unmoved, const Moves& moves);

}  // namespace wavecomb
