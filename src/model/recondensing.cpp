#include "src/model/recondensing.hpp"

#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"

#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>

namespace spherecut::app {
namespace {

struct Increment {
  solvers::SprinkleIncrement change;
  solvers::Problem grown;
  topology::SurfaceMesh way_ahead;
  std::vector<int> candidates;
  int steps = 1;
};

/// False: it cannot be made, or cannot follow.
template <typename Work>
bool attempt(const Work& work) {
  try {
    return work();
  } catch (const InputError&) {
    return false;
  } catch (const NumericalError&) {
    return false;
  } catch (const Interrupted&) {
    return false;
  }
}

} // namespace

struct Recondensing::State {
  mutable std::mutex mutex;
  std::condition_variable changed;
  std::deque<Increment> waiting;
  int in_one = 1;
  bool busy = true, failed = false, stop = false, taken = false;
  Recondensed made; // of the thread until it is not busy
  std::thread thread;

  [[nodiscard]] bool has_work() const {
    return !failed && !waiting.empty() && (taken || waiting.front().steps == in_one);
  }

  void condense(const std::vector<int>& candidates) {
    if (!candidates.empty()) {
      made.patch = solvers::condense_without_fields(*made.body, candidates);
      return;
    }
    made.patch = {};
    made.patch.base = made.body->solve();
  }

  void run(solvers::Problem problem, solvers::GrowthOptions options, std::vector<int> candidates) {
    std::unique_lock lock(mutex);
    const auto compute = [&](const auto& work) {
      lock.unlock();
      const bool good = attempt(work);
      lock.lock();
      failed = failed || !good;
    };
    if (!stop)
      compute([&] {
        made.body = solvers::make_growable(std::move(problem), std::move(options));
        return true;
      });
    bool condensed = false;
    while (!stop) {
      if (has_work()) {
        Increment next = std::move(waiting.front());
        waiting.pop_front();
        compute([&] {
          const solvers::BodyGrowth growth =
              dynamic_cast<solvers::Growable&>(*made.body)
                  .grow(
                      next.change, std::move(next.grown), [&] { return std::move(next.way_ahead); }, false);
          return growth.uncovered[0] == '\0';
        });
        candidates = std::move(next.candidates);
        condensed = false;
        continue;
      }
      if (!failed && !condensed) {
        compute([&] {
          condense(candidates);
          return true;
        });
        condensed = true;
        continue;
      }
      busy = false;
      changed.notify_all();
      changed.wait(lock, [&] { return stop || has_work(); });
      busy = true;
    }
    busy = false;
    changed.notify_all();
  }
};

Recondensing::Recondensing(solvers::Problem problem, solvers::GrowthOptions options, std::vector<int> candidates,
                           int in_one, std::unique_ptr<Recondensing> after)
    : state_(std::make_unique<State>()) {
  state_->in_one = in_one;
  state_->thread = std::thread([&state = *state_, first = std::move(problem), how = std::move(options),
                                nodes = std::move(candidates), before = std::move(after)]() mutable {
    before.reset();
    state.run(std::move(first), std::move(how), std::move(nodes));
  });
}

Recondensing::~Recondensing() {
  give_up();
  if (state_->thread.joinable())
    state_->thread.join();
}

void Recondensing::follow(solvers::SprinkleIncrement change, solvers::Problem grown, topology::SurfaceMesh way_ahead,
                          std::vector<int> candidates) {
  const std::lock_guard lock(state_->mutex);
  if (state_->failed)
    return;
  std::deque<Increment>& waiting = state_->waiting;
  Increment next{std::move(change), std::move(grown), std::move(way_ahead), std::move(candidates)};
  if (!waiting.empty() && waiting.back().steps < state_->in_one) {
    const Increment& last = waiting.back();
    const int before =
        last.grown.nodes.size() - last.change.added.size() + static_cast<int>(last.change.removed.size());
    next.change = solvers::merged(last.change, next.change, before);
    next.steps += last.steps;
    waiting.back() = std::move(next);
  } else {
    waiting.push_back(std::move(next));
  }
  state_->changed.notify_all();
}

void Recondensing::give_up() {
  const std::lock_guard lock(state_->mutex);
  state_->stop = true;
  state_->waiting.clear();
  state_->changed.notify_all();
}

bool Recondensing::ready() const {
  const std::lock_guard lock(state_->mutex);
  return !state_->busy && !state_->has_work();
}

Recondensed Recondensing::take() {
  {
    std::unique_lock lock(state_->mutex);
    state_->taken = true;
    state_->changed.notify_all();
    state_->changed.wait(lock, [&] { return !state_->busy && (state_->failed || state_->waiting.empty()); });
    state_->stop = true;
    state_->changed.notify_all();
  }
  state_->thread.join();
  if (state_->failed)
    return {};
  return std::move(state_->made);
}

} // namespace spherecut::app
