#include "src/viewer/session_builder.hpp"

#include "topology/base/errors.hpp"

#include <fmt/format.h>
#include <malloc.h>
#include <system_error>
#include <utility>

namespace spherecut::app {

SessionBuilder::~SessionBuilder() {
  if (job_ != nullptr && job_->thread.joinable())
    job_->thread.join();
  if (ending_.joinable())
    ending_.join();
}

bool SessionBuilder::start() {
  if (job_ != nullptr || next_ == nullptr)
    return false;
  job_ = std::make_unique<Job>();
  job_->order = std::move(*std::exchange(next_, nullptr));
  Job& job = *job_;
  const auto make = [this, &job, scenario = job.order.scenario] {
    try {
      job.order.session = std::make_unique<LiveSession>(scenario, job.order.options, say_);
    } catch (const InputError& error) {
      job.order.code = "refused";
      job.order.failure = error.what();
    } catch (const std::exception& error) {
      job.order.code = "solver";
      job.order.failure = error.what();
    }
    job.done.store(true, std::memory_order_release);
  };
  try {
    job.thread = std::thread(make);
  } catch (const std::system_error& error) {
    job.order.code = "solver";
    job.order.failure = fmt::format("no thread can be made for a new session: {}", error.what());
    job.done.store(true, std::memory_order_release);
  }
  return true;
}

const Scenario* SessionBuilder::newest() const {
  return next_ != nullptr ? &next_->scenario : job_ != nullptr ? &job_->order.scenario : nullptr;
}

std::optional<SessionOrder> SessionBuilder::finished() {
  if (job_ == nullptr || !job_->done.load(std::memory_order_acquire))
    return std::nullopt;
  if (job_->thread.joinable())
    job_->thread.join();
  std::optional<SessionOrder> order = std::move(job_->order);
  job_.reset();
  return order;
}

void SessionBuilder::end(std::unique_ptr<LiveSession> session) {
  if (ending_.joinable())
    ending_.join();
  const auto old = std::make_shared<std::unique_ptr<LiveSession>>(std::move(session));
  const auto end = [old] {
    old->reset();
    malloc_trim(0);
  };
  try {
    ending_ = std::thread(end);
  } catch (const std::system_error&) { // then the server waits for it
    end();
  }
}

} // namespace spherecut::app
