// What gzip and zlib have packed.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace spherecut::topology {

/// Unpacks a gzip or zlib stream until `most` bytes are there; what follows them is not looked at. Throws InputError,
/// starting with `name`, when the stream is damaged or ends early.
std::string inflated(std::string_view packed, std::size_t most, const std::string& name);

} // namespace spherecut::topology
