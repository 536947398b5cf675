#include "src/base/build_identity.hpp"

#include "src/base/version.hpp"

#include <bit>
#include <cstring>
#include <elf.h>
#include <fmt/format.h>
#include <fstream>
#include <link.h>

namespace spherecut::app {
namespace {

constexpr std::size_t padded(std::size_t size) {
  return (size + 3) / 4 * 4;
}

// The note that ld --build-id leaves, of the first object: the program itself.
int find_note(dl_phdr_info* info, std::size_t /*size*/, void* found) {
  for (int i = 0; i < info->dlpi_phnum; ++i) {
    const ElfW(Phdr)& segment = info->dlpi_phdr[i];
    if (segment.p_type != PT_NOTE)
      continue;
    const auto* at = std::bit_cast<const char*>(info->dlpi_addr + segment.p_vaddr); // the loader's own address
    const char* end = at + segment.p_memsz;
    while (at + sizeof(ElfW(Nhdr)) <= end) {
      ElfW(Nhdr) note;
      std::memcpy(&note, at, sizeof note);
      const char* name = at + sizeof note;
      const char* value = name + padded(note.n_namesz);
      if (note.n_type == NT_GNU_BUILD_ID && note.n_namesz == 4 && std::memcmp(name, "GNU", 4) == 0) {
        for (std::size_t byte = 0; byte < note.n_descsz; ++byte)
          *static_cast<std::string*>(found) += fmt::format("{:02x}", static_cast<unsigned char>(value[byte]));
        return 1;
      }
      at = value + padded(note.n_descsz);
    }
  }
  return 1; // libraries after it are not asked
}

} // namespace

std::string build_identity() {
  std::string id;
  dl_iterate_phdr(find_note, &id);
  return fmt::format("{}{}{}", version(), id.empty() ? "" : " ", id);
}

std::string processor_name() {
  std::ifstream in("/proc/cpuinfo");
  for (std::string line; std::getline(in, line);)
    if (line.starts_with("model name"))
      if (const auto colon = line.find(':'); colon != std::string::npos && colon + 2 < line.size())
        return line.substr(colon + 2);
  return {};
}

} // namespace spherecut::app
