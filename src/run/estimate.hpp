// What a run will take, told before it begins.
#pragma once

#include <string>

namespace spherecut::app {

class Session;

/// Memory and time of a run, within a factor of three on the machine it was measured on, and whether that is heavy. Of
/// a session that computes and has its first nodes.
std::string estimate_text(const Session& session);

} // namespace spherecut::app
