#include "topology/base/regular_file.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

namespace spherecut::topology {

namespace {

/// Closes what it has opened.
class OpenFile {
 public:
  explicit OpenFile(const std::filesystem::path& file)
      : descriptor_(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY)) {}
  ~OpenFile() {
    if (descriptor_ >= 0)
      ::close(descriptor_);
  }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
  [[nodiscard]] bool is_open() const { return descriptor_ >= 0; }
  /// Bytes; nothing where it is no regular file.
  [[nodiscard]] bool size(std::uintmax_t& bytes) const {
    struct stat status {};
    if (::fstat(descriptor_, &status) != 0 || !S_ISREG(status.st_mode))
      return false;
    bytes = static_cast<std::uintmax_t>(status.st_size);
    return true;
  }
  /// Appends up to `most` bytes; false when that fails.
  bool read(std::string& text, std::size_t most) const {
    const std::size_t block = 1U << 16U;
    while (text.size() < most) {
      const std::size_t before = text.size();
      text.resize(std::min(most, before + block));
      const ssize_t taken = ::read(descriptor_, text.data() + before, text.size() - before);
      text.resize(before + static_cast<std::size_t>(std::max<ssize_t>(taken, 0)));
      if (taken < 0 && errno != EINTR)
        return false;
      if (taken == 0)
        break;
    }
    return true;
  }

 private:
  int descriptor_;
};

} // namespace

std::string read_regular_file(const std::filesystem::path& file, std::uintmax_t most) {
  const auto refuse = [&](const std::string& why) { throw InputError(fmt::format("{}: {}", file.string(), why)); };
  const OpenFile open(file);
  if (!open.is_open())
    refuse(errno == ENOENT ? "there is no such file" : fmt::format("cannot be read: {}", std::strerror(errno)));
  std::uintmax_t size = 0;
  if (!open.size(size))
    refuse("this is no file, but a folder, a pipe or a device");
  std::string text;
  if (size <= most && !open.read(text, static_cast<std::size_t>(most) + 1))
    refuse(fmt::format("cannot be read: {}", std::strerror(errno)));
  if (size > most || text.size() > most) // it may have grown meanwhile
    refuse(fmt::format("{} bytes; allowed: at most {}", std::max<std::uintmax_t>(size, text.size()), most));
  return text;
}

std::string start_of_regular_file(const std::filesystem::path& file, std::size_t count) noexcept {
  try {
    const OpenFile open(file);
    std::uintmax_t size = 0;
    std::string text;
    return open.is_open() && open.size(size) && open.read(text, count) ? text : std::string();
  } catch (const std::bad_alloc&) {
    return {};
  }
}

} // namespace spherecut::topology
