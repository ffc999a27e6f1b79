// SPDX-License-Identifier: Apache-2.0
/// Writes and reads a grid with OpenVDB. tools/setup_openvdb runs it to check that headers and
/// libraries match. Includes the same headers as bindings/vdb.
#include <openvdb/io/Archive.h>
#include <openvdb/io/Compression.h>
#include <openvdb/io/File.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/io/io.h>
#include <openvdb/openvdb.h>

#include <cstdio>

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  openvdb::initialize();
  auto grid = openvdb::FloatGrid::create();
  grid->setName("density");
  grid->setSaveFloatAsHalf(true);
  for (int i = 0; i < 100; ++i) grid->tree().setValue({i, -i, 3 * i}, 0.5f * static_cast<float>(i));
  openvdb::io::File(argv[1]).write(openvdb::GridPtrVec{grid});
  openvdb::io::File file(argv[1]);
  file.open(false);
  const auto found = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("density"));
  bool ok = found->activeVoxelCount() == 100 && found->saveFloatAsHalf();
  for (int i = 0; i < 100; ++i)
    ok = ok && found->tree().getValue({i, -i, 3 * i}) == 0.5f * static_cast<float>(i);
  if (!ok) std::fprintf(stderr, "openvdb probe: a grid came back as another\n");
  if (ok)
    std::printf("openvdb probe: headers and library %s agree\n", OPENVDB_LIBRARY_VERSION_STRING);
  return ok ? 0 : 1;
}
