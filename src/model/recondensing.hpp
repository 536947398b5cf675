// A body condensed anew on a thread of its own, while the one it will replace goes on following its cut by updates.
#pragma once

#include "solvers/contact/solver.hpp"
#include "solvers/cut/growing_body.hpp"

#include <memory>

namespace spherecut::app {

/// The new body, and it condensed onto the tool's candidates.
struct Recondensed {
  std::unique_ptr<solvers::Discretisation> body; // Growable; null: it could not be made, or could not follow
  solvers::ContactPatch patch;                   // without candidates only its base is there
};

/// What the new body becomes does not depend on when: it is assembled from what it was begun with, and then follows the
/// same increments in the same order, so many of them in one. So a session that takes it over at the same step has the
/// same bits. In one, several short increments cost hardly more than each of them: where the steps take all the time
/// that one of them takes here, it would never catch up with them otherwise.
class Recondensing {
 public:
  /// Begins to assemble and condense, once `after` (given up; null: none) has come to its end: so one of them computes
  /// at a time. `candidates`: of the tool, nodes of the problem. `in_one`: increments that it follows in one, 1 or
  /// more.
  Recondensing(solvers::Problem problem, solvers::GrowthOptions options, std::vector<int> candidates, int in_one,
               std::unique_ptr<Recondensing> after);
  /// Waits for what is being computed.
  ~Recondensing();
  Recondensing(const Recondensing&) = delete;
  Recondensing& operator=(const Recondensing&) = delete;

  /// The cut has grown since: as Growable::grow, when the body is there. `candidates` are those from then on.
  void follow(solvers::SprinkleIncrement change, solvers::Problem grown, topology::SurfaceMesh way_ahead,
              std::vector<int> candidates);
  /// Nobody will take it: it stops as soon as it can.
  void give_up();
  /// Whether nothing is left to compute but the last increments, fewer than those followed in one.
  [[nodiscard]] bool ready() const;
  /// Follows those too, waits until nothing is left to compute and gives what it has become, once.
  Recondensed take();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

} // namespace spherecut::app
