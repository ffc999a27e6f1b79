// SPDX-License-Identifier: Apache-2.0
/// Grids of OpenVDB: description and bricks. The one unit that instantiates templates of OpenVDB's
/// trees, by walking their nodes: its iterators over values take a compiler ten times as long.
#pragma once

#include <openvdb/Grid.h>

#include "bricks.h"

namespace vdb {

/// Describes a grid, which needs its topology only.
GridFacts facts_of(const openvdb::GridBase& grid);

/// Throws BrokenFile, with the name of the type, if bricks are not made of grids of this type.
void check_type_of(const openvdb::GridBase& grid);

/// Throws TooLarge if the bricks of a grid take more than `most_bytes`.
void check_size_of(const openvdb::GridBase& grid, uint64_t most_bytes);

/// Makes bricks. Throws TooLarge, std::bad_alloc, and as check_type_of.
Bricks bricks_of(const openvdb::GridBase& grid, const BrickOptions& options);

}  // namespace vdb
