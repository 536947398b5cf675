#include "solvers/shapes/functions.hpp"

#include "solvers/shapes/cut_sight.hpp"
#include "solvers/shapes/derivatives.hpp"
#include "solvers/shapes/interface_ramps.hpp"
#include "solvers/shapes/kernel.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numeric>
#include <optional>

namespace spherecut::solvers {

using shape_kernel::evaluate_support;
using shape_kernel::Kernel;
using shape_kernel::Support;

namespace {

constexpr double radius_growth = 1.25;
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

// Adds sphere j to a support when it holds the point; d = x_j - x.
void append(Support& support, int j, const Vector3& d, double radius) {
  if (!(d.squaredNorm() < radius * radius))
    return;
  const int n = support.count++;
  support.ids[n] = j;
  support.dx[n] = d.x();
  support.dy[n] = d.y();
  support.dz[n] = d.z();
  support.q[n] = 1 / (radius * radius);
}

// Completes the last register of a support with entries that weigh nothing.
void pad(Support& support) {
  for (int k = support.count; k < support.count + SphereGrid::lanes; ++k) {
    support.dx[k] = support.q[k] = 1;
    support.dy[k] = support.dz[k] = 0;
  }
}

// Arrays of n entries; none for the second derivatives unless wanted.
void resize(ShapeFunctions& out, int n, bool second) {
  for (std::vector<double>* array : {&out.value, &out.dx, &out.dy, &out.dz})
    array->resize(n);
  if (second || !out.dxx.empty())
    for (std::vector<double>* array : {&out.dxx, &out.dyy, &out.dzz, &out.dxy, &out.dxz, &out.dyz})
      array->resize(second ? n : 0);
}

// The nodes whose spheres, grown by `factor`, hold x. Rare: every sphere is looked at.
void collect_grown(const Spheres& spheres, const Vector3& x, double factor, Support& support) {
  support.count = 0;
  for (int j = 0; j < spheres.size(); ++j)
    append(support, j, spheres.centres()[j] - x, factor * spheres.radii()[j]);
  pad(support);
}

bool nothing(ShapeFunctions& out) {
  out.nodes.clear();
  resize(out, 0, false);
  return false;
}

// Tries the support of x with all radii grown step by step.
bool evaluate_grown(const Kernel& kernel, const Spheres& spheres, const Vector3& x, bool second, ShapeFunctions& out) {
  SupportMemory memory(spheres.size());
  double factor = 1;
  for (int step = 0; step < growth_steps_at_point; ++step) {
    collect_grown(spheres, x, factor *= radius_growth, memory.support);
    if (evaluate_support(kernel, memory.support, spheres.basis(), second, spheres.worst_condition(), out))
      return true;
  }
  return nothing(out);
}

// The same near the cut, first with the enriched basis where it is due, then without.
bool evaluate_grown_near_cut(const Kernel& kernel, const Spheres& spheres, const Vector3& x, bool second,
                             ShapeFunctions& out) {
  SupportMemory memory(spheres.size());
  for (const CutSight::Enrich enrich : {CutSight::Enrich::where_near, CutSight::Enrich::never}) {
    double factor = enrich == CutSight::Enrich::never ? 1 / radius_growth : 1;
    const int steps = enrich == CutSight::Enrich::never ? growth_steps_at_point + 1 : growth_steps_at_point;
    for (int step = 0; step < steps; ++step) {
      collect_grown(spheres, x, factor *= radius_growth, memory.support);
      if (spheres.cut()->evaluate(kernel, x, memory.support, true, second, 0, spheres.worst_condition(), enrich, out))
        return true;
    }
  }
  return nothing(out);
}

bool evaluate_near_cut(const Kernel& kernel, const Spheres& spheres, const Vector3& point, bool second,
                       ShapeFunctions& out) {
  const CutSight& cut = *spheres.cut();
  if (second && cut.sight().rule != SightRule::visibility)
    throw InputError(fmt::format("second derivatives near a cut: the rule '{}' has none, take 'visibility'",
                                 to_string(cut.sight().rule)));
  const Vector3 x = cut.off_the_sheet(point);
  const SphereGrid::Cell cell = spheres.grid().find(x);
  SupportMemory memory(cell.padded);
  kernel.collect(cell, x.data(), memory.support);
  return cut.evaluate(kernel, x, memory.support, false, second, 0, spheres.worst_condition(),
                      CutSight::Enrich::where_near, out) ||
         evaluate_grown_near_cut(kernel, spheres, x, second, out);
}

/// Beside a face between materials, first with ramps, then without. Empty: no node lies across a face.
std::optional<bool> evaluate_with_ramps(const Spheres& spheres, const Vector3& x, const Support& support, bool second,
                                        ShapeFunctions& out) {
  const InterfaceRamps& ramps = *spheres.ramps();
  if (second)
    throw InputError("second derivatives beside a face between materials: there are none; take a method without them "
                     "(galerkin)");
  InterfaceRamps::Outcome outcome = ramps.evaluate(x, support, spheres.worst_condition(), out);
  if (outcome == InterfaceRamps::Outcome::plain)
    return std::nullopt;
  double factor = 1;
  for (int step = 0; step < growth_steps_at_point && outcome != InterfaceRamps::Outcome::sound; ++step) {
    SupportMemory memory(spheres.size());
    collect_grown(spheres, x, factor *= radius_growth, memory.support);
    outcome = ramps.evaluate(x, memory.support, spheres.worst_condition(), out);
  }
  if (outcome == InterfaceRamps::Outcome::sound)
    return true;
  return std::nullopt;
}

bool evaluate_point(const Kernel& kernel, const Spheres& spheres, const Vector3& x, bool second, ShapeFunctions& out) {
  const SphereGrid::Cell cell = spheres.grid().find(x);
  SupportMemory memory(cell.padded);
  kernel.collect(cell, x.data(), memory.support);
  if (spheres.cut() != nullptr && spheres.cut()->concerns(memory.support))
    return evaluate_near_cut(kernel, spheres, x, second, out);
  if (spheres.ramps() != nullptr && spheres.ramps()->concerns(memory.support))
    if (const std::optional<bool> sound = evaluate_with_ramps(spheres, x, memory.support, second, out))
      return *sound;
  return evaluate_support(kernel, memory.support, spheres.basis(), second, spheres.worst_condition(), out) ||
         (spheres.cut() == nullptr ? evaluate_grown(kernel, spheres, x, second, out)
                                   : evaluate_grown_near_cut(kernel, spheres, x, second, out));
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

bool shape_kernel::evaluate_support(const Kernel& kernel, const Support& support, Basis basis, bool second,
                                    double worst_condition, ShapeFunctions& out) {
  const int n = support.count;
  if (n < basis_size(basis))
    return false;
  if (basis == Basis::linear) {
    const int padded = (n + SphereGrid::lanes - 1) / SphereGrid::lanes * SphereGrid::lanes;
    resize(out, padded, second);
    shape_kernel::LinearOutput output{out.value.data(), out.dx.data(), out.dy.data(), out.dz.data(), {}};
    if (second) {
      output.second = {out.dxx.data(), out.dyy.data(), out.dzz.data(), out.dxy.data(), out.dxz.data(), out.dyz.data()};
      out.moment_condition = kernel.evaluate_linear_second(support, output);
    } else {
      out.moment_condition = kernel.evaluate_linear(support, output);
    }
    resize(out, n, second);
  } else {
    resize(out, n, second);
    evaluate_quadratic(support, second, out);
  }
  if (!(out.moment_condition <= worst_condition))
    return false;
  out.nodes.assign(support.ids, support.ids + n);
  return true;
}

double quartic_spline(double s) {
  if (s >= 1)
    return 0;
  const double t = 1 - s;
  return t * t * t * (1 + 3 * s);
}

/// A node whose support is not sound asks for one more step of growth of every sphere that would then hold it; the
/// steps are counted per sphere so that the outcome does not depend on the order of the nodes.
struct Spheres::Growing {
  Spheres& spheres;
  const std::vector<double>& base; // m, radii that have not grown
  // Near a front the nodes may be too few for the enriched basis: a support that stays so is left to the linear one.
  int enriched_growth;
  std::vector<int> wanted = std::vector<int>(base.size(), 0), level = wanted; // steps
  int round = 0;
  ShapeFunctions shape{};

  [[nodiscard]] bool is_sound(int i, Support& support, bool grown) {
    const Kernel& kernel = shape_kernel::dispatched();
    if (spheres.cut_ != nullptr && (grown || spheres.cut_->concerns(support)))
      return spheres.cut_->evaluate(
          kernel, spheres.centres_[i], support, grown, false, 2, spheres.worst_condition_,
          wanted[i] < enriched_growth ? CutSight::Enrich::where_near : CutSight::Enrich::never, shape);
    return support.count >= basis_size(spheres.basis_) + 2 &&
           evaluate_support(kernel, support, spheres.basis_, false, spheres.worst_condition_, shape);
  }

  std::vector<int> unsound_nodes() {
    std::vector<int> unsound;
    for (int i = 0; i < spheres.size(); ++i) {
      const Vector3& x = spheres.centres_[i];
      const SphereGrid::Cell cell = spheres.grid_->find(x);
      SupportMemory memory(cell.padded);
      shape_kernel::dispatched().collect(cell, x.data(), memory.support);
      if (!is_sound(i, memory.support, false))
        unsound.push_back(i);
    }
    return unsound;
  }

  /// One more step for the nodes in question alone. Those that are not sound still.
  std::vector<int> grow(const std::vector<int>& unsound) {
    const std::vector<Vector3>& centres = spheres.centres_;
    const std::size_t n = centres.size();
    const double furthest = std::pow(radius_growth, ++round);
    std::vector<double> widest(n);
    for (std::size_t j = 0; j < n; ++j)
      widest[j] = furthest * base[j];
    // For a few of them every sphere is looked at.
    const bool are_many = unsound.size() > 100;
    const SphereGrid reach = are_many ? SphereGrid(centres, widest) : SphereGrid();
    std::vector<int> everyone(are_many ? 0 : n);
    std::iota(everyone.begin(), everyone.end(), 0);
    const auto near = [&](int i) -> std::span<const int> {
      return are_many ? reach.find(centres[i]).ids : std::span<const int>(everyone);
    };
    for (int i : unsound) {
      if (++wanted[i] > growth_steps_at_node)
        throw NumericalError(fmt::format(
            "shape functions: the support of node {} at ({:.6g}, {:.6g}, {:.6g}) m is not sound after {} steps of "
            "growth by {} from a radius of {:.6g} m ({} such nodes); the nodes around it are too few or in a plane",
            i, centres[i].x(), centres[i].y(), centres[i].z(), growth_steps_at_node, radius_growth, base[i],
            unsound.size()));
      const double factor = std::pow(radius_growth, wanted[i]);
      for (int j : near(i))
        if ((centres[j] - centres[i]).norm() < factor * base[j])
          level[j] = std::max(level[j], wanted[i]);
    }
    for (std::size_t j = 0; j < n; ++j)
      spheres.radii_[j] = base[j] * std::pow(radius_growth, level[j]);
    std::vector<int> still;
    for (int i : unsound) {
      const std::span<const int> candidates = near(i);
      SupportMemory memory(static_cast<int>(candidates.size()));
      for (int j : candidates)
        append(memory.support, j, centres[j] - centres[i], spheres.radii_[j]);
      pad(memory.support);
      if (!is_sound(i, memory.support, true))
        still.push_back(i);
    }
    return still;
  }
};

Spheres::Spheres(std::vector<Vector3> centres, const std::vector<double>& spacings, double rho, Basis basis,
                 double worst_condition, const Sight& sight)
    : centres_(std::move(centres)), basis_(basis), worst_condition_(worst_condition) {
  check(centres_, spacings, rho, basis, worst_condition);
  const int n = size();
  std::vector<double> base(n);
  for (int i = 0; i < n; ++i)
    base[i] = rho * spacings[i];
  if (sight.incision != nullptr && sight.radius_factor != 1)
    for (int i = 0; i < n; ++i)
      if (sight.incision->front_frame(centres_[i], sight.reach * spacings[i]))
        base[i] *= sight.radius_factor;
  radii_ = base;
  grid_ = std::make_shared<const SphereGrid>(centres_, radii_);
  if (sight.incision != nullptr) {
    if (basis != Basis::linear)
      throw InputError("shape functions: spheres around a cut have the linear basis alone");
    if (!(sight.radius_factor > 0) || !std::isfinite(sight.radius_factor))
      throw InputError(fmt::format("shape functions: radii at the front times {}; the factor must be positive",
                                   sight.radius_factor));
    cut_ = std::make_shared<CutSight>(sight, centres_, spacings, radii_);
  }

  Growing growing{*this, base, sight.enriched_growth};
  for (std::vector<int> unsound = growing.unsound_nodes(); !unsound.empty(); unsound = growing.unsound_nodes()) {
    while (!unsound.empty())
      unsound = growing.grow(unsound);
    grid_ = std::make_shared<const SphereGrid>(centres_, radii_);
    if (cut_ != nullptr)
      cut_->update_radii(centres_, radii_);
  }
  if (sight.regions != nullptr) {
    if (basis != Basis::linear || sight.incision != nullptr)
      throw InputError("shape functions: ramps beside faces between materials go with the linear basis and no cut");
    ramps_ = std::make_shared<const InterfaceRamps>(sight.regions, centres_, radii_);
  }
  grown_ = static_cast<int>(std::count_if(growing.level.begin(), growing.level.end(), [](int l) { return l > 0; }));
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
