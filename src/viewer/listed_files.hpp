// Files of a folder that viewers may choose from.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace spherecut::app {

inline constexpr std::string_view scenario_extension = ".toml", recording_extension = ".recording";
inline constexpr std::size_t most_listed = 200; // entries of one kind that a viewer is told of

/// Names of the regular files, or links to such, with that extension; in no order. Pipes, devices and folders are none.
[[nodiscard]] std::vector<std::string> names_in(const std::filesystem::path& folder, std::string_view extension);

/// Whether `file` is such an entry of its folder, by that name: not one elsewhere that the name leads to.
[[nodiscard]] bool is_entry(const std::filesystem::path& file, const std::string& name, std::string_view extension);

} // namespace spherecut::app
