// Sessions of the hub: built beside the one that goes on, recorded, replayed.
#include "src/haptics/replay.hpp"
#include "src/viewer/hub.hpp"
#include "topology/errors.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <malloc.h>
#include <utility>

namespace spherecut::app {
namespace {

constexpr const char* recording_extension = ".recording";

} // namespace

// A recording begins with a session, so that it can be run again from there.
void Hub::record(int client, bool on) {
  if (!on) {
    session_->stop_recording();
    return;
  }
  if (session_->recording() || session_->replays() || changed_) {
    send(client, error_text("unavailable",
                            session_->recording() ? "this session is being recorded"
                            : changed_            ? "a recording refers to the scenario as its file has it: choose the "
                                                    "scenario anew"
                                                  : "a replay is going on",
                            "record"));
    return;
  }
  std::error_code error;
  std::filesystem::create_directories(options_.recordings, error);
  if (error)
    throw InputError(fmt::format("cannot make the folder {}: {}", options_.recordings.string(), error.message()));
  build(client, session_->scenario(), "record", "from the start, recorded", {unused_recording(), {}, {}});
}

void Hub::replay(int client, const std::optional<std::string>& name) {
  if (!name) {
    if (session_->replays())
      build(client, session_->scenario(), "replay", "from the start");
    return;
  }
  const std::vector<RecordingEntry> list = recordings();
  if (std::none_of(list.begin(), list.end(), [&](const RecordingEntry& entry) { return entry.name == *name; }))
    throw InputError(fmt::format("there is no recording '{}' in the list", *name));
  const auto recording = std::make_shared<const Recording>(read_recording(options_.recordings / *name));
  build(client, recorded_scenario(*recording), "replay", "replay of " + *name, {{}, recording, *name});
}

std::filesystem::path Hub::unused_recording() const {
  for (int number = 1;; ++number) {
    std::filesystem::path file = options_.recordings / fmt::format("session-{}{}", number, recording_extension);
    // A link that leads nowhere is a name in use too: writing would follow it out of the folder.
    if (std::error_code error;
        std::filesystem::symlink_status(file, error).type() == std::filesystem::file_type::not_found)
      return file;
  }
}

std::vector<RecordingEntry> Hub::recordings() const {
  std::vector<RecordingEntry> list;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(options_.recordings, error))
    if (entry.path().extension() == recording_extension)
      list.push_back({entry.path().filename().string(), entry.file_size(error)});
  std::sort(list.begin(), list.end(), [](const RecordingEntry& a, const RecordingEntry& b) { return a.name < b.name; });
  return list;
}

void Hub::tell_recording() {
  const bool now = session_->recording();
  if (now == recording_)
    return;
  recording_ = now;
  const std::filesystem::path& file = session_->recorded_to();
  std::error_code error;
  const std::uintmax_t bytes = std::filesystem::file_size(file, error);
  send_all(recording_text(now, {file.filename().string(), error ? 0 : bytes}, session_->tick().record.device.time));
}

void Hub::build(int client, Scenario scenario, std::string_view about, const std::string& what,
                const Recorded& recorded) {
  next_ = std::make_unique<Building>();
  next_->about = about;
  next_->what = what;
  next_->client = client;
  next_->scenario = std::move(scenario);
  next_->options = {options_.speed, recorded.to, recorded.from};
  next_->replayed = recorded.name;
  if (building_ == nullptr)
    start_building();
}

void Hub::start_building() {
  building_ = std::move(next_);
  send_all(building_text(building_->what));
  Building& job = *building_;
  job.thread = std::thread([this, &job, scenario = *job.scenario] {
    try {
      job.session =
          std::make_unique<LiveSession>(scenario, job.options, [this](const std::string& line) { say_here(line); });
    } catch (const InputError& error) {
      job.code = "refused";
      job.failure = error.what();
    } catch (const std::exception& error) {
      job.code = "solver";
      job.failure = error.what();
    }
    job.done.store(true, std::memory_order_release);
  });
}

void Hub::finish_building() {
  if (building_ == nullptr || !building_->done.load(std::memory_order_acquire))
    return;
  building_->thread.join();
  const std::unique_ptr<Building> job = std::move(building_);
  if (job->session != nullptr) {
    // The old one may be in a long solve: it ends on a thread of its own, one at a time.
    if (ending_.joinable())
      ending_.join();
    ending_ = std::thread([old = std::move(session_)]() mutable {
      old.reset();
      malloc_trim(0);
    });
    session_ = std::move(job->session);
    ++epoch_;
    changed_ = job->about == "set" || (changed_ && job->about != "scenario" && job->about != "replay");
    recording_ = false;
    if (!replaying_.empty() || session_->replays())
      send_all(replay_text(session_->replays(), session_->replays() ? job->replayed : replaying_));
    replaying_ = session_->replays() ? job->replayed : "";
    const std::vector<HandMode> modes = session_->modes();
    const bool kept = !session_->replays() && std::find(modes.begin(), modes.end(), target_.mode) != modes.end();
    target_.jumps = 0;
    put_down(kept ? target_.mode : modes.front());
    request_overlays();
    measured_ = Clock::now();
    ticks_before_ = solves_before_ = pictures_before_ = cuts_seen_ = 0;
    compute_before_ = 0;
    tear_ = {};
    number_in_solve_ = 0;
    session_->start();
    send_all(session_text(*session_, epoch_, target_.mode));
  } else {
    say_(fmt::format("the session goes on as it was: {}", job->failure));
    if (clients_.count(job->client) != 0)
      send(job->client, error_text(job->code, job->failure, job->about));
    send_all(session_text(*session_, epoch_, target_.mode));
  }
  if (next_ != nullptr)
    start_building();
}

} // namespace spherecut::app
