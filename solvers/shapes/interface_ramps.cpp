#include "solvers/shapes/interface_ramps.hpp"

#include "topology/base/errors.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {

namespace {

constexpr int linear_size = 4;
constexpr int largest_size = linear_size + InterfaceRamps::most_ramps;
constexpr double least_pivot = 1e-11;  // of a unit diagonal: what is left of a ramp that says nothing new
constexpr double widest_ramp_sum = 20; // largest sum of |h_j|: beyond, the basis extrapolates

using RampMoments = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, largest_size, largest_size>;
using RampCoefficients = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, largest_size, 1>;

using RampTurning = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::ColMajor, 3, InterfaceRamps::most_ramps>;

/// Basis, weights and weight gradients of the nodes of a support; memory of a thread.
struct RampMembers {
  std::vector<RampCoefficients> basis;
  std::vector<double> weight;
  std::vector<Vector3> slope;       // of the weight, 1/m
  std::vector<RampTurning> turning; // gradients of the ramps as their planes turn, 1/m
  void resize(int count) {
    turning.resize(count);
    basis.resize(count);
    weight.resize(count);
    slope.resize(count);
  }
};

RampMembers& ramp_members_of_this_thread() {
  thread_local RampMembers members;
  return members;
}

/// Columns of the basis that are left after those that depend on the ones before, by a Cholesky factorisation with a
/// unit diagonal; the linear ones stay.
std::vector<int> independent_columns(const RampMoments& scaled) {
  const auto n = scaled.rows();
  RampMoments lower = RampMoments::Zero(n, n);
  std::vector<int> kept;
  for (int j = 0; j < n; ++j) {
    double pivot = scaled(j, j);
    for (const int k : kept)
      pivot -= lower(j, k) * lower(j, k);
    if (j >= linear_size && !(pivot > least_pivot))
      continue;
    const double root = std::sqrt(std::max(pivot, 1e-300));
    lower(j, j) = root;
    for (int i = j + 1; i < n; ++i) {
      double entry = scaled(i, j);
      for (const int k : kept)
        entry -= lower(i, k) * lower(j, k);
      lower(i, j) = entry / root;
    }
    kept.push_back(j);
  }
  return kept;
}

/// Shape functions of the least squares fit with these moments: h_j = w_j P_j . M^-1 e_0, and their gradients. False
/// where the moments are worse conditioned than allowed or the fit extrapolates.
bool fit_with_ramps(const RampMoments& moments, double scale, double worst_condition, RampMembers& members,
                    ShapeFunctions& out) {
  const auto size = moments.rows();
  RampCoefficients unit(size); // scales the diagonal to one
  for (Eigen::Index j = 0; j < size; ++j)
    unit[j] = moments(j, j) > 0 ? 1 / std::sqrt(moments(j, j)) : 0;
  const RampMoments scaled = unit.asDiagonal() * moments * unit.asDiagonal();
  const std::vector<int> kept = independent_columns(scaled);
  const auto left = std::ssize(kept);
  RampMoments least(left, left);
  for (Eigen::Index j = 0; j < left; ++j)
    for (Eigen::Index i = 0; i < left; ++i)
      least(i, j) = scaled(kept[i], kept[j]);
  const RampMoments inverse = least.inverse();
  out.moment_condition = least.cwiseAbs().colwise().sum().maxCoeff() * inverse.cwiseAbs().colwise().sum().maxCoeff();
  if (!(out.moment_condition <= worst_condition))
    return false;

  const RampCoefficients value = unit[0] * inverse.col(0);
  std::array<RampCoefficients, 3> slope;
  for (int axis = 0; axis < 3; ++axis)
    slope[axis] = scale * unit[1 + axis] * RampCoefficients::Unit(left, 1 + axis);
  const std::size_t n = members.basis.size();
  for (std::size_t k = 0; k < n; ++k) {
    RampCoefficients of(left);
    RampTurning turning = RampTurning::Zero(3, left - linear_size);
    for (Eigen::Index j = 0; j < left; ++j) {
      of[j] = unit[kept[j]] * members.basis[k][kept[j]];
      if (j >= linear_size)
        turning.col(j - linear_size) = unit[kept[j]] * members.turning[k].col(kept[j] - linear_size);
    }
    members.basis[k] = of;
    members.turning[k] = turning;
    const double fitted = of.dot(value);
    for (int axis = 0; axis < 3; ++axis) {
      const double turned = turning.row(axis).dot(value.tail(left - linear_size));
      slope[axis] -= (members.slope[k][axis] * fitted + members.weight[k] * turned) * of;
      slope[axis].tail(left - linear_size) -= members.weight[k] * fitted * turning.row(axis).transpose();
    }
  }
  for (RampCoefficients& along : slope)
    along = RampCoefficients(inverse * along);
  for (std::vector<double>* array : {&out.value, &out.dx, &out.dy, &out.dz})
    array->resize(n);
  double sum = 0;
  for (std::size_t k = 0; k < n; ++k) {
    const double fitted = members.basis[k].dot(value);
    out.value[k] = members.weight[k] * fitted;
    sum += std::abs(out.value[k]);
    const auto gradient = [&](int axis) {
      return members.weight[k] * (members.basis[k].dot(slope[axis]) +
                                  members.turning[k].row(axis).dot(value.tail(left - linear_size))) +
             members.slope[k][axis] * fitted;
    };
    out.dx[k] = gradient(0);
    out.dy[k] = gradient(1);
    out.dz[k] = gradient(2);
  }
  return sum <= widest_ramp_sum;
}

} // namespace

InterfaceRamps::InterfaceRamps(std::shared_ptr<const MaterialRegions> regions, const std::vector<Vector3>& centres,
                               const std::vector<double>& radii)
    : regions_(std::move(regions)), concern_(centres.size(), 0) {
  // A tangent plane separates a point from a node in whose sphere it lies only if it is no farther than the radius.
  for (std::size_t j = 0; j < centres.size(); ++j)
    for (const RegionFace& face : regions_->faces())
      if (std::abs(face.distance(centres[j])) < 2 * radii[j])
        concern_[j] = 1;
}

/// The faces whose tangent planes lie between x and nodes of the support.
InterfaceRamps::Crossed InterfaceRamps::faces_crossed(const Vector3& x, const shape_kernel::Support& support) const {
  Crossed crossed;
  double smallest = support.count > 0 ? support.q[0] : 0;
  for (int k = 1; k < support.count; ++k)
    smallest = std::min(smallest, support.q[k]);
  for (const RegionFace& face : regions_->faces()) {
    const double distance = face.distance(x);
    if (distance * distance * smallest >= 1)
      continue;
    TangentPlane plane{distance, face.normal(x), Matrix3::Zero()};
    bool divides = false;
    for (int k = 0; k < support.count && !divides; ++k)
      divides = plane.is_beyond({support.dx[k], support.dy[k], support.dz[k]});
    if (!divides)
      continue;
    if (crossed.count == most_ramps)
      throw InputError(fmt::format("more than {} faces between materials divide the spheres about ({:.6g}, {:.6g}, "
                                   "{:.6g}) m, which reach {:.3g} m; allowed: {}. Finer nodes or fewer regions do",
                                   most_ramps, x.x(), x.y(), x.z(), 1 / std::sqrt(smallest), most_ramps));
    if (face.turning)
      plane.turning = face.turning(x);
    crossed.planes[crossed.count++] = plane;
  }
  return crossed;
}

InterfaceRamps::Outcome InterfaceRamps::evaluate(const Vector3& x, const shape_kernel::Support& support,
                                                 double worst_condition, ShapeFunctions& out) const {
  const Crossed crossed = faces_crossed(x, support);
  if (crossed.count == 0)
    return Outcome::plain;
  const int n = support.count, size = linear_size + crossed.count;
  if (n < linear_size + 1)
    return Outcome::unsound;
  RampMembers& members = ramp_members_of_this_thread();
  members.resize(n);
  const double scale = std::sqrt(support.q[0]); // 1/m
  RampMoments moments = RampMoments::Zero(size, size);
  for (int k = 0; k < n; ++k) {
    const Vector3 d(support.dx[k], support.dy[k], support.dz[k]);
    const double q = support.q[k], s = std::sqrt(q) * d.norm(), t = std::max(1 - s, 0.0);
    RampCoefficients& p = members.basis[k];
    p.resize(size);
    p[0] = 1;
    p.segment<3>(1) = scale * d;
    members.turning[k] = RampTurning::Zero(3, crossed.count);
    for (int r = 0; r < crossed.count; ++r) {
      const TangentPlane& plane = crossed.planes[r];
      p[linear_size + r] = 0;
      if (!plane.is_beyond(d))
        continue;
      const double side = plane.distance < 0 ? 1 : -1;
      p[linear_size + r] = scale * side * plane.of(d);
      members.turning[k].col(r) = scale * side * plane.turning.transpose() * d;
    }
    members.weight[k] = t * t * t * (1 + 3 * s);
    members.slope[k] = 12 * t * t * q * d;
    moments += members.weight[k] * p * p.transpose();
  }
  if (!fit_with_ramps(moments, scale, worst_condition, members, out))
    return Outcome::unsound;
  out.nodes.assign(support.ids, support.ids + n);
  return Outcome::sound;
}

} // namespace spherecut::solvers
