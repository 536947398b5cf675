// A scenario file as a checked document: after the check every value is present or has its default, with the right
// type and within its range. Holds toml++ behind plain types.
#pragma once

#include "src/scenario/keys.hpp"
#include "topology/base/types.hpp"

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace spherecut::app {

inline constexpr std::size_t largest_scenario = 4U << 20U; // bytes; a scenario is a few kilobytes

/// Offences found in a file. Reported all at once.
class Offences {
 public:
  explicit Offences(std::string file) : file_(std::move(file)) {}
  void add(long line, std::string what);
  /// Throws InputError with one "file:line: what" for every offence, in the order of the lines; returns when there is
  /// none.
  void throw_if_any();

 private:
  std::string file_;
  std::vector<std::pair<long, std::string>> found_;
};

/// One table of the document. Values that the file leaves out come from the fallback in scenario_keys(). Asking for a
/// key that has neither is an error in this program, std::logic_error; the optional forms return nothing.
class Section {
 public:
  [[nodiscard]] bool has(std::string_view key) const;
  [[nodiscard]] double number(std::string_view key) const;
  [[nodiscard]] std::optional<double> optional_number(std::string_view key) const;
  [[nodiscard]] long integer(std::string_view key) const;
  [[nodiscard]] std::optional<long> optional_integer(std::string_view key) const;
  [[nodiscard]] bool boolean(std::string_view key) const;
  [[nodiscard]] std::string text(std::string_view key) const;
  [[nodiscard]] Vector3 vector(std::string_view key) const;
  [[nodiscard]] std::vector<Vector3> points(std::string_view key) const;
  /// Symmetric tensor of [xx, yy, zz] or [xx, yy, zz, yz, xz, xy].
  [[nodiscard]] Matrix3 strain(std::string_view key) const;
  [[nodiscard]] std::array<bool, 3> axes(std::string_view key) const;
  /// Sub-table; an empty section when the file leaves it out.
  [[nodiscard]] Section table(std::string_view key) const;
  [[nodiscard]] std::vector<Section> tables(std::string_view key) const;
  /// Line of a key, or of the table itself when it is left out; 0 for an absent table.
  [[nodiscard]] long line(std::string_view key = {}) const;

 private:
  friend class ScenarioDocument;
  struct Value; // a toml++ node, from the file or from a fallback
  [[nodiscard]] Value find(std::string_view key) const;
  [[nodiscard]] Value require(std::string_view key) const;

  std::shared_ptr<const void> document_; // keeps the tables alive
  const void* table_ = nullptr;          // toml::table, null when the file leaves it out
  std::string path_;                     // as in scenario_keys()
};

/// The value of a vector key as a unit vector, whatever its length; a zero vector is an offence (`name`: of the key in
/// messages) and stays zero, by which its reader knows to ask no more of it.
Vector3 direction(const Section& section, std::string_view name, std::string_view key, Offences& offences);

class ScenarioDocument {
 public:
  /// Reads and checks the file: syntax, unknown keys, types, ranges, missing keys. Throws InputError naming every
  /// offence.
  explicit ScenarioDocument(const std::filesystem::path& file);
  /// The same from a text, as if it were in that file.
  ScenarioDocument(const std::filesystem::path& file, std::string text);
  [[nodiscard]] const Section& root() const { return root_; }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
  Section root_;
};

} // namespace spherecut::app
