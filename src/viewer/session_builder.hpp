// Sessions built one after the other, each on a thread of its own, beside the one that goes on.
#pragma once

#include "src/viewer/live_session.hpp"

namespace spherecut::app {

/// A session that a viewer has asked for, and what has come of it.
struct SessionOrder {
  std::string about; // the request
  std::string what;  // in words
  int client = 0;    // that asked
  Scenario scenario;
  LiveOptions options;
  std::string replayed;                   // name of the recording; empty: none
  std::unique_ptr<LiveSession> session{}; // null: it failed
  std::string code{}, failure{};
};

/// On the web server's thread, but for what it starts.
class SessionBuilder {
 public:
  /// `say` is called from the threads of sessions, as LiveSession says.
  explicit SessionBuilder(std::function<void(const std::string&)> say) : say_(std::move(say)) {}
  /// Waits for the session that is being built and for the one that ends.
  ~SessionBuilder();
  SessionBuilder(const SessionBuilder&) = delete;
  SessionBuilder& operator=(const SessionBuilder&) = delete;

  /// Builds this next, in place of what waited to be.
  void order(SessionOrder order) { next_ = std::make_unique<SessionOrder>(std::move(order)); }
  /// Starts on the order that waits, unless another one is being built. Whether it has.
  bool start();
  /// What is being built; null: nothing.
  [[nodiscard]] const SessionOrder* building() const { return job_ == nullptr ? nullptr : &job_->order; }
  /// The scenario that was ordered last, of those that wait or are being built; null: there is none.
  [[nodiscard]] const Scenario* newest() const;
  /// The order that has been built, or has failed, since the last call.
  [[nodiscard]] std::optional<SessionOrder> finished();
  /// Ends a session on a thread of its own, one at a time: it may be in a long solve.
  void end(std::unique_ptr<LiveSession> session);

 private:
  struct Job {
    SessionOrder order;
    std::atomic<bool> done{false}; // then the thread has left the rest to the server's
    std::thread thread{};
  };
  std::function<void(const std::string&)> say_;
  std::unique_ptr<Job> job_;
  std::unique_ptr<SessionOrder> next_;
  std::thread ending_; // of the session before
};

} // namespace spherecut::app
