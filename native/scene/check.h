// Checks of the description; each throws std::invalid_argument with a sentence that names the path
// in the description.
#pragma once

#include <string>

#include "scene/description.h"

namespace gpis {

// Names a member of one entry: "objects[2].matrix of 'bunny'" in a list, "materials['wood'].color"
// in a dict.
struct EntryPath {
  std::string entry, name;

  EntryPath(const char* dict, const std::string& key)
      : entry(std::string(dict) + "['" + key + "']") {}
  EntryPath(const char* list, std::size_t i, const std::string& entry_name)
      : entry(std::string(list) + "[" + std::to_string(i) + "]"), name(entry_name) {}
  std::string operator+(const std::string& member) const {
    return entry + member + (name.empty() ? "" : " of '" + name + "'");
  }
};

void check(const SceneDescription& description);

}  // namespace gpis
