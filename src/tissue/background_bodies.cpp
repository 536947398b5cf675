#include "src/tissue/background_bodies.hpp"

#include <utility>

#include <sys/resource.h>

namespace spherecut::app {
namespace {

constexpr int niceness = 5; // above that of the steps: where they share a core the steps go first

void yield_to_steps() {
  static_cast<void>(setpriority(PRIO_PROCESS, 0, getpriority(PRIO_PROCESS, 0) + niceness)); // this thread's
}

bool is_ready(const std::future<BackgroundBody>& made) {
  return made.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
}

} // namespace

std::future<BackgroundBody> BackgroundBodies::begin(Make make) {
  return std::async(std::launch::async, [make = std::move(make), before = std::move(unwanted_)] {
    yield_to_steps();
    if (before.valid())
      before.wait();
    return make();
  });
}

std::pair<BackgroundBodies::Following, std::future<BackgroundBody>> BackgroundBodies::take_following() {
  std::pair taken(following_->what, std::move(following_->made));
  following_.reset();
  return taken;
}

std::pair<BackgroundBodies::Proposing, std::future<BackgroundBody>> BackgroundBodies::take_proposing() {
  std::pair taken(proposing_->what, std::move(proposing_->made));
  proposing_.reset();
  return taken;
}

void BackgroundBodies::drop_following() {
  if (following_)
    unwanted_ = std::move(following_->made);
  following_.reset();
}

void BackgroundBodies::drop_proposing() {
  if (proposing_)
    unwanted_ = std::move(proposing_->made);
  proposing_.reset();
}

void BackgroundBodies::let_arrive() {
  proposing_->made.wait();
  proposing_->arrived = true;
}

bool BackgroundBodies::is_there() const {
  if (following_)
    return is_ready(following_->made);
  return proposing_ && !proposing_->arrived && is_ready(proposing_->made);
}

} // namespace spherecut::app
