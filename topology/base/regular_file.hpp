// Files that nobody has vouched for: a pipe or a device of the same name neither stops the reader nor fills its memory.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace spherecut::topology {

/// The whole file. Never waits. Throws InputError with file and reason where it is not a regular file (a link to one
/// is), cannot be read, or has more than `most` bytes.
[[nodiscard]] std::string read_regular_file(const std::filesystem::path& file, std::uintmax_t most);

/// At most its first `count` bytes; empty where the above would throw for another reason than its size.
[[nodiscard]] std::string start_of_regular_file(const std::filesystem::path& file, std::size_t count) noexcept;

} // namespace spherecut::topology
