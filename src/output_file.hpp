// Files that say when they could not be written, and a results folder that never touches what is there.
#pragma once

#include <filesystem>
#include <string_view>

namespace spherecut::app {

/// A file open for writing. Every write reaches the system before it returns, so that an interrupted run keeps it.
class OutputFile {
 public:
  /// Creates or truncates. Throws InputError with the path and the system's reason.
  explicit OutputFile(std::filesystem::path file);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  /// Throws InputError (full disk, file too large, ...).
  void write(std::string_view bytes);
  /// Throws InputError when the system reports a late failure.
  void close();

 private:
  [[noreturn]] void fail(const char* what) const;
  std::filesystem::path file_;
  int descriptor_ = -1;
};

/// Writes the whole file beside its place and moves it there: a reader sees the old or the new, never a part. Throws
/// InputError; the old file then remains.
void replace_file(const std::filesystem::path& file, std::string_view bytes);

/// Creates the folder of a run. Throws InputError when it cannot be created or written, or holds results already.
void claim_results_folder(const std::filesystem::path& folder);

} // namespace spherecut::app
