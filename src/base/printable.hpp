// Text from outside (names of files, a recording's header, what a library says) as a terminal may get it.
#pragma once

#include <string>
#include <string_view>

namespace spherecut::app {

/// The text with its control characters written out, "\x1b" for an escape, and bytes that are no UTF-8 likewise; line
/// ends and tabs stay. A terminal that gets it does nothing but show it.
[[nodiscard]] std::string printable(std::string_view text);

} // namespace spherecut::app
