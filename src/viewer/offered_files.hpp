// The scenarios and recordings that viewers choose from, and the folder that new recordings go to.
#pragma once

#include "src/base/output_file.hpp"
#include "src/viewer/replies.hpp"

namespace spherecut::app {

class OfferedFiles {
 public:
  /// The scenarios are those in the folder of `scenario`. The folder of the recordings is made with the first.
  OfferedFiles(const std::filesystem::path& scenario, std::filesystem::path recordings);

  /// At most 200 of a kind, by name; of the recordings the newest.
  [[nodiscard]] WelcomeLists lists() const;
  /// Throws InputError when there is no such entry or it cannot be read, as recording() does.
  [[nodiscard]] Scenario scenario(const std::string& name) const;
  [[nodiscard]] Recording recording(const std::string& name) const;
  /// File of a recording to come, session-N. Claims the folder for this server: two would number theirs alike. Throws
  /// InputError when the folder cannot be made or another one has it.
  [[nodiscard]] std::filesystem::path new_recording();

 private:
  [[nodiscard]] std::vector<ScenarioEntry> scenarios(std::size_t& left_out) const;
  [[nodiscard]] std::vector<RecordingEntry> recordings(std::size_t& left_out) const;

  std::filesystem::path scenarios_, recordings_; // folders
  ResultsClaim claim_;                           // from the first recording on
};

} // namespace spherecut::app
