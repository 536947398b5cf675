// What a run will take, told before it begins.
#pragma once

#include <string>

namespace spherecut::app {

class Session;

/// Memory and time of a run, coarse: runs on the machine it was measured on took 0.6 to 3.3 times what it tells; and
/// whether that is heavy. Of a session that computes and has its first nodes.
std::string estimate_text(const Session& session);

} // namespace spherecut::app
