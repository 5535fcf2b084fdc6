// Text from a file, fit to be shown: bytes that are no UTF-8 would empty a Python error.
#pragma once

#include <string>

namespace gpis {

// As it is where it is UTF-8 without control characters; else with '?' for all that is not plain
// ASCII.
std::string printable(const std::string& text);

}  // namespace gpis
