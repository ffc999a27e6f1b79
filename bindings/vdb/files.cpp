// SPDX-License-Identifier: Apache-2.0
#include "files.h"

#include "bricks.h"

namespace vdb {

GridFile::GridFile(const std::string& path) {
  if (NanoFile::is_one(path))
    nano_ = std::make_unique<NanoFile>(path);
  else
    archive_ = std::make_unique<Archive>(path);
}

size_t GridFile::size() const {
  return nano_ != nullptr ? nano_->entries().size() : archive_->entries().size();
}

Head GridFile::head(size_t number) const {
  if (nano_ != nullptr) {
    const NanoEntry& entry = nano_->entries().at(number);
    return {entry.name, entry.index, NanoFile::type_name(entry), false};
  }
  const Entry& entry = archive_->entries().at(number);
  return {entry.name(), entry.index, entry.descriptor.gridType(),
          entry.descriptor.saveFloatAsHalf()};
}

openvdb::GridBase::Ptr GridFile::read(size_t number, Part part, uint64_t most_bytes) {
  if (nano_ != nullptr) return nano_->read(nano_->entries().at(number), most_bytes);
  return archive_->read(archive_->entries().at(number), part, [&](const auto& base) {
    with_grid(base, [&](const auto& typed) {
      check_size(count_bricks(typed.tree()), format_of(typed), most_bytes);
    });
  });
}

}  // namespace vdb
