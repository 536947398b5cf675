// Finite elements that mesh the whole cut organ anew at every increment.
#include "experiments/remeshing_ledger/fem_model.hpp"
#include "experiments/remeshing_ledger/mesh_request.hpp"
#include "experiments/remeshing_ledger/own_process.hpp"

#include <fmt/format.h>

namespace spherecut::experiments::ledger {

namespace {

class FemRemesh final : public BackEnd {
 public:
  FemRemesh(const Scenario& scenario, const Resolution& resolution, Element element, double limit)
      : scenario_(scenario), resolution_(resolution), element_(element), limit_(limit), number_(resolution.first) {}

  std::string name() const override { return fmt::format("fem_remesh_{}", to_string(element_)); }
  Increment start() override { return solve(); }
  bool may_skip() const override { return true; }
  Increment advance(int to) override {
    number_ = to;
    return solve();
  }
  Opening opening() const override { return fem_opening(solution_.nodes, scenario_, solution_.displacement); }
  double condition() const override {
    return solvers::condition_estimate(*solution_.factor, solution_.norm, solution_.unknowns);
  }

 private:
  Increment solve() {
    Increment increment;
    increment.number = number_;
    increment.anew = true;
    MeshRequest request;
    {
      const StageClock clock(increment.times, Stage::topology);
      Grading grading{resolution_.fine, resolution_.slope, resolution_.coarse_over_fine * resolution_.fine,
                      front_of(scenario_, number_).points};
      request = mesh_request(scenario_, number_, grading);
    }
    const TetMesh meshed = mesh_for(
        increment, [&] { return mesh_volume(request); }, limit_);
    if (increment.failure.empty())
      part_and_solve(meshed, scenario_, element_, 1e-3 * resolution_.fine, increment, solution_);
    return increment;
  }

  Scenario scenario_;
  Resolution resolution_;
  Element element_;
  double limit_;
  int number_;
  FemSolution solution_;
};

} // namespace

std::unique_ptr<BackEnd> make_fem_remesh(const Scenario& scenario, const Resolution& resolution, Element element,
                                         double limit) {
  return std::make_unique<FemRemesh>(scenario, resolution, element, limit);
}

} // namespace spherecut::experiments::ledger
