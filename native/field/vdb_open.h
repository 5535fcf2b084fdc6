// Opening .vdb files, for the readers in this folder.
#pragma once

#include <ios>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/printable.h"
#include "core/vec.h"
#include "field/openvdb.h"

namespace gpis {

// OpenVDB's types are known and its exceptions become sentences that name the file.
std::vector<std::string> vdb_grid_names(const std::string& path);
openvdb::MetaMap vdb_metadata(const std::string& path);
// With voxels; a level set has its inside and outside filled with the sign they need. Refuses a
// name that is not there, and a transform that is not affine.
openvdb::GridBase::Ptr open_vdb_grid(const std::string& path, const std::string& name);

// How sentences name a grid: Grid 'mean' of "path".
std::string vdb_grid_quoted(const std::string& path, const std::string& grid);

// The map from index to object space. Refuses one that is not affine.
Affine index_to_object(const std::string& path, const openvdb::GridBase& grid);

// Makes what OpenVDB and its streams throw std::invalid_argument with the path. `doing`: "read" or
// "written".
template <class Action>
auto with_vdb_errors(const std::string& path, const char* doing, const Action& action) {
  try {
    return action();
  } catch (const openvdb::Exception& e) {
    throw std::invalid_argument("\"" + path + "\" could not be " + doing +
                                " as an OpenVDB file: " + printable(e.what()) + ".");
  } catch (const std::ios_base::failure&) {
    throw std::invalid_argument("\"" + path + "\" could not be " + doing +
                                ": the file ends too early, or what it says of its own length is "
                                "damaged.");
  } catch (const std::bad_alloc&) {
    throw std::invalid_argument("\"" + path + "\" could not be " + doing +
                                ": it asks for more memory than there is; it is damaged, or too "
                                "large for this machine.");
  } catch (const std::length_error&) {
    throw std::invalid_argument("\"" + path + "\" could not be " + doing +
                                ": what it says of its own length is damaged.");
  }
}

}  // namespace gpis
