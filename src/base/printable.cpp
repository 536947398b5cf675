#include "src/base/printable.hpp"

#include <fmt/format.h>

namespace spherecut::app {
namespace {

constexpr std::uint32_t no_character = 0xffffffffU;

/// The character that begins at `at`, and its number of bytes; no_character where that is no UTF-8.
std::uint32_t character_at(std::string_view text, std::size_t at, std::size_t& size) {
  const auto byte = [&](std::size_t k) { return static_cast<std::uint32_t>(static_cast<unsigned char>(text[k])); };
  const std::uint32_t first = byte(at);
  size = first < 0x80                    ? 1
         : first >= 0xc2 && first < 0xe0 ? 2
         : first >= 0xe0 && first < 0xf0 ? 3
         : first >= 0xf0 && first < 0xf5 ? 4
                                         : 0;
  if (size == 0 || at + size > text.size())
    return no_character;
  if (size == 1)
    return first;
  std::uint32_t code = first & (0x7fU >> size);
  for (std::size_t k = 1; k < size; ++k) {
    if ((byte(at + k) & 0xc0U) != 0x80)
      return no_character;
    code = code << 6U | (byte(at + k) & 0x3fU);
  }
  const bool overlong = (size == 3 && code < 0x800) || (size == 4 && code < 0x10000);
  return overlong || code > 0x10ffff || (code >= 0xd800 && code < 0xe000) ? no_character : code;
}

bool is_shown(std::uint32_t code) {
  if (code == '\n' || code == '\t')
    return true;
  const bool turns_text = (code >= 0x202a && code <= 0x202e) || (code >= 0x2066 && code <= 0x2069);
  return code >= 0x20 && code != 0x7f && !(code >= 0x80 && code < 0xa0) && !turns_text;
}

} // namespace

std::string printable(std::string_view text) {
  std::string shown;
  shown.reserve(text.size());
  for (std::size_t at = 0; at < text.size();) {
    std::size_t size = 0;
    const std::uint32_t code = character_at(text, at, size);
    if (code == no_character) {
      shown += fmt::format("\\x{:02x}", static_cast<unsigned char>(text[at++]));
      continue;
    }
    if (is_shown(code))
      shown += text.substr(at, size);
    else
      shown += code < 0x80 ? fmt::format("\\x{:02x}", code) : fmt::format("\\u{:04x}", code);
    at += size;
  }
  return shown;
}

} // namespace spherecut::app
