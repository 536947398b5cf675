// What a TOML text may be before it is parsed: parsers, and what takes their tables apart, call themselves once a
// level.
#pragma once

#include <string>
#include <string_view>

namespace spherecut::app {

inline constexpr int most_key_parts = 16;     // of one key: a.b.c has three
inline constexpr int most_open_brackets = 32; // at a time

/// Looks at brackets, strings, comments and the dots between the parts of keys, without recursion. Throws InputError
/// with file, line and limit.
void require_shallow_toml(std::string_view text, const std::string& file);

} // namespace spherecut::app
