// What a session says.
#pragma once

#include <algorithm>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace spherecut::app {

class SessionLog {
 public:
  explicit SessionLog(std::function<void(const std::string&)> say) : say_(std::move(say)) {}

  void say(const std::string& text) const { say_(text); }
  /// Says a warning, once for each key.
  void warn(const std::string& key, const std::string& text) {
    if (std::find(warned_.begin(), warned_.end(), key) != warned_.end())
      return;
    warned_.push_back(key);
    warnings_.push_back(text);
    say_("warning: " + text);
  }
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  std::function<void(const std::string&)> say_;
  std::vector<std::string> warnings_, warned_;
};

} // namespace spherecut::app
