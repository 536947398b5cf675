// Files that say when they could not be written, and a results folder that never touches what is there.
#pragma once

#include "topology/errors.hpp"

#include <cstdint>
#include <filesystem>
#include <string_view>

namespace spherecut::app {

/// Results that cannot be written. The message has the path and the system's reason.
class OutputError : public InputError {
 public:
  using InputError::InputError;
};

/// A file open for writing. Every write reaches the system before it returns, so that an interrupted run keeps it.
class OutputFile {
 public:
  /// Creates or truncates. Throws OutputError with the path and the system's reason.
  explicit OutputFile(std::filesystem::path file);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  /// Throws OutputError (full disk, file too large, ...); the file then ends with what was written before.
  void write(std::string_view bytes);
  /// Throws OutputError when the system reports a late failure.
  void close();

 private:
  [[noreturn]] void fail(const char* what) const;
  std::filesystem::path file_;
  int descriptor_ = -1;
  std::int64_t size_ = 0; // bytes that were written whole
};

/// Writes the whole file beside its place and moves it there: a reader sees the old or the new, never a part. Throws
/// OutputError; the old file then remains.
void replace_file(const std::filesystem::path& file, std::string_view bytes);

/// Creates the folder of a run. Throws InputError when it cannot be created or written, or holds results already.
void claim_results_folder(const std::filesystem::path& folder);

/// Creates a folder for results in one that exists. Throws OutputError.
void make_folder(const std::filesystem::path& folder);

} // namespace spherecut::app
