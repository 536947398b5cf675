// Places of a cut body where something is asked for at every increment: contact means of nodes, values at nodes. An
// increment of the cut leaves most of them as they are, and the half solutions of the uncut body never change.
#pragma once

#include "solvers/appended/cut_system.hpp"
#include "solvers/body/surface_patches.hpp"

#include <unordered_map>

namespace spherecut::solvers {

class KeptPlaces {
 public:
  /// Points that do not count, of parts that have left the computation; empty: all count.
  using IsDropped = std::function<bool(const Vector3& x)>;

  struct Contact {
    CutFunctional mean;
    Vector3 centroid = Vector3::Zero(); // m, of the share
    std::vector<QuadraturePoint> share; // weights add up to one
    bool is_current = true;             // the cut part of the mean is
  };

  KeptPlaces(const UncutBody& uncut, const CutSpace& space, const CutSystem& system)
      : uncut_(uncut), space_(&space), system_(&system) {}
  /// What `other` knows, with copies of its space, its system and its problem.
  KeptPlaces(const KeptPlaces& other, const CutSpace& space, const CutSystem& system, const Problem& problem,
             IsDropped is_dropped)
      : KeptPlaces(other) {
    space_ = &space;
    system_ = &system;
    problem_ = &problem;
    is_dropped_ = std::move(is_dropped);
  }

  /// After the space and the system have followed the cut, which changed in `region` alone. `problem` outlives the next
  /// call. Whatever a function reaches that has come or gone is found anew, as are shares near the region.
  void follow(const Problem& problem, const BoundingBox& region, const CutSpace::Change& change, IsDropped is_dropped);

  /// The contact mean of a node; finds those of all `nodes` at once where they are not there yet.
  void require(const std::vector<int>& nodes);
  const Contact& contact(int node);
  /// The value at a node.
  const CutFunctional& at_node(int node);
  [[nodiscard]] CutFunctional mean_over(std::vector<QuadraturePoint> points) const;

  /// Half solutions of unit forces on nodes along every axis; columns as CutSystem::half_solutions gives them.
  CutVectors unit_halves(const std::vector<int>& nodes);
  /// What unit forces on the nodes do to each other.
  MatrixX compliance(const std::vector<int>& nodes);

 private:
  KeptPlaces(const KeptPlaces&) = default;

  struct Half {
    std::vector<std::pair<int, double>> of; // the base part of the mean that it belongs to
    MatrixX base;                           // three columns, in elimination order
    int version = 0;
    bool used = true; // since the last increment
  };
  void require_halves(const std::vector<int>& nodes);
  MatrixX base_halves(const std::vector<int>& nodes);
  [[nodiscard]] bool is_carried(const CutFunctional& functional) const;

  const UncutBody& uncut_;
  const CutSpace* space_;
  const CutSystem* system_;
  const Problem* problem_ = nullptr;
  IsDropped is_dropped_;
  std::unordered_map<int, Contact> contacts_;
  std::vector<std::optional<CutFunctional>> nodal_;
  std::vector<char> carried_; // base nodes with functions, before or after the last increment
  std::vector<char> carried_now_;
  std::unordered_map<int, Half> halves_;
  int version_ = 0;
  std::vector<std::pair<int, int>> gram_of_; // node and version, a block of three each
  MatrixX gram_;
  std::optional<Vector3> touched_from_;
};

} // namespace spherecut::solvers
