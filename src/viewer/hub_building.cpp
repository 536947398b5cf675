// Sessions of the hub: built beside the one that goes on, recorded, replayed.
#include "src/live/replay.hpp"
#include "src/viewer/hub.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <functional>
#include <malloc.h>
#include <system_error>
#include <utility>

namespace spherecut::app {
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
  if (!recordings_.holds())
    recordings_ = ResultsClaim(options_.recordings); // two servers would number theirs alike
  build(client, session_->scenario(), "record", "from the start, recorded", {unused_recording(), {}, {}});
}

void Hub::replay(int client, const std::optional<std::string>& name) {
  if (!name) {
    if (session_->replays())
      build(client, session_->scenario(), "replay", "from the start");
    return;
  }
  if (!is_entry(options_.recordings / *name, *name, recording_extension))
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

// The newest, should there be many.
std::vector<RecordingEntry> Hub::recordings(std::size_t& left_out) const {
  std::vector<std::pair<std::filesystem::file_time_type, std::string>> found;
  std::error_code error;
  for (std::string& name : names_in(options_.recordings, recording_extension)) {
    const auto time = std::filesystem::last_write_time(options_.recordings / name, error);
    if (!error)
      found.emplace_back(time, std::move(name));
  }
  std::sort(found.begin(), found.end(), std::greater<>());
  left_out = found.size() - std::min(found.size(), most_listed);
  found.resize(found.size() - left_out);
  std::vector<RecordingEntry> list;
  for (const auto& [time, name] : found)
    if (const auto bytes = std::filesystem::file_size(options_.recordings / name, error); !error)
      list.push_back({name, bytes});
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
  const auto make = [this, &job, scenario = *job.scenario] {
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
  };
  try {
    job.thread = std::thread(make);
  } catch (const std::system_error& error) {
    job.code = "solver";
    job.failure = fmt::format("no thread can be made for a new session: {}", error.what());
    job.done.store(true, std::memory_order_release);
  }
}

void Hub::finish_building() {
  if (building_ == nullptr || !building_->done.load(std::memory_order_acquire))
    return;
  if (building_->thread.joinable())
    building_->thread.join();
  const std::unique_ptr<Building> job = std::move(building_);
  if (job->session != nullptr) {
    // The old one may be in a long solve: it ends on a thread of its own, one at a time.
    if (ending_.joinable())
      ending_.join();
    const auto old = std::make_shared<std::unique_ptr<LiveSession>>(std::exchange(session_, std::move(job->session)));
    const auto end = [old] {
      old->reset();
      malloc_trim(0);
    };
    try {
      ending_ = std::thread(end);
    } catch (const std::system_error&) { // then the server waits for it
      end();
    }
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
