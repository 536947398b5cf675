// Files that say when they could not be written, and a results folder that never touches what is there.
#pragma once

#include "topology/base/errors.hpp"

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
  enum class Made { anew, over }; // a file of the name is refused; truncated
  /// Creates or truncates. Throws OutputError with the path and the system's reason.
  explicit OutputFile(std::filesystem::path file, Made made = Made::over);
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

/// A folder that this program alone writes results into: a file in it is locked, and goes with this. The system
/// unlocks it for a program that was killed.
class ResultsClaim {
 public:
  ResultsClaim() = default;
  /// Claims a folder that exists. Throws InputError when another program, or this one, has it, or no file can be made.
  explicit ResultsClaim(const std::filesystem::path& folder);
  ~ResultsClaim();
  ResultsClaim(ResultsClaim&& other) noexcept;
  ResultsClaim& operator=(ResultsClaim&& other) noexcept;
  ResultsClaim(const ResultsClaim&) = delete;
  ResultsClaim& operator=(const ResultsClaim&) = delete;
  [[nodiscard]] bool holds() const { return descriptor_ >= 0; }

 private:
  std::filesystem::path lock_;
  int descriptor_ = -1;
};

/// Creates the folder of a run and claims it. Throws InputError when it cannot be created or written, holds results
/// already, or another run writes into it.
[[nodiscard]] ResultsClaim claim_results_folder(const std::filesystem::path& folder);

/// Creates a folder for results in one that exists. Throws OutputError.
void make_folder(const std::filesystem::path& folder);

} // namespace spherecut::app
