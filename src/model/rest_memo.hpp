// Places of the tissue, carried back to where they were at rest, kept for one state of a body.
#pragma once
#include "solvers/body/discretisation.hpp"
#include "topology/incision/incision.hpp"

#include <array>
#include <memory>
#include <string>
#include <unordered_map>

namespace spherecut::app {

/// Places carried back to rest in one state of a body, so that each is looked for once: a blade asks for the same ones
/// again and again within a step. Not for several threads at once.
class RestMemo {
 public:
  struct Found {
    Vector3 rest = Vector3::Zero(); // m
    std::string error{};            // not empty: none was found, and why
  };

  /// Forgets everything unless it is of this body, cut and field, and of this spacing, m, of which tolerances are
  /// parts; `is_solved`: whether the field counts.
  void turn_to(const solvers::Discretisation* body, const std::shared_ptr<const topology::Incision>& incision,
               bool is_solved, const solvers::Field& field, double spacing);
  /// What was kept for the place that is now at x, m; null: nothing.
  [[nodiscard]] const Found* find(const Vector3& x) const;
  const Found& keep(const Vector3& x, Found found);

 private:
  using Key = std::array<double, 3>;
  struct Hash {
    std::size_t operator()(const Key& key) const;
  };
  const solvers::Discretisation* body_ = nullptr;
  std::shared_ptr<const topology::Incision> incision_;
  bool is_solved_ = false;
  double spacing_ = 0;
  solvers::Field field_;
  std::unordered_map<Key, Found, Hash> found_;
};

} // namespace spherecut::app
