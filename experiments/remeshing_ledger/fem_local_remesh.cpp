// Finite elements that keep their mesh: near the front it is carried along with it, so that only those elements change;
// the far part is condensed once onto what lies between, and an increment factors the near part with that dense block.
// The topology of the mesh, and with it the order of elimination, stays until the elements have become too flat. Then
// the organ is meshed and condensed anew.
#include "experiments/remeshing_ledger/fem_model.hpp"
#include "experiments/remeshing_ledger/mesh_request.hpp"
#include "experiments/remeshing_ledger/own_process.hpp"
#include "topology/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments::ledger {

namespace {

constexpr double rigid_reach = 0.5;  // sizes at the front: so far the mesh moves with it
constexpr double moving_reach = 2.5; // so far it moves at all
constexpr double worn = 0.3;         // of the smallest quality at the start: below, the mesh is made anew

class FemLocalRemesh final : public BackEnd {
 public:
  FemLocalRemesh(const Scenario& scenario, const Resolution& resolution, Element element, double limit)
      : scenario_(scenario), resolution_(resolution), element_(element), limit_(limit), number_(resolution.first) {}

  std::string name() const override { return fmt::format("fem_local_remesh_{}", to_string(element_)); }
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

  Opening opening() const override { return fem_opening(nodes_, scenario_, displacement_); }
  double condition() const override {
    return solvers::condition_estimate(*near_, near_norm_, 3 * (near_count_ + between_count_));
  }

 private:
  /// Distance to the part of the front that moves.
  [[nodiscard]] double to_front(const Vector3& x) const {
    const Front front = front_of(scenario_, base_);
    if (front.closed)
      return distance_to(front.points, x);
    const std::vector<Vector2> outline = scenario_.outline(base_);
    return distance_to({scenario_.in_space(outline[1]), scenario_.in_space(outline[2])}, x);
  }

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
        const bool in_plane = std::abs(scenario_.height(first_[i])) < 1e-3 * resolution_.fine;
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
      if (is_near_[e] != 0) {
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
    increment.anew = true;
    increment.number = number_;
    base_ = number_;
    far_.reset();
    meshed_ = false;
    MeshRequest request;
    {
      const StageClock clock(increment.times, Stage::topology);
      const Front front = front_of(scenario_, number_);
      front_closed_ = front.closed;
      request = mesh_request(scenario_, number_,
                             {share * resolution_.fine, resolution_.slope,
                              share * resolution_.coarse_over_fine * resolution_.fine, front.points});
    }
    const TetMesh meshed = mesh_for(
        increment, [&] { return mesh_volume(request); }, limit_);
    if (!increment.failure.empty())
      return increment;
    try {
      CutMesh mesh;
      {
        const StageClock clock(increment.times, Stage::meshing);
        mesh = part(meshed, scenario_, number_, 1e-3 * resolution_.fine);
        share_motion(mesh);
      }
      {
        const StageClock clock(increment.times, Stage::neighbours);
        nodes_ = number_nodes(mesh, scenario_, element_);
        sort_out();
      }
      first_quality_ = increment.quality = moved_quality();
      if (far_count_ + between_count_ > 0)
        condense(increment);
      meshed_ = true;
      return solve(std::move(increment));
    } catch (const NumericalError& error) {
      increment.failure = error.what();
      return increment;
    }
  }

  /// Elements that move, and the nodes of theirs alone, of both kinds, and of the others alone.
  void sort_out() {
    const int n = nodes_.per_element();
    is_near_.assign(nodes_.elements.size(), 0);
    is_far_ = is_near_;
    std::vector<char> by_near(nodes_.positions.size(), 0), by_far = by_near;
    for (std::size_t e = 0; e < nodes_.elements.size(); ++e) {
      const auto& element = nodes_.elements[e];
      is_near_[e] = std::any_of(element.begin(), element.begin() + 4, [&](int v) { return share_[v] > 0; }) ? 1 : 0;
    }
    // Where most of the body moves, condensing the rest onto what lies between costs more than it saves.
    if (2 * std::count(is_near_.begin(), is_near_.end(), 1) > std::ssize(is_near_))
      is_near_.assign(is_near_.size(), 1);
    for (std::size_t e = 0; e < nodes_.elements.size(); ++e) {
      const auto& element = nodes_.elements[e];
      is_far_[e] = is_near_[e] == 0 ? 1 : 0;
      for (int k = 0; k < n; ++k)
        (is_near_[e] != 0 ? by_near : by_far)[element[k]] = 1;
    }
    std::vector<char> not_far(nodes_.positions.size(), 0), not_near = not_far;
    for (std::size_t i = 0; i < not_far.size(); ++i) {
      not_far[i] = by_near[i];
      not_near[i] = by_far[i];
    }
    far_place_ = elimination_places(nodes_, far_count_, not_far);
    near_place_ = elimination_places(nodes_, near_count_, not_near);
    between_count_ = 0;
    for (std::size_t i = 0; i < not_far.size(); ++i)
      if (by_near[i] != 0 && by_far[i] != 0 && nodes_.held[i] == 0) {
        far_place_[i] = far_count_ + between_count_;
        near_place_[i] = near_count_ + between_count_;
        ++between_count_;
      }
  }

  /// S = L_BB L_BB^T of the nodes between, and what the far loads are to them.
  void condense(Increment& increment) {
    FemSystem system;
    {
      const StageClock clock(increment.times, Stage::assembly);
      system = assemble(nodes_, scenario_.material, far_place_, far_count_ + between_count_, is_far_);
      const VectorX loads = face_loads(nodes_, scenario_);
      for (std::size_t i = 0; i < far_place_.size(); ++i)
        if (far_place_[i] >= 0 && far_place_[i] < far_count_)
          system.right.segment<3>(3 * static_cast<Eigen::Index>(far_place_[i])) +=
              loads.segment<3>(3 * static_cast<Eigen::Index>(i));
    }
    const StageClock clock(increment.times, Stage::factorisation);
    far_ = solvers::factor_ordered(system.lower);
    const Eigen::Index between = 3 * static_cast<Eigen::Index>(between_count_);
    root_ = far_->trailing(static_cast<int>(between));
    schur_.noalias() = root_.triangularView<Eigen::Lower>() * root_.transpose();
    halfway_ = far_->forward(system.right);
    reduced_ = root_.triangularView<Eigen::Lower>() * halfway_.bottomRows(between);
  }

  Increment solve(Increment increment) {
    increment.number = number_;
    const Eigen::Index inner = 3 * static_cast<Eigen::Index>(near_count_),
                       between = 3 * static_cast<Eigen::Index>(between_count_);
    FemSystem system;
    {
      const StageClock clock(increment.times, Stage::assembly);
      system = assemble(nodes_, scenario_.material, near_place_, near_count_ + between_count_, is_near_);
      if (system.folded > 0 && number_ != base_)
        throw NumericalError(fmt::format("{} elements fold over", system.folded));
      const VectorX loads = face_loads(nodes_, scenario_);
      for (std::size_t i = 0; i < near_place_.size(); ++i)
        if (near_place_[i] >= 0)
          system.right.segment<3>(3 * static_cast<Eigen::Index>(near_place_[i])) +=
              loads.segment<3>(3 * static_cast<Eigen::Index>(i));
      if (between > 0) {
        system.right.tail(between) += reduced_;
        add_dense(system.lower, inner, between);
      }
    }
    {
      const StageClock clock(increment.times, Stage::factorisation);
      near_ = solvers::factor_ordered(system.lower);
    }
    {
      const StageClock clock(increment.times, Stage::solve);
      recover(system.right);
    }
    increment.unknowns = 3 * (near_count_ + between_count_ + far_count_);
    near_norm_ = solvers::one_norm(system.lower, true);
    return increment;
  }

  void recover(const VectorX& right) {
    const Eigen::Index between = 3 * static_cast<Eigen::Index>(between_count_);
    const VectorX x = near_->solve(right);
    VectorX far;
    if (far_ != nullptr) {
      VectorX back = halfway_;
      back.tail(between) = root_.triangularView<Eigen::Lower>().transpose() * x.tail(between);
      far = far_->backward(back);
    }
    displacement_ = VectorX::Zero(3 * static_cast<Eigen::Index>(nodes_.positions.size()));
    for (std::size_t i = 0; i < nodes_.positions.size(); ++i) {
      const auto at = 3 * static_cast<Eigen::Index>(i);
      if (near_place_[i] >= 0)
        displacement_.segment<3>(at) = x.segment<3>(3 * static_cast<Eigen::Index>(near_place_[i]));
      else if (far_place_[i] >= 0)
        displacement_.segment<3>(at) = far.segment<3>(3 * static_cast<Eigen::Index>(far_place_[i]));
      else
        displacement_.segment<3>(at) = nodes_.prescribed[i];
    }
  }

  /// The far part's stiffness onto the nodes between, the last of the near ones.
  void add_dense(solvers::SparseMatrix& lower, Eigen::Index inner, Eigen::Index between) const {
    solvers::SparseMatrix dense(inner + between, inner + between);
    dense.resizeNonZeros(between * (between + 1) / 2);
    int* outer = dense.outerIndexPtr();
    std::fill(outer, outer + inner + 1, 0);
    Eigen::Index at = 0;
    for (Eigen::Index c = 0; c < between; ++c) {
      for (Eigen::Index r = c; r < between; ++r, ++at) {
        dense.innerIndexPtr()[at] = static_cast<int>(inner + r);
        dense.valuePtr()[at] = schur_(r, c);
      }
      outer[inner + c + 1] = static_cast<int>(at);
    }
    lower = (lower + dense).eval();
  }

  Scenario scenario_;
  Resolution resolution_;
  Element element_;
  double limit_;
  int number_, base_ = 0;
  bool front_closed_ = false, meshed_ = false;
  FemNodes nodes_;
  std::vector<Vector3> first_; // corners when the mesh was made
  std::vector<double> share_;  // of the front's motion, by corner
  std::vector<char> curved_skin_, is_near_, is_far_;
  double first_quality_ = 0;
  std::vector<int> far_place_, near_place_;
  int far_count_ = 0, near_count_ = 0, between_count_ = 0;
  std::unique_ptr<solvers::OrderedCholesky> far_, near_;
  MatrixX root_, schur_;
  VectorX halfway_, reduced_, displacement_;
  double near_norm_ = 0;
};

} // namespace

std::unique_ptr<BackEnd> make_fem_local_remesh(const Scenario& scenario, const Resolution& resolution, Element element,
                                               double limit) {
  return std::make_unique<FemLocalRemesh>(scenario, resolution, element, limit);
}

} // namespace spherecut::experiments::ledger
