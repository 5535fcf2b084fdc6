#include "core/printable.h"

#include <algorithm>

namespace gpis {
namespace {

bool is_plain(unsigned char c) {
  return c >= 0x20 && c < 0x7f;
}

// Bytes that follow the first one of a character; -1 where it is none.
int followers(unsigned char c) {
  if (is_plain(c) || c == '\n' || c == '\t') return 0;
  if (c >= 0xc2 && c <= 0xdf) return 1;
  if (c >= 0xe0 && c <= 0xef) return 2;
  if (c >= 0xf0 && c <= 0xf4) return 3;
  return -1;
}

// Python refuses surrogates, overlong forms and what lies beyond U+10FFFF.
bool is_second_byte_of(unsigned char first, unsigned char second) {
  switch (first) {
    case 0xe0:
      return second >= 0xa0;
    case 0xed:
      return second < 0xa0;
    case 0xf0:
      return second >= 0x90;
    case 0xf4:
      return second < 0x90;
    default:
      return true;
  }
}

bool is_utf8(const std::string& text) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    const unsigned char first = text[i];
    const int count = followers(first);
    if (count < 0 || i + count >= text.size()) return false;
    for (int k = 1; k <= count; ++k)
      if ((static_cast<unsigned char>(text[i + k]) & 0xc0) != 0x80) return false;
    if (count > 0 && !is_second_byte_of(first, text[i + 1])) return false;
    i += count;
  }
  return true;
}

}  // namespace

std::string printable(const std::string& text) {
  if (is_utf8(text)) return text;
  std::string plain = text;
  std::replace_if(
      plain.begin(), plain.end(), [](unsigned char c) { return !is_plain(c); }, '?');
  return plain;
}

}  // namespace gpis
