#include "field/vdb_reader.h"

#include <cstdint>

#include "core/printable.h"

#pragma GCC visibility push(default)
#include <openvdb/io/Stream.h>
#pragma GCC visibility pop

namespace gpis {

VdbReader::VdbReader(const std::string& path) : stream_(path, std::ios::binary) {
  stream_.exceptions(std::ios::failbit | std::ios::badbit);
  stream_.seekg(0, std::ios::end);
  size_ = stream_.tellg();
  stream_.seekg(0);
  readHeader(stream_);
  if (!inputHasGridOffsets()) {
    stream_.seekg(0);
    openvdb::io::Stream whole(stream_, /*delayLoad=*/false);
    grids_ = *whole.getGrids();
    metadata_ = *whole.getMetadata();
    for (const auto& grid : grids_) names_.push_back(printable(grid->getName()));
    return;
  }
  // Readers of leaves ask the stream for these.
  stream_metadata_.reset(new openvdb::io::StreamMetadata);
  stream_metadata_->setSeekable(true);
  openvdb::io::setStreamMetadataPtr(stream_, stream_metadata_, /*transfer=*/false);
  setFormatVersion(stream_);
  setLibraryVersion(stream_);
  setDataCompression(stream_);
  read_descriptors();
}

void VdbReader::read_descriptors() {
  check_metadata();
  metadata_.readMeta(stream_);
  for (auto count = readGridCount(stream_); count > 0; --count) {
    Entry entry;
    const std::streamoff start = stream_.tellg();
    check_texts(3);  // its name, its type, the grid that it is an instance of
    entry.grid = entry.descriptor.read(stream_);
    const std::streamoff end = entry.descriptor.getEndPos();
    if (end <= start || end > size_) throw std::ios_base::failure("end");  // it would not end
    stream_.seekg(end);
    names_.push_back(printable(entry.descriptor.gridName()));
    entries_.emplace(entry.descriptor.uniqueName(), std::move(entry));
  }
}

void VdbReader::skip_text() {
  std::uint32_t length = 0;
  stream_.read(reinterpret_cast<char*>(&length), sizeof length);
  if (stream_.tellg() + std::streamoff(length) > size_) throw std::ios_base::failure("length");
  stream_.seekg(length, std::ios::cur);
}

void VdbReader::check_texts(int count) {
  const auto start = stream_.tellg();
  for (; count > 0; --count) skip_text();
  stream_.seekg(start);
}

void VdbReader::check_metadata() {
  const auto start = stream_.tellg();
  std::uint32_t count = 0;
  stream_.read(reinterpret_cast<char*>(&count), sizeof count);
  for (; count > 0; --count)
    for (int part = 0; part < 3; ++part) skip_text();  // name, type, value
  stream_.seekg(start);
}

openvdb::GridBase::Ptr VdbReader::read(const std::string& name) {
  for (const auto& grid : grids_)
    if (printable(grid->getName()) == name) return grid;
  for (auto& [unique, entry] : entries_)
    if (printable(entry.descriptor.gridName()) == name) return read(entry);
  return nullptr;
}

openvdb::GridBase::Ptr VdbReader::read(Entry& entry) {
  entry.descriptor.seekToGrid(stream_);
  if (fileVersion() >= openvdb::OPENVDB_FILE_VERSION_NODE_MASK_COMPRESSION)
    stream_.seekg(sizeof(std::uint32_t), std::ios::cur);  // how it is compressed
  check_metadata();
  entry.descriptor.seekToGrid(stream_);
  readGrid(entry.grid, entry.descriptor, stream_);
  if (!entry.descriptor.isInstance()) return entry.grid;
  // It has another grid's tree.
  const auto parent = entries_.find(entry.descriptor.instanceParentName());
  if (parent == entries_.end() || parent->second.descriptor.isInstance())
    OPENVDB_THROW(openvdb::LookupError, "the grid that it is an instance of is not there");
  NamedGridMap grids{{entry.descriptor.uniqueName(), entry.grid},
                     {parent->first, read(parent->second)}};
  connectInstance(entry.descriptor, grids);
  return entry.grid;
}

}  // namespace gpis
