#include "solvers/appended/small_boxes.hpp"

#include "solvers/algebra/parallel.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace spherecut::solvers {

namespace {

constexpr double least_part = 1e-3; // of a small box: less of it inside the body counts for nothing
constexpr int most_bins_along = 96;

Vector3 octant_of(const Vector3& centre, const Vector3& half, int octant) {
  return centre + 0.5 * half.cwiseProduct(Vector3(octant & 1 ? 1 : -1, octant & 2 ? 1 : -1, octant & 4 ? 1 : -1));
}

bool is_inside(const topology::Domain& domain, const Vector3& centre, const Vector3& half) {
  if (domain.signed_distance(centre) < -half.norm())
    return true;
  for (int k = 0; k < 8; ++k)
    if (domain.signed_distance(octant_of(centre, 2 * half, k)) > 1e-9 * half.norm())
      return false;
  return true;
}

} // namespace

std::pair<double, Vector3> part_inside(const topology::Domain& domain, const Vector3& centre, const Vector3& half) {
  const double distance = domain.signed_distance(centre);
  if (std::abs(distance) >= half.norm())
    return {distance < 0 ? 1 : 0, Vector3::Zero()};
  const Vector3 n = domain.normal(centre);
  const double reach = n.cwiseAbs().dot(half), fraction = std::clamp(0.5 - 0.5 * distance / reach, 0.0, 1.0);
  return {fraction, -(1 - fraction) * reach * n};
}

SmallBoxes::SmallBoxes(const topology::Domain& domain, const NodeCloud& nodes, const Spheres& spheres, double cell_size)
    : spheres_(spheres), reach_(static_cast<std::size_t>(spheres.size())) {
  const BackgroundCells leaves = background_cells(domain, nodes, {cell_size, 1, false, 1});
  cells_.reserve(leaves.boxes.size());
  for (const BackgroundBox& leaf : leaves.boxes)
    add_cell(domain, leaf);
  if (boxes_.empty())
    throw NumericalError("no background box lies inside the body");
  evaluate_all();
  sort_into_bins(domain.bounds());
  find_neighbours();
  node_cell_start_.assign(spheres.size() + 1, 0);
  for (const BoxShapes& cell : cells_)
    for (const int node : cell.nodes)
      ++node_cell_start_[node + 1];
  for (int i = 0; i < spheres.size(); ++i)
    node_cell_start_[i + 1] += node_cell_start_[i];
  node_cells_.resize(node_cell_start_.back());
  std::vector<int> next(node_cell_start_.begin(), node_cell_start_.end() - 1);
  for (int c = 0; c < std::ssize(cells_); ++c)
    for (const int node : cells_[c].nodes)
      node_cells_[next[node]++] = c;
}

void reproduce_linear(const Spheres& spheres, const Vector3& x, ShapeFunctions& shape) {
  using Moments = Eigen::Matrix<double, 4, 1>;
  const double radius = spheres.radii()[shape.nodes.front()];
  const auto moments_of = [&](int n) {
    Moments p;
    p << 1, (spheres.centres()[shape.nodes[n]] - x) / radius;
    return p;
  };
  Eigen::Matrix4d gram = Eigen::Matrix4d::Zero();
  Moments missing = Moments::Unit(0);
  Eigen::Matrix<double, 3, 4> missing_slope;
  missing_slope << Vector3::Zero(), Matrix3::Identity() / radius;
  for (int n = 0; n < shape.size(); ++n) {
    const Moments p = moments_of(n);
    gram += shape.value[n] * p * p.transpose();
    missing -= shape.value[n] * p;
    missing_slope -= shape.gradient(n) * p.transpose();
  }
  const Eigen::FullPivLU<Eigen::Matrix4d> lu(gram);
  if (!lu.isInvertible())
    return;
  const Moments add = lu.solve(missing);
  const Eigen::Matrix<double, 3, 4> add_slope = lu.solve(missing_slope.transpose()).transpose();
  for (int n = 0; n < shape.size(); ++n) {
    const Moments p = moments_of(n);
    const Vector3 gradient = shape.gradient(n) + shape.value[n] * (add_slope * p);
    shape.value[n] *= 1 + add.dot(p);
    shape.dx[n] = gradient.x();
    shape.dy[n] = gradient.y();
    shape.dz[n] = gradient.z();
  }
}

void SmallBoxes::evaluate(int box, const Vector3& x, ShapeFunctions& shape) const {
  if (!solvers::evaluate(spheres_, x, shape))
    throw NumericalError(
        fmt::format("no sound support covers the point ({:.6g}, {:.6g}, {:.6g}) m", x.x(), x.y(), x.z()));
  const BoxShapes& cell = cells_[cell_of_[box]];
  const int lane = lane_of(box);
  take_out(spheres_, x, shape, [&](int k) {
    const auto at = std::lower_bound(cell.nodes.begin(), cell.nodes.end(), shape.nodes[k]);
    if (at == cell.nodes.end() || *at != shape.nodes[k])
      return true;
    return cell.gradient_at(at - cell.nodes.begin(), lane).isZero(0);
  });
}

void SmallBoxes::set_gradient(int cell, std::ptrdiff_t k, int lane, const Vector3& gradient) {
  const auto count = std::ssize(cells_[cell].nodes);
  double* at = cells_[cell].gradients.data() + 3 * count * lane + k;
  for (int axis = 0; axis < 3; ++axis)
    at[axis * count] = gradient[axis];
}

void SmallBoxes::add_cell(const topology::Domain& domain, const BackgroundBox& cell) {
  BoxShapes shapes;
  shapes.centre = cell.centre;
  shapes.half = cell.half;
  shapes.first_box = size();
  const Vector3 half = 0.5 * cell.half, sample_half = 0.5 * half;
  const bool inside = is_inside(domain, cell.centre, cell.half);
  for (int octant = 0; octant < BoxShapes::lanes; ++octant) {
    SmallBox box{octant_of(cell.centre, cell.half, octant), half, Vector3::Zero(), 8 * half.prod(), true};
    box.middle = box.centre;
    if (!inside) {
      double volume = 0;
      Vector3 moment = Vector3::Zero();
      for (int k = 0; k < 8; ++k) {
        const Vector3 x = octant_of(box.centre, half, k);
        const auto [fraction, shift] = part_inside(domain, x, sample_half);
        const double part = fraction * 8 * sample_half.prod();
        volume += part;
        moment += part * (x + shift);
      }
      if (volume <= least_part * box.volume)
        continue;
      box.whole = volume >= (1 - 1e-9) * box.volume;
      box.volume = volume;
      box.middle = moment / volume;
    }
    boxes_.push_back(box);
    cell_of_.push_back(static_cast<int>(cells_.size()));
  }
  shapes.boxes = size() - shapes.first_box;
  if (shapes.boxes > 0)
    cells_.push_back(std::move(shapes));
}

void SmallBoxes::evaluate_all() {
  parallel_ranges(static_cast<int>(cells_.size()), 16, [&](int begin, int end) {
    std::array<ShapeFunctions, BoxShapes::lanes> at;
    for (int c = begin; c < end; ++c) {
      BoxShapes& cell = cells_[c];
      for (int lane = 0; lane < cell.boxes; ++lane) {
        const Vector3& x = boxes_[cell.first_box + lane].middle;
        if (!solvers::evaluate(spheres_, x, at[lane]))
          throw NumericalError(fmt::format("the quadrature point ({:.6g}, {:.6g}, {:.6g}) m has {} supporting nodes: "
                                           "the nodes leave a hole there",
                                           x.x(), x.y(), x.z(), at[lane].size()));
        cell.nodes.insert(cell.nodes.end(), at[lane].nodes.begin(), at[lane].nodes.end());
      }
      std::sort(cell.nodes.begin(), cell.nodes.end());
      cell.nodes.erase(std::unique(cell.nodes.begin(), cell.nodes.end()), cell.nodes.end());
      cell.value.assign(cell.nodes.size() * BoxShapes::lanes, 0);
      cell.gradients.assign(3 * cell.nodes.size() * BoxShapes::lanes, 0);
      for (int lane = 0; lane < cell.boxes; ++lane)
        for (int k = 0; k < at[lane].size(); ++k) {
          const auto place =
              std::lower_bound(cell.nodes.begin(), cell.nodes.end(), at[lane].nodes[k]) - cell.nodes.begin();
          cell.value[place * BoxShapes::lanes + lane] = at[lane].value[k];
          const auto count = std::ssize(cell.nodes);
          double* gradient = cell.gradients.data() + 3 * count * lane + place;
          gradient[0] = at[lane].dx[k];
          gradient[count] = at[lane].dy[k];
          gradient[2 * count] = at[lane].dz[k];
        }
    }
  });
}

std::array<int, 3> SmallBoxes::bin_of(const Vector3& x) const {
  std::array<int, 3> bin{};
  for (int c = 0; c < 3; ++c)
    bin[c] = std::clamp(static_cast<int>(std::floor((x[c] - bin_origin_[c]) / bin_size_[c])), 0, bins_[c] - 1);
  return bin;
}

void SmallBoxes::sort_into_bins(const BoundingBox& bounds) {
  Vector3 smallest = bounds.extent();
  for (const SmallBox& box : boxes_)
    smallest = smallest.cwiseMin(2 * box.half);
  bin_origin_ = bounds.lower;
  for (int c = 0; c < 3; ++c) {
    bins_[c] = std::clamp(static_cast<int>(bounds.extent()[c] / smallest[c]), 1, most_bins_along);
    bin_size_[c] = bounds.extent()[c] / bins_[c];
  }
  const auto for_bins = [&](const SmallBox& box, auto&& visit) {
    const Vector3 margin = 1e-9 * box.half;
    const std::array<int, 3> low = bin_of(box.centre - box.half + margin),
                             high = bin_of(box.centre + box.half - margin);
    for (int a = low[0]; a <= high[0]; ++a)
      for (int b = low[1]; b <= high[1]; ++b)
        for (int c = low[2]; c <= high[2]; ++c)
          visit((a * bins_[1] + b) * bins_[2] + c);
  };
  bin_start_.assign(bins_[0] * bins_[1] * bins_[2] + 1, 0);
  for (const SmallBox& box : boxes_)
    for_bins(box, [&](int bin) { ++bin_start_[bin + 1]; });
  for (std::size_t k = 1; k < bin_start_.size(); ++k)
    bin_start_[k] += bin_start_[k - 1];
  bin_boxes_.resize(bin_start_.back());
  std::vector<int> next(bin_start_.begin(), bin_start_.end() - 1);
  for (int b = 0; b < size(); ++b)
    for_bins(boxes_[b], [&](int bin) { bin_boxes_[next[bin]++] = b; });
  // Boxes come along the octree, where neighbours follow one another within a root cell.
  std::vector<std::pair<int, int>> keys;
  for (int c = 0; c < std::ssize(cells_); ++c) {
    const std::array<int, 3> bin = bin_of(boxes_[cells_[c].first_box].centre);
    int key = 0;
    for (int bit = 0; bit < 7; ++bit)
      for (int axis = 0; axis < 3; ++axis)
        key |= (bin[axis] >> bit & 1) << (3 * bit + axis);
    keys.emplace_back(key, c);
  }
  std::sort(keys.begin(), keys.end());
  for (const auto& [key, cell] : keys)
    order_.push_back(cell);
}

void SmallBoxes::within(const BoundingBox& region, std::vector<int>& found) const {
  found.clear();
  if ((region.lower.array() > region.upper.array()).any())
    return;
  const std::array<int, 3> low = bin_of(region.lower), high = bin_of(region.upper);
  for (int a = low[0]; a <= high[0]; ++a)
    for (int b = low[1]; b <= high[1]; ++b)
      for (int c = low[2]; c <= high[2]; ++c) {
        const int bin = (a * bins_[1] + b) * bins_[2] + c;
        found.insert(found.end(), bin_boxes_.begin() + bin_start_[bin], bin_boxes_.begin() + bin_start_[bin + 1]);
      }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
}

const std::vector<int>& SmallBoxes::in_reach(int node) const {
  const std::scoped_lock lock(reach_mutex_);
  std::vector<int>& near = reach_[node];
  if (!near.empty())
    return near;
  const Vector3& x = spheres_.centres()[node];
  const double radius = spheres_.radii()[node];
  within({x.array() - radius, x.array() + radius}, near);
  std::erase_if(near, [&](int box) {
    return ((x - boxes_[box].centre).cwiseAbs() - boxes_[box].half).cwiseMax(0).squaredNorm() >= radius * radius;
  });
  return near;
}

int SmallBoxes::locate(const Vector3& x) const {
  const auto distance = [&](int b) {
    return ((x - boxes_[b].centre).cwiseAbs() - boxes_[b].half).cwiseMax(0).squaredNorm();
  };
  const std::array<int, 3> bin = bin_of(x);
  int best = -1;
  double least = std::numeric_limits<double>::infinity();
  for (int reach = 0; reach <= std::max({bins_[0], bins_[1], bins_[2]}); ++reach) {
    for (int a = std::max(0, bin[0] - reach); a <= std::min(bins_[0] - 1, bin[0] + reach); ++a)
      for (int b = std::max(0, bin[1] - reach); b <= std::min(bins_[1] - 1, bin[1] + reach); ++b)
        for (int c = std::max(0, bin[2] - reach); c <= std::min(bins_[2] - 1, bin[2] + reach); ++c) {
          if (std::max({std::abs(a - bin[0]), std::abs(b - bin[1]), std::abs(c - bin[2])}) < reach)
            continue;
          const int at = (a * bins_[1] + b) * bins_[2] + c;
          for (int k = bin_start_[at]; k < bin_start_[at + 1]; ++k)
            if (const double d = distance(bin_boxes_[k]); d < least) {
              least = d;
              best = bin_boxes_[k];
            }
        }
    if (best >= 0 && (least == 0 || least <= std::pow(reach * bin_size_.minCoeff(), 2)))
      break;
  }
  return best;
}

void SmallBoxes::find_neighbours() {
  neighbour_start_.assign(1, 0);
  std::vector<int> near;
  for (int b = 0; b < size(); ++b) {
    const SmallBox& box = boxes_[b];
    const Vector3 margin = 1e-6 * box.half;
    within({box.centre - box.half - margin, box.centre + box.half + margin}, near);
    for (const int other : near) {
      if (other == b)
        continue;
      const Vector3 gap = (boxes_[other].centre - box.centre).cwiseAbs() - box.half - boxes_[other].half;
      int touching = 0, overlapping = 0;
      for (int c = 0; c < 3; ++c) {
        touching += std::abs(gap[c]) < 1e-6 * box.half[c] ? 1 : 0;
        overlapping += gap[c] < -1e-6 * box.half[c] ? 1 : 0;
      }
      if (touching == 1 && overlapping == 2)
        neighbours_.push_back(other);
    }
    neighbour_start_.push_back(static_cast<int>(neighbours_.size()));
  }
}

} // namespace spherecut::solvers
