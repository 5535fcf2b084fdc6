// Errors that become Python exceptions: std::invalid_argument -> ValueError, FileNotFound ->
// FileNotFoundError. Every message is a sentence: what, what it held, what to do.
#pragma once

#include <stdexcept>
#include <string>

namespace gpis {

class FileNotFound : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace gpis
