// Finite elements that mesh the whole cut organ anew at every increment.
#include "experiments/remeshing_ledger/fem_model.hpp"
#include "experiments/remeshing_ledger/meshed_back_end.hpp"

#include <fmt/format.h>

namespace spherecut::experiments::ledger {

namespace {

class FemRemesh final : public MeshedBackEnd {
 public:
  FemRemesh(const Scenario& scenario, const Resolution& resolution, Element element, double limit)
      : MeshedBackEnd(scenario, resolution, element, limit) {}

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
    const TetMesh meshed = mesh_organ(increment);
    if (increment.failure.empty())
      part_and_solve(meshed, scenario_, element_, tolerance(), increment, solution_);
    return increment;
  }

  FemSolution solution_;
};

} // namespace

std::unique_ptr<BackEnd> make_fem_remesh(const Scenario& scenario, const Resolution& resolution, Element element,
                                         double limit) {
  return std::make_unique<FemRemesh>(scenario, resolution, element, limit);
}

} // namespace spherecut::experiments::ledger
