#include "solvers/shape_functions.hpp"

#include "solvers/shape_derivatives.hpp"
#include "solvers/shape_kernel.hpp"
#include "topology/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {

using shape_kernel::Kernel;
using shape_kernel::Support;

namespace {

constexpr double growth = 1.25;
constexpr int growth_steps_at_node = 6;
constexpr int growth_steps_at_point = 4;

// Memory of one support: on the stack unless it is unusually large.
class SupportMemory {
 public:
  explicit SupportMemory(int candidates) {
    // `collect` may write one register beyond the last candidate.
    const std::size_t room = static_cast<std::size_t>(candidates) + 2 * SphereGrid::lanes;
    double* coordinates = local_.data();
    int* ids = local_ids_.data();
    std::size_t stride = local_room;
    if (room > local_room) {
      stride = room;
      large_.resize(4 * stride);
      large_ids_.resize(stride);
      coordinates = large_.data();
      ids = large_ids_.data();
    }
    support = {0, ids, coordinates, coordinates + stride, coordinates + 2 * stride, coordinates + 3 * stride};
  }
  SupportMemory(const SupportMemory&) = delete;
  SupportMemory& operator=(const SupportMemory&) = delete;

  Support support{};

 private:
  static constexpr std::size_t local_room = 256;
  alignas(64) std::array<double, 4 * local_room> local_;
  std::array<int, local_room> local_ids_;
  std::vector<double> large_;
  std::vector<int> large_ids_;
};

void clear(ShapeFunctions& out) {
  out.nodes.clear();
  for (std::vector<double>* array :
       {&out.value, &out.dx, &out.dy, &out.dz, &out.dxx, &out.dyy, &out.dzz, &out.dxy, &out.dxz, &out.dyz})
    array->clear();
}

// Shape functions on a given support, in place of what `out` held. False when the support is not sound.
bool evaluate_support(const Kernel& kernel, const Support& support, Basis basis, bool second, double worst_condition,
                      ShapeFunctions& out) {
  const int n = support.count;
  if (n < basis_size(basis))
    return false;
  if (basis == Basis::linear && !second) {
    const std::size_t padded =
        static_cast<std::size_t>(n + SphereGrid::lanes - 1) / SphereGrid::lanes * SphereGrid::lanes;
    for (std::vector<double>* array : {&out.value, &out.dx, &out.dy, &out.dz})
      array->resize(padded);
    out.moment_condition =
        kernel.evaluate_linear(support, {out.value.data(), out.dx.data(), out.dy.data(), out.dz.data()});
    for (std::vector<double>* array : {&out.value, &out.dx, &out.dy, &out.dz})
      array->resize(n);
    for (std::vector<double>* array : {&out.dxx, &out.dyy, &out.dzz, &out.dxy, &out.dxz, &out.dyz})
      array->clear();
  } else {
    evaluate_general(support, basis, second, out);
  }
  if (!(out.moment_condition <= worst_condition))
    return false;
  out.nodes.assign(support.ids, support.ids + n);
  return true;
}

// Tries the support of x with all radii grown step by step. Rare: every sphere is looked at.
bool evaluate_grown(const Kernel& kernel, const Spheres& spheres, const Vector3& x, bool second, ShapeFunctions& out) {
  SupportMemory memory(spheres.size());
  Support& support = memory.support;
  double factor = 1;
  for (int step = 0; step < growth_steps_at_point; ++step) {
    factor *= growth;
    int n = 0;
    for (int j = 0; j < spheres.size(); ++j) {
      const Vector3 d = spheres.centres()[j] - x;
      const double radius = factor * spheres.radii()[j];
      if (d.squaredNorm() < radius * radius) {
        support.ids[n] = j;
        support.dx[n] = d.x();
        support.dy[n] = d.y();
        support.dz[n] = d.z();
        support.q[n++] = 1 / (radius * radius);
      }
    }
    support.count = n;
    for (int k = n; k < n + SphereGrid::lanes; ++k) {
      support.dx[k] = support.q[k] = 1;
      support.dy[k] = support.dz[k] = 0;
    }
    if (evaluate_support(kernel, support, spheres.basis(), second, spheres.worst_condition(), out))
      return true;
  }
  clear(out);
  return false;
}

bool evaluate_point(const Kernel& kernel, const Spheres& spheres, const Vector3& x, bool second, ShapeFunctions& out) {
  const SphereGrid::Cell cell = spheres.grid().find(x);
  SupportMemory memory(cell.padded);
  kernel.collect(cell, x.data(), memory.support);
  return evaluate_support(kernel, memory.support, spheres.basis(), second, spheres.worst_condition(), out) ||
         evaluate_grown(kernel, spheres, x, second, out);
}

void check(const std::vector<Vector3>& centres, const std::vector<double>& spacings, double rho, Basis basis,
           double worst_condition) {
  const int needed = basis_size(basis) + 2;
  if (std::ssize(centres) < needed)
    throw InputError(fmt::format("shape functions: {} nodes; this basis needs at least {}", centres.size(), needed));
  if (spacings.size() != centres.size())
    throw InputError(fmt::format("shape functions: {} nodes but {} spacings", centres.size(), spacings.size()));
  if (!(rho > 0) || !std::isfinite(rho))
    throw InputError(fmt::format("shape functions: support radius of {} spacings; it must be positive", rho));
  if (!(worst_condition > 1))
    throw InputError(fmt::format("shape functions: worst condition {}; it must exceed 1", worst_condition));
  for (int i = 0; i < std::ssize(centres); ++i) {
    if (!centres[i].allFinite())
      throw InputError(fmt::format("shape functions: node {} at ({}, {}, {}) is not finite", i, centres[i].x(),
                                   centres[i].y(), centres[i].z()));
    if (!(spacings[i] > 0) || !std::isfinite(spacings[i]))
      throw InputError(fmt::format("shape functions: node {} has spacing {} m; it must be positive", i, spacings[i]));
  }
}

} // namespace

double quartic_spline(double s) {
  if (s >= 1)
    return 0;
  const double t = 1 - s;
  return t * t * t * (1 + 3 * s);
}

Spheres::Spheres(std::vector<Vector3> centres, const std::vector<double>& spacings, double rho, Basis basis,
                 double worst_condition)
    : centres_(std::move(centres)), basis_(basis), worst_condition_(worst_condition) {
  check(centres_, spacings, rho, basis, worst_condition);
  const int n = size(), needed = basis_size(basis) + 2;
  std::vector<double> base(n);
  for (int i = 0; i < n; ++i)
    base[i] = rho * spacings[i];
  radii_ = base;
  grid_ = SphereGrid(centres_, radii_);

  // A node whose support is not sound asks for one more step of growth of every sphere that would then hold it; the
  // steps are counted per sphere so that the outcome does not depend on the order of the nodes.
  std::vector<int> wanted(n, 0), level(n, 0);
  std::vector<int> suspects(n);
  for (int i = 0; i < n; ++i)
    suspects[i] = i;
  const Kernel& kernel = shape_kernel::dispatched();
  ShapeFunctions shape;
  for (int step = 1;; ++step) {
    std::vector<int> unsound;
    for (int i : suspects) {
      const SphereGrid::Cell cell = grid_.find(centres_[i]);
      SupportMemory memory(cell.padded);
      kernel.collect(cell, centres_[i].data(), memory.support);
      if (memory.support.count < needed ||
          !evaluate_support(kernel, memory.support, basis, false, worst_condition, shape))
        unsound.push_back(i);
    }
    if (unsound.empty())
      break;
    if (step > growth_steps_at_node) {
      const int i = unsound.front();
      throw NumericalError(fmt::format(
          "shape functions: the support of node {} at ({:.6g}, {:.6g}, {:.6g}) m is not sound after {} steps of growth "
          "by {} from a radius of {:.6g} m ({} such nodes); the nodes around it are too few or lie in a plane",
          i, centres_[i].x(), centres_[i].y(), centres_[i].z(), growth_steps_at_node, growth, base[i], unsound.size()));
    }
    std::vector<double> widest(n);
    for (int j = 0; j < n; ++j)
      widest[j] = base[j] * std::pow(growth, step);
    const SphereGrid reach(centres_, widest);
    for (int i : unsound) {
      const double factor = std::pow(growth, ++wanted[i]);
      for (int j : reach.find(centres_[i]).ids)
        if ((centres_[j] - centres_[i]).norm() < factor * base[j])
          level[j] = std::max(level[j], wanted[i]);
    }
    for (int j = 0; j < n; ++j)
      radii_[j] = base[j] * std::pow(growth, level[j]);
    grid_ = SphereGrid(centres_, radii_);
  }
  grown_ = static_cast<int>(std::count_if(level.begin(), level.end(), [](int l) { return l > 0; }));
}

bool evaluate(const Spheres& spheres, const Vector3& x, ShapeFunctions& out) {
  return evaluate_point(shape_kernel::dispatched(), spheres, x, false, out);
}

bool evaluate(const Spheres& spheres, std::span<const Vector3> points, std::span<ShapeFunctions> out) {
  if (points.size() != out.size())
    throw InputError(fmt::format("shape functions: {} points but room for {}", points.size(), out.size()));
  const Kernel& kernel = shape_kernel::dispatched();
  bool sound = true;
  for (std::size_t i = 0; i < points.size(); ++i)
    sound = evaluate_point(kernel, spheres, points[i], false, out[i]) && sound;
  return sound;
}

bool evaluate_second(const Spheres& spheres, const Vector3& x, ShapeFunctions& out) {
  return evaluate_point(shape_kernel::dispatched(), spheres, x, true, out);
}

bool shape_kernel::evaluate_with(const Kernel& kernel, const Spheres& spheres, const Vector3& x, ShapeFunctions& out) {
  return evaluate_point(kernel, spheres, x, false, out);
}

} // namespace spherecut::solvers
