// Linear tetrahedra split along the sheet, as surgical simulators do: every edge that the cut crosses gets a vertex
// where it is crossed, and its tetrahedra are halved. Nothing is done about their shapes. The front ends at the last
// edges crossed. The system is assembled and factored anew.
#include "experiments/remeshing_ledger/fem_model.hpp"
#include "experiments/remeshing_ledger/mesh_request.hpp"
#include "experiments/remeshing_ledger/meshed_back_end.hpp"
#include "experiments/remeshing_ledger/own_process.hpp"

#include <algorithm>
#include <cmath>
#include <set>

namespace spherecut::experiments::ledger {

namespace {

constexpr double in_plane = 1e-6; // of the size at the front: nearer to the plane a vertex lies in it

class FemSplit final : public MeshedBackEnd {
 public:
  FemSplit(const Scenario& scenario, const Resolution& resolution, double limit)
      : MeshedBackEnd(scenario, resolution, Element::linear, limit) {}

  std::string name() const override { return "fem_split"; }
  bool may_skip() const override { return false; }

  /// The mesh of the uncut organ, fine wherever the front will be.
  Increment start() override {
    Increment increment;
    increment.number = number_;
    increment.anew = true;
    const Grading at_first = grading();
    Grading at_last = at_first;
    at_last.front = front_of(scenario_, scenario_.increments).points;
    MeshRequest request = mesh_request(scenario_, number_, at_first);
    request.label = [this](const Vector3& x) { return scenario_.contains(x) ? 1 : 0; };
    request.features = scenario_.sharp_edges;
    request.size = [at_first, at_last](const Vector3& x) { return std::min(at_first(x), at_last(x)); };
    mesh_ = mesh_for(
        increment, [&] { return mesh_volume(request); }, limit_);
    if (!increment.failure.empty())
      return increment;
    tets_of_.assign(mesh_.vertices.size(), {});
    for (int t = 0; t < std::ssize(mesh_.tets); ++t)
      for (int v : mesh_.tets[t])
        tets_of_[v].push_back(t);
    return cut(std::move(increment));
  }

  Increment advance(int to) override {
    number_ = to;
    return cut({});
  }

  Opening opening() const override { return fem_opening(solution_.nodes, scenario_, solution_.displacement); }
  double condition() const override {
    return solvers::condition_estimate(*solution_.factor, solution_.norm, solution_.unknowns);
  }

 private:
  void split_edges() {
    const std::vector<Vector2> outline = scenario_.outline(number_);
    const double tolerance = in_plane * resolution_.fine;
    std::vector<double> height(mesh_.vertices.size());
    for (std::size_t i = 0; i < height.size(); ++i)
      height[i] = scenario_.height(mesh_.vertices[i]);
    std::set<std::array<int, 2>> crossed;
    for (const auto& t : mesh_.tets)
      for (int i = 0; i < 4; ++i)
        for (int j = i + 1; j < 4; ++j) {
          const int a = std::min(t[i], t[j]), b = std::max(t[i], t[j]);
          if (std::abs(height[a]) < tolerance || std::abs(height[b]) < tolerance || (height[a] < 0) == (height[b] < 0))
            continue;
          if (inside(outline, scenario_.in_plane(crossing(a, b, height))))
            crossed.insert({a, b});
        }
    for (const auto& [a, b] : crossed) {
      const int m = static_cast<int>(mesh_.vertices.size());
      mesh_.vertices.push_back(crossing(a, b, height));
      tets_of_.emplace_back();
      const std::vector<int> around = tets_of_[a];
      for (int t : around) {
        if (std::find(mesh_.tets[t].begin(), mesh_.tets[t].end(), b) == mesh_.tets[t].end())
          continue;
        const int other = static_cast<int>(mesh_.tets.size());
        std::array<int, 4> half = mesh_.tets[t];
        std::replace(mesh_.tets[t].begin(), mesh_.tets[t].end(), b, m);
        std::replace(half.begin(), half.end(), a, m);
        for (int v : half)
          tets_of_[v].push_back(other);
        tets_of_[m].push_back(t);
        tets_of_[b].erase(std::find(tets_of_[b].begin(), tets_of_[b].end(), t));
        mesh_.tets.push_back(half);
      }
    }
  }

  [[nodiscard]] Vector3 crossing(int a, int b, const std::vector<double>& height) const {
    return mesh_.vertices[a] + height[a] / (height[a] - height[b]) * (mesh_.vertices[b] - mesh_.vertices[a]);
  }

  Increment cut(Increment increment) {
    increment.number = number_;
    {
      const StageClock clock(increment.times, Stage::meshing);
      split_edges();
    }
    part_and_solve(mesh_, scenario_, element_, in_plane * resolution_.fine, increment, solution_);
    return increment;
  }

  TetMesh mesh_;
  std::vector<std::vector<int>> tets_of_; // by vertex
  FemSolution solution_;
};

} // namespace

std::unique_ptr<BackEnd> make_fem_split(const Scenario& scenario, const Resolution& resolution, double limit) {
  return std::make_unique<FemSplit>(scenario, resolution, limit);
}

} // namespace spherecut::experiments::ledger
