// Objects that several parts of the module know.
#pragma once

#include "python/bindings/calls.hpp"
#include "solvers/contact/lip_contact.hpp"
#include "solvers/contact/solver.hpp"
#include "src/scenario/scenario.hpp"
#include "topology/blade/blade.hpp"
#include "topology/domain/domain.hpp"
#include "topology/incision/incision.hpp"

#include <mutex>

namespace spherecut::bindings {

/// A pointer as Python holds it, which knows of no const. What it points to has no functions in Python that change it.
template <class T>
std::shared_ptr<T> variable(std::shared_ptr<const T> object) {
  return std::const_pointer_cast<T>(std::move(object));
}

/// A discretised body. It is for one thread at a time: whoever uses it from Python holds its lock, which is taken after
/// the interpreter's has been let go.
struct Body {
  std::unique_ptr<solvers::Discretisation> discretisation;
  mutable std::recursive_mutex lock;
};

/// unlocked(), by one thread at a time.
template <class Call>
auto with_body(const Body& body, Call&& call) -> decltype(call(*body.discretisation)) {
  return unlocked([&] {
    const std::lock_guard guard(body.lock);
    return call(*body.discretisation);
  });
}

/// A tool; pybind11 would take the variant itself for its alternatives.
struct Tool {
  topology::ToolShape shape;
};

/// Arrays of values at points: displacement (n, 3), m; gradient, strain (n, 3, 3); stress (n, 3, 3), Pa.
struct PointValues {
  std::vector<Vector3> displacement;
  std::vector<Matrix3> gradient, strain, stress;
  void add(const solvers::PointState& state);
};
PointValues values_of(const std::vector<solvers::PointState>& states);

topology::BladePose blade_pose_from(double time, const Doubles& position, const Doubles& orientation);

/// "frictionless", "frictional" or "bonded". Throws InputError.
solvers::ContactCondition contact_condition_from(const std::string& name);

} // namespace spherecut::bindings
