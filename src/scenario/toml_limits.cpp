#include "src/scenario/toml_limits.hpp"

#include "topology/base/errors.hpp"

#include <cctype>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

class TomlScan {
 public:
  TomlScan(std::string_view text, const std::string& file) : text_(text), file_(file) {}

  void run() {
    while (at_ < text_.size()) {
      const char c = text_[at_];
      if (c == '"' || c == '\'') {
        skip_string(c); // may be a part of a key
      } else if (c == '#') {
        while (at_ < text_.size() && text_[at_] != '\n')
          ++at_;
      } else {
        ++at_;
        take(c);
      }
    }
  }

 private:
  void take(char c) {
    if (c == '\n') {
      ++line_;
      dots_ = 0;
    } else if (c == '.') {
      if (++dots_ >= most_key_parts)
        refuse("a key of more than {} parts", most_key_parts);
    } else if (c == '[' || c == '{') {
      dots_ = 0;
      if (++open_ > most_open_brackets)
        refuse("more than {} brackets within one another", most_open_brackets);
    } else if (c == ']' || c == '}') {
      dots_ = 0;
      open_ = open_ > 0 ? open_ - 1 : 0;
    } else if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '_' && c != '-' && c != ' ' && c != '\t') {
      dots_ = 0; // no key goes on over it
    }
  }

  void skip_string(char quote) {
    const std::string three(3, quote);
    const bool is_long = text_.substr(at_, 3) == three;
    at_ += is_long ? 3 : 1;
    while (at_ < text_.size()) {
      if (text_[at_] == '\n') {
        if (!is_long) // not closed: the parser tells
          return;
        ++line_;
      } else if (text_[at_] == '\\' && quote == '"' && at_ + 1 < text_.size() && text_[at_ + 1] != '\n') {
        ++at_;
      } else if (is_long ? text_.substr(at_, 3) == three : text_[at_] == quote) {
        at_ += is_long ? 3 : 1;
        return;
      }
      ++at_;
    }
  }

  void refuse(const char* what, int limit) const {
    throw InputError(fmt::format("{}:{}: not a scenario: {}; allowed: at most that", file_, line_,
                                 fmt::format(fmt::runtime(what), limit)));
  }

  std::string_view text_;
  const std::string& file_;
  std::size_t at_ = 0;
  long line_ = 1;
  int dots_ = 0; // since the key at hand began
  int open_ = 0;
};

} // namespace

void require_shallow_toml(std::string_view text, const std::string& file) {
  TomlScan(text, file).run();
}

} // namespace spherecut::app
