#include "src/viewer/offered_files.hpp"

#include "src/scenario/document.hpp"
#include "src/viewer/listed_files.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/regular_file.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <functional>
#include <sstream>
#include <system_error>
#include <utility>

namespace spherecut::app {
namespace {

constexpr std::size_t title_within = 16384, longest_title = 200; // bytes of a scenario file, of what is told of it

/// The title that a scenario file gives itself, without reading the rest; empty: none.
std::string title_of(const std::filesystem::path& file) {
  std::istringstream text(topology::start_of_regular_file(file, title_within));
  for (std::string line; std::getline(text, line) && (line.empty() || line.front() != '[');) {
    if (line.rfind("title", 0) != 0)
      continue;
    const auto from = line.find('"');
    const auto to = line.rfind('"');
    if (from != std::string::npos && to > from)
      return line.substr(from + 1, std::min(to - from - 1, longest_title));
  }
  return {};
}

} // namespace

OfferedFiles::OfferedFiles(const std::filesystem::path& scenario, std::filesystem::path recordings)
    : scenarios_(scenario.has_parent_path() ? scenario.parent_path() : "."), recordings_(std::move(recordings)) {}

WelcomeLists OfferedFiles::lists() const {
  WelcomeLists list;
  list.scenarios = scenarios(list.scenarios_left_out);
  list.recordings = recordings(list.recordings_left_out);
  return list;
}

std::vector<ScenarioEntry> OfferedFiles::scenarios(std::size_t& left_out) const {
  std::vector<std::string> names = names_in(scenarios_, scenario_extension);
  std::sort(names.begin(), names.end());
  left_out = names.size() - std::min(names.size(), most_listed);
  names.resize(names.size() - left_out);
  std::vector<ScenarioEntry> list;
  list.reserve(names.size());
  for (const std::string& name : names)
    list.push_back({name, title_of(scenarios_ / name)});
  return list;
}

std::vector<RecordingEntry> OfferedFiles::recordings(std::size_t& left_out) const {
  std::vector<std::pair<std::filesystem::file_time_type, std::string>> found;
  std::error_code error;
  for (std::string& name : names_in(recordings_, recording_extension)) {
    const auto time = std::filesystem::last_write_time(recordings_ / name, error);
    if (!error)
      found.emplace_back(time, std::move(name));
  }
  std::sort(found.begin(), found.end(), std::greater<>());
  left_out = found.size() - std::min(found.size(), most_listed);
  found.resize(found.size() - left_out);
  std::vector<RecordingEntry> list;
  for (const auto& [time, name] : found)
    if (const auto bytes = std::filesystem::file_size(recordings_ / name, error); !error)
      list.push_back({name, bytes});
  std::sort(list.begin(), list.end(), [](const RecordingEntry& a, const RecordingEntry& b) { return a.name < b.name; });
  return list;
}

Scenario OfferedFiles::scenario(const std::string& name) const {
  const std::filesystem::path file = scenarios_ / name;
  if (!is_entry(file, name, scenario_extension))
    throw InputError(fmt::format("there is no scenario '{}' in the list", name));
  return read_scenario_text(file, topology::read_regular_file(file, largest_scenario));
}

Recording OfferedFiles::recording(const std::string& name) const {
  if (!is_entry(recordings_ / name, name, recording_extension))
    throw InputError(fmt::format("there is no recording '{}' in the list", name));
  return read_recording(recordings_ / name);
}

std::filesystem::path OfferedFiles::new_recording() {
  std::error_code error;
  std::filesystem::create_directories(recordings_, error);
  if (error)
    throw InputError(fmt::format("cannot make the folder {}: {}", recordings_.string(), error.message()));
  if (!claim_.holds())
    claim_ = ResultsClaim(recordings_);
  for (int number = 1;; ++number) {
    std::filesystem::path file = recordings_ / fmt::format("session-{}{}", number, recording_extension);
    // A link that leads nowhere is a name in use too: writing would follow it out of the folder.
    if (std::filesystem::symlink_status(file, error).type() == std::filesystem::file_type::not_found)
      return file;
  }
}

} // namespace spherecut::app
