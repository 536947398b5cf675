#include "src/viewer/listed_files.hpp"

namespace spherecut::app {

std::vector<std::string> names_in(const std::filesystem::path& folder, std::string_view extension) {
  std::vector<std::string> names;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    std::error_code gone;
    if (entry->path().extension() == extension && entry->is_regular_file(gone))
      names.push_back(entry->path().filename().string());
  }
  return names;
}

bool is_entry(const std::filesystem::path& file, const std::string& name, std::string_view extension) {
  std::error_code error;
  return std::filesystem::path(name).filename() == name && file.extension() == extension &&
         std::filesystem::is_regular_file(file, error);
}

} // namespace spherecut::app
