#include "src/output_file.hpp"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

namespace spherecut::app {
namespace {

constexpr std::string_view results[] = {"forces.csv", "cuts.csv",    "summary.json",    "series.pvd",
                                        "frames",     "haptic.json", "haptic.recording"};

} // namespace

OutputFile::OutputFile(std::filesystem::path file) : file_(std::move(file)) {
  descriptor_ = ::open(file_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (descriptor_ < 0)
    fail("cannot be opened for writing");
}

OutputFile::~OutputFile() {
  if (descriptor_ >= 0)
    ::close(descriptor_);
}

void OutputFile::write(std::string_view bytes) {
  const auto whole = static_cast<std::int64_t>(bytes.size());
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR)
      continue;
    if (written < 0) {
      const int reason = errno;
      if (::ftruncate(descriptor_, size_) == 0) // no part of a row stays
        ::lseek(descriptor_, size_, SEEK_SET);
      errno = reason;
      fail("cannot be written");
    }
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  size_ += whole;
}

void OutputFile::close() {
  const int descriptor = descriptor_;
  descriptor_ = -1;
  if (descriptor >= 0 && ::close(descriptor) != 0)
    fail("cannot be written");
}

void OutputFile::fail(const char* what) const {
  throw OutputError(fmt::format("{}: {}: {}", file_.string(), what, std::strerror(errno)));
}

void replace_file(const std::filesystem::path& file, std::string_view bytes) {
  const std::filesystem::path fresh = file.string() + ".part";
  std::error_code error;
  try {
    OutputFile out(fresh);
    out.write(bytes);
    out.close();
  } catch (const OutputError&) {
    std::filesystem::remove(fresh, error);
    throw;
  }
  std::filesystem::rename(fresh, file, error);
  if (error)
    throw OutputError(fmt::format("{}: cannot be replaced: {}", file.string(), error.message()));
}

void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  if (!std::filesystem::create_directory(folder, error) && error)
    throw OutputError(fmt::format("{}: cannot be created: {}", folder.string(), error.message()));
}

void claim_results_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!std::filesystem::is_directory(folder))
    throw InputError(fmt::format("output folder {}: cannot be created: {}", folder.string(),
                                 error ? error.message() : "there is a file of this name"));
  for (const std::string_view name : results)
    if (std::filesystem::exists(std::filesystem::symlink_status(folder / name, error)))
      throw InputError(
          fmt::format("output folder {}: holds results already ({}); give another folder, nothing has been "
                      "changed",
                      folder.string(), name));
  if (::access(folder.c_str(), W_OK | X_OK) != 0)
    throw InputError(fmt::format("output folder {}: cannot be written: {}", folder.string(), std::strerror(errno)));
}

} // namespace spherecut::app
