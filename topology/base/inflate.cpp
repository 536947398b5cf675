#include "topology/base/inflate.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <limits>
#include <zlib.h>

namespace spherecut::topology {

std::string inflated(std::string_view packed, std::size_t most, const std::string& name) {
  constexpr int gzip_or_zlib = 32 + MAX_WBITS;
  constexpr std::size_t first_guess = 8; // unpacked over packed: no more memory is asked for than the stream may fill
  z_stream stream{};
  if (inflateInit2(&stream, gzip_or_zlib) != Z_OK)
    throw InputError(fmt::format("{}: zlib cannot be set up", name));
  std::string out;
  std::size_t taken = 0, made = 0;
  int state = Z_OK;
  while (state == Z_OK && made < most) {
    if (made == out.size())
      out.resize(std::min(most, std::max<std::size_t>(1 << 16, made == 0 ? first_guess * packed.size() : 2 * made)));
    constexpr std::size_t at_once = std::numeric_limits<uInt>::max();
    const std::size_t in = std::min(at_once, packed.size() - taken), room = std::min(at_once, out.size() - made);
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data() + taken)); // zlib only reads it
    stream.avail_in = static_cast<uInt>(in);
    stream.next_out = reinterpret_cast<Bytef*>(out.data() + made);
    stream.avail_out = static_cast<uInt>(room);
    state = inflate(&stream, Z_NO_FLUSH);
    taken += in - stream.avail_in;
    made += room - stream.avail_out;
  }
  inflateEnd(&stream);
  if (made < most)
    throw InputError(fmt::format("{}: its packed data {} after {} of {} bytes; is the file cut short?", name,
                                 state == Z_STREAM_END || state == Z_BUF_ERROR ? "end" : "are damaged", made, most));
  out.resize(made);
  return out;
}

} // namespace spherecut::topology
