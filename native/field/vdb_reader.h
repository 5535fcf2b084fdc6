// The grids of a .vdb file, one at a time, from a stream that throws where it ends.
// openvdb::io::File does not look at its stream: a damaged count of tiles or metadata keeps it busy
// for hours.
#pragma once

#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "field/openvdb.h"

namespace gpis {

class VdbReader : private openvdb::io::Archive {
 public:
  // Throws what OpenVDB or the stream throws.
  explicit VdbReader(const std::string& path);

  // In the order of the file, printable.
  const std::vector<std::string>& names() const { return names_; }
  // Of the whole file.
  const openvdb::MetaMap& metadata() const { return metadata_; }
  // The first one of that name, null where there is none.
  openvdb::GridBase::Ptr read(const std::string& name);

 private:
  struct Entry {
    openvdb::io::GridDescriptor descriptor;
    openvdb::GridBase::Ptr grid;  // empty until it is read
  };

  void read_descriptors();
  // Throws where a text, or one of the metadata, that begins here says that it is longer than the
  // file: OpenVDB would fill gigabytes first.
  void check_texts(int count);
  void check_metadata();
  void skip_text();
  openvdb::GridBase::Ptr read(Entry& entry);

  openvdb::SharedPtr<openvdb::io::StreamMetadata> stream_metadata_;  // the stream points at it
  std::ifstream stream_;
  std::streamoff size_ = 0;  // bytes
  std::map<std::string, Entry>
      entries_;                // by unique name; empty for a file that cannot be searched
  openvdb::GridPtrVec grids_;  // of such a file
  openvdb::MetaMap metadata_;
  std::vector<std::string> names_;
};

}  // namespace gpis
