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
  // The library creates the grid by type name. Instantiating the grid type here would double the
  // compile time.
  const auto grid = openvdb::GridBase::createGrid("Tree_float_5_4_3");
  grid->setName("density");
  grid->setSaveFloatAsHalf(true);
  openvdb::io::File(argv[1]).write(openvdb::GridPtrVec{grid});
  openvdb::io::File file(argv[1]);
  file.open(false);
  const auto found = file.readGrid("density");
  const bool ok = found->type() == grid->type() && found->saveFloatAsHalf();
  if (!ok) std::fprintf(stderr, "openvdb probe: a grid changed when written and read\n");
  if (ok)
    std::printf("openvdb probe: headers and library %s agree\n", OPENVDB_LIBRARY_VERSION_STRING);
  return ok ? 0 : 1;
}
