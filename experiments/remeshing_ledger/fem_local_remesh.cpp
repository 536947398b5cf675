// Finite elements that keep their mesh but for a cavity: the tetrahedra about the new strip of the cut are taken out
// and others put in that have the strip among their faces. The far part is condensed once onto what lies between; an
// increment factors the near part with that dense block, until a cavity leaves the near part. Then another near part,
// about the way ahead, is chosen.
#include "experiments/remeshing_ledger/cavity.hpp"
#include "experiments/remeshing_ledger/meshed_back_end.hpp"
#include "experiments/remeshing_ledger/own_process.hpp"
#include "experiments/remeshing_ledger/sub_structure.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments::ledger {

namespace {

constexpr std::array<double, 3> reaches{1.1, 1.5, 2}; // sizes at the front: of the cavity, one after the other tried
constexpr double edge_share = 0.7;                    // of the sizes that Mesh_3 is given: gives as many unknowns
constexpr double way_ahead = 0.8;                     // sizes at the front: so far ahead the near part serves
constexpr double grown = 1.6;                         // times the tetrahedra of the first mesh: then it is made anew

class FemLocalRemesh final : public MeshedBackEnd {
 public:
  FemLocalRemesh(const Scenario& scenario, const Resolution& resolution, Element element, double limit)
      : MeshedBackEnd(scenario, resolution, element, limit) {}

  std::string name() const override { return fmt::format("fem_local_remesh_{}", to_string(element_)); }
  bool may_skip() const override { return false; }
  Increment start() override { return anew({}); }

  Increment advance(int to) override {
    Increment increment;
    const int before = number_;
    number_ = to;
    if (!meshed_ || std::ssize(mesh_.tets) > grown * first_tets_)
      return anew(increment);
    std::string failure;
    for (const double reach : reaches) {
      if (!renew_cavity(increment, before, reach)) {
        failure = increment.failure;
        increment.failure.clear();
        continue;
      }
      try {
        return solve(increment);
      } catch (const NumericalError& error) { // a flat element at the front may leave the system indefinite
        failure = error.what();
        break;
      }
    }
    return anew(std::move(increment));
  }

  Opening opening() const override { return fem_opening(nodes_, scenario_, body_.displacement()); }
  double condition() const override { return body_.condition(); }

 private:
  Increment anew(Increment increment) {
    meshed_ = false;
    mesh_ = mesh_organ(increment);
    if (!increment.failure.empty())
      return increment;
    first_tets_ = static_cast<double>(mesh_.tets.size());
    near_.clear();
    meshed_ = true;
    try {
      return solve(std::move(increment));
    } catch (const NumericalError& error) {
      increment.failure = error.what();
      meshed_ = false;
      return increment;
    }
  }

  /// False, with the failure, where there is no use in it; the mesh is then as it was.
  bool renew_cavity(Increment& increment, int before, double reach) {
    try {
      Cavity cavity;
      {
        const StageClock clock(increment.times, Stage::meshing);
        cavity =
            open_cavity(mesh_, scenario_, before, number_, grading(edge_share), reach * resolution_.fine, tolerance());
      }
      const TetMesh filling = mesh_for(
          increment, [&] { return fill_cavity(cavity.border); }, limit_);
      if (!increment.failure.empty())
        return false;
      const StageClock clock(increment.times, Stage::meshing);
      close_cavity(mesh_, cavity, filling);
      std::size_t kept = 0;
      bool within = true;
      for (std::size_t t = 0; t < near_.size(); ++t)
        if (cavity.removed[t] == 0)
          near_[kept++] = near_[t];
        else
          within = within && near_[t] != 0;
      near_.resize(kept);
      near_.resize(mesh_.tets.size(), 1);
      if (!within)
        near_.clear();
      return true;
    } catch (const NumericalError& error) {
      increment.failure = error.what();
      return false;
    }
  }

  /// Tetrahedra of the cavities of the next increments.
  void choose_near() {
    const int last = std::min(
        scenario_.increments,
        number_ + std::max(1, static_cast<int>(std::lround(way_ahead * resolution_.fine / scenario_.advance))));
    std::vector<std::vector<Vector3>> edges;
    std::vector<Grading> sizes;
    const int stations =
        std::max(1, static_cast<int>(std::ceil((last - number_) * scenario_.advance / (0.4 * resolution_.fine))));
    for (int i = 0; i <= stations; ++i) {
      const int number = number_ + (last - number_) * i / stations;
      edges.push_back(leading_edge(scenario_, number));
      sizes.push_back(grading(edge_share));
      sizes.back().front = front_of(scenario_, number).points;
    }
    std::vector<char> within(mesh_.vertices.size());
    for (std::size_t i = 0; i < within.size(); ++i)
      within[i] =
          std::any_of(edges.begin(), edges.end(),
                      [&](const auto& edge) {
                        return distance_to(edge, mesh_.vertices[i]) < (reaches.front() + 0.2) * resolution_.fine;
                      })
              ? 1
              : 0;
    near_.clear();
    for (int t = 0; t < std::ssize(mesh_.tets); ++t) {
      const auto& tet = mesh_.tets[t];
      near_.push_back(std::any_of(tet.begin(), tet.end(), [&](int v) { return within[v] != 0; }) ||
                              std::any_of(sizes.begin(), sizes.end(),
                                          [&](const Grading& size) { return is_coarse(mesh_, t, size); })
                          ? 1
                          : 0);
    }
  }

  /// Leaves out vertices that no tetrahedron has.
  void compact() {
    std::vector<int> place(mesh_.vertices.size(), -1);
    std::vector<Vector3> used;
    for (auto& t : mesh_.tets)
      for (int& v : t) {
        if (place[v] < 0) {
          place[v] = static_cast<int>(used.size());
          used.push_back(mesh_.vertices[v]);
        }
        v = place[v];
      }
    mesh_.vertices = std::move(used);
  }

  Increment solve(Increment increment) {
    increment.number = number_;
    CutMesh cut;
    const bool choose = near_.empty();
    {
      const StageClock clock(increment.times, Stage::meshing);
      if (choose) {
        increment.anew = true;
        compact();
      }
      cut = part(mesh_, scenario_, number_, tolerance());
    }
    std::vector<NodeKey> keys;
    {
      const StageClock clock(increment.times, Stage::neighbours);
      if (choose)
        choose_near();
      nodes_ = number_nodes(cut, scenario_, element_);
      keys = node_keys(cut, nodes_);
    }
    if (choose) {
      body_.condense(nodes_, scenario_, near_, increment.times);
      const StageClock clock(increment.times, Stage::neighbours);
      body_.remember(keys);
    } else {
      body_.renew(nodes_, keys, near_, increment.times);
    }
    body_.solve(nodes_, scenario_, false, increment.times);
    increment.unknowns = body_.unknowns();
    increment.quality = smallest_quality(mesh_.vertices, mesh_.tets);
    return increment;
  }

  bool meshed_ = false;
  double first_tets_ = 0;
  TetMesh mesh_;
  std::vector<char> near_; // by tetrahedron; empty: to be chosen
  FemNodes nodes_;
  SubStructure body_;
};

} // namespace

std::unique_ptr<BackEnd> make_fem_local_remesh(const Scenario& scenario, const Resolution& resolution, Element element,
                                               double limit) {
  return std::make_unique<FemLocalRemesh>(scenario, resolution, element, limit);
}

} // namespace spherecut::experiments::ledger
