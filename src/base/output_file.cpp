#include "src/base/output_file.hpp"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <utility>

namespace spherecut::app {
namespace {

constexpr const char* lock_name = ".spherecut.lock";
constexpr std::string_view results[] = {"forces.csv", "cuts.csv",    "summary.json",    "series.pvd",
                                        "frames",     "haptic.json", "haptic.recording"};

} // namespace

OutputFile::OutputFile(std::filesystem::path file, Made made) : file_(std::move(file)) {
  const int how = made == Made::anew ? O_EXCL : O_TRUNC;
  descriptor_ = ::open(file_.c_str(), O_WRONLY | O_CREAT | how | O_CLOEXEC, 0666);
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

ResultsClaim::ResultsClaim(const std::filesystem::path& folder) : lock_(folder / lock_name) {
  const auto refuse = [&](const std::string& why) {
    const int descriptor = std::exchange(descriptor_, -1);
    if (descriptor >= 0)
      ::close(descriptor);
    throw InputError(fmt::format("output folder {}: {}", folder.string(), why));
  };
  while (true) {
    descriptor_ = ::open(lock_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0666);
    if (descriptor_ < 0)
      refuse(fmt::format("cannot be written: {}", std::strerror(errno)));
    if (::flock(descriptor_, LOCK_EX | LOCK_NB) != 0)
      refuse(errno == EWOULDBLOCK ? "another run writes into it; give another folder, nothing has been changed"
                                  : fmt::format("cannot be locked: {}", std::strerror(errno)));
    // The one before may have taken the name away between the two calls: then the lock is on a file nobody sees.
    struct stat own {
    }, named{};
    if (::fstat(descriptor_, &own) == 0 && ::stat(lock_.c_str(), &named) == 0 && own.st_ino == named.st_ino &&
        own.st_dev == named.st_dev)
      return;
    ::close(descriptor_);
  }
}

ResultsClaim::~ResultsClaim() {
  if (descriptor_ < 0)
    return;
  ::unlink(lock_.c_str());
  ::close(descriptor_);
}

ResultsClaim::ResultsClaim(ResultsClaim&& other) noexcept
    : lock_(std::move(other.lock_)), descriptor_(std::exchange(other.descriptor_, -1)) {}

ResultsClaim& ResultsClaim::operator=(ResultsClaim&& other) noexcept {
  std::swap(lock_, other.lock_);
  std::swap(descriptor_, other.descriptor_);
  return *this; // the other lets go of what was held before
}

ResultsClaim claim_results_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!std::filesystem::is_directory(folder))
    throw InputError(fmt::format("output folder {}: cannot be created: {}", folder.string(),
                                 error ? error.message() : "there is a file of this name"));
  if (::access(folder.c_str(), W_OK | X_OK) != 0)
    throw InputError(fmt::format("output folder {}: cannot be written: {}", folder.string(), std::strerror(errno)));
  ResultsClaim claim(folder); // before the look: results that are being made are there only later
  for (const std::string_view name : results)
    if (std::filesystem::exists(std::filesystem::symlink_status(folder / name, error)))
      throw InputError(
          fmt::format("output folder {}: holds results already ({}); give another folder, nothing has been "
                      "changed",
                      folder.string(), name));
  return claim;
}

} // namespace spherecut::app
