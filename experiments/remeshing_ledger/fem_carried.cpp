// Finite elements that keep their mesh: near the front it is carried along with it, so that only those elements change;
// the far part is condensed once onto what lies between, and an increment factors the near part with that dense block.
// The topology of the mesh, and with it the order of elimination, stays until the elements have become too flat. Then
// the organ is meshed and condensed anew.
#include "experiments/remeshing_ledger/fem_model.hpp"
#include "experiments/remeshing_ledger/meshed_back_end.hpp"
#include "experiments/remeshing_ledger/sub_structure.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments::ledger {

namespace {

constexpr double rigid_reach = 0.5;  // sizes at the front: so far the mesh moves with it
constexpr double moving_reach = 2.5; // so far it moves at all
constexpr double worn = 0.3;         // of the smallest quality at the start: below, the mesh is made anew

class FemCarried final : public MeshedBackEnd {
 public:
  FemCarried(const Scenario& scenario, const Resolution& resolution, Element element, double limit)
      : MeshedBackEnd(scenario, resolution, element, limit) {}

  std::string name() const override { return fmt::format("fem_carried_{}", to_string(element_)); }
  bool may_skip() const override { return false; }

  Increment start() override { return anew({}); }

  Increment advance(int to) override {
    Increment increment;
    number_ = to;
    if (!meshed_)
      return anew(increment);
    {
      const StageClock clock(increment.times, Stage::meshing);
      carry();
    }
    if (increment.quality = moved_quality(); increment.quality < worn * first_quality_)
      return anew(increment);
    try {
      return solve(increment);
    } catch (const NumericalError&) { // a flat element at the front may leave the system indefinite
      return anew(std::move(increment));
    }
  }

  Opening opening() const override { return fem_opening(nodes_, scenario_, body_.displacement()); }
  double condition() const override { return body_.condition(); }

 private:
  /// Distance to the part of the front that moves.
  [[nodiscard]] double to_front(const Vector3& x) const { return distance_to(base_edge_, x); }

  /// How a point moves that is carried along from the front of number base_ to that of number_.
  [[nodiscard]] Vector3 carried(const Vector3& x) const {
    const std::vector<Vector2> before = scenario_.outline(base_), now = scenario_.outline(number_);
    if (front_closed_) {
      const Vector2 p = (now.front().norm() / before.front().norm() - 1) * scenario_.in_plane(x);
      return p.x() * scenario_.frame.ahead + p.y() * scenario_.frame.tangent;
    }
    return (now[1].x() - before[1].x()) * scenario_.frame.ahead;
  }

  void carry() {
    const topology::Domain& domain = *scenario_.domain;
    for (std::size_t i = 0; i < first_.size(); ++i) {
      if (share_[i] == 0)
        continue;
      Vector3 x = first_[i] + share_[i] * carried(first_[i]);
      if (curved_skin_[i] != 0) { // back to the surface, in the plane of the cut where it lay in it
        const bool in_plane = std::abs(scenario_.height(first_[i])) < tolerance();
        for (int step = 0; step < 3; ++step) {
          const Vector3 n = domain.normal(x), way = in_plane ? scenario_.frame.tangent : n;
          x -= domain.signed_distance(x) / n.dot(way) * way;
        }
      }
      nodes_.positions[i] = x;
    }
    nodes_.place_edges();
  }

  [[nodiscard]] double moved_quality() const {
    double least = 1;
    for (std::size_t e = 0; e < nodes_.elements.size(); ++e)
      if (body_.is_near(e)) {
        const auto& t = nodes_.elements[e];
        const auto& x = nodes_.positions;
        least = std::min(least, shape_quality(x[t[0]], x[t[1]], x[t[2]], x[t[3]]));
      }
    return least;
  }

  /// Which corners move, by how much of the front's motion.
  void share_motion(const CutMesh& mesh) {
    first_ = mesh.vertices;
    share_.assign(first_.size(), 0);
    curved_skin_.assign(first_.size(), 0);
    const double h = resolution_.fine;
    const int ahead = std::min(scenario_.increments, base_ + 1);
    const int number = number_;
    number_ = ahead == base_ ? base_ - 1 : ahead;
    for (std::size_t i = 0; i < first_.size(); ++i) {
      const double d = to_front(first_[i]);
      share_[i] = std::clamp((moving_reach * h - d) / ((moving_reach - rigid_reach) * h), 0.0, 1.0);
      if (!front_closed_) { // the back of the cut stays
        const std::vector<Vector2> outline = scenario_.outline(base_);
        const double back = outline[0].x(), way = 0.5 * (outline[1].x() - back);
        share_[i] *= std::clamp((scenario_.in_plane(first_[i]).x() - back) / way, 0.0, 1.0);
      }
      if (share_[i] == 0 || mesh.skin[i] == 0)
        continue;
      // The skin slides in itself: corners on sharp edges stay, and so do faces across the motion.
      int planes = 0;
      const Vector3 way = carried(first_[i]).normalized();
      for (const Plane& plane : scenario_.domain->planes())
        if (std::abs(plane.signed_distance(first_[i])) < 1e-6 * scenario_.size) {
          ++planes;
          if (std::abs(plane.normal.dot(way)) > 1e-9)
            share_[i] = 0;
        }
      if (planes > 1)
        share_[i] = 0;
      curved_skin_[i] = planes == 0 && share_[i] > 0 ? 1 : 0;
    }
    number_ = number;
  }

  /// Another mesh, of slightly smaller elements, where one is of no use.
  Increment anew(Increment increment) {
    for (const double share : {1.0, 0.97, 0.94}) {
      increment.failure.clear();
      increment = anew(std::move(increment), share);
      if (increment.failure.empty())
        break;
    }
    return increment;
  }

  Increment anew(Increment increment, double share) {
    base_ = number_;
    base_edge_ = leading_edge(scenario_, base_);
    front_closed_ = front_of(scenario_, base_).closed;
    meshed_ = false;
    const TetMesh meshed = mesh_organ(increment, share);
    if (!increment.failure.empty())
      return increment;
    try {
      CutMesh mesh;
      {
        const StageClock clock(increment.times, Stage::meshing);
        mesh = part(meshed, scenario_, number_, tolerance());
        share_motion(mesh);
      }
      {
        const StageClock clock(increment.times, Stage::neighbours);
        nodes_ = number_nodes(mesh, scenario_, element_);
      }
      body_.condense(nodes_, scenario_, moving(), increment.times);
      first_quality_ = increment.quality = moved_quality();
      meshed_ = true;
      return solve(std::move(increment));
    } catch (const NumericalError& error) {
      increment.failure = error.what();
      return increment;
    }
  }

  [[nodiscard]] std::vector<char> moving() const {
    std::vector<char> near;
    for (const auto& element : nodes_.elements)
      near.push_back(std::any_of(element.begin(), element.begin() + 4, [&](int v) { return share_[v] > 0; }) ? 1 : 0);
    return near;
  }

  Increment solve(Increment increment) {
    increment.number = number_;
    body_.solve(nodes_, scenario_, number_ != base_, increment.times);
    increment.unknowns = body_.unknowns();
    return increment;
  }

  int base_ = 0; // number of the cut that the mesh was made for
  bool front_closed_ = false, meshed_ = false;
  FemNodes nodes_;
  std::vector<Vector3> first_; // corners when the mesh was made
  std::vector<double> share_;  // of the front's motion, by corner
  std::vector<char> curved_skin_;
  std::vector<Vector3> base_edge_; // the front's part that moves, when the mesh was made
  double first_quality_ = 0;
  SubStructure body_;
};

} // namespace

std::unique_ptr<BackEnd> make_fem_carried(const Scenario& scenario, const Resolution& resolution, Element element,
                                          double limit) {
  return std::make_unique<FemCarried>(scenario, resolution, element, limit);
}

} // namespace spherecut::experiments::ledger
