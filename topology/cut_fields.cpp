#include "topology/cut_fields.hpp"

#include "topology/errors.hpp"
#include "topology/proximity.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <openvdb/openvdb.h>
#include <utility>

namespace spherecut::topology {

namespace {

using Tree = openvdb::FloatTree;
using Leaf = Tree::LeafNodeType;
constexpr int leaf_side = 8;

/// Indices of the voxels whose centres lie in a box.
struct VoxelBox {
  openvdb::Coord lower, upper; // inclusive

  VoxelBox(const Vector3& lower_corner, const Vector3& upper_corner, double voxel) {
    for (int d = 0; d < 3; ++d) {
      lower[d] = static_cast<int>(std::ceil(lower_corner[d] / voxel));
      upper[d] = static_cast<int>(std::floor(upper_corner[d] / voxel));
    }
  }
};

Vector3 centre(const openvdb::Coord& voxel, double size) {
  return {voxel.x() * size, voxel.y() * size, voxel.z() * size};
}

/// Calls visit(origin, from, to) for every leaf that the box meets, with the part of the box in it.
template <class Visit>
void for_leaves(const VoxelBox& box, const Visit& visit) {
  constexpr int mask = ~(leaf_side - 1);
  openvdb::Coord origin;
  for (origin.x() = box.lower.x() & mask; origin.x() <= box.upper.x(); origin.x() += leaf_side)
    for (origin.y() = box.lower.y() & mask; origin.y() <= box.upper.y(); origin.y() += leaf_side)
      for (origin.z() = box.lower.z() & mask; origin.z() <= box.upper.z(); origin.z() += leaf_side)
        visit(origin, openvdb::Coord::maxComponent(box.lower, origin),
              openvdb::Coord::minComponent(box.upper, origin.offsetBy(leaf_side - 1)));
}

/// A triangle and the disc in its plane that covers it, whose distance is cheap and never larger.
struct CoveredTriangle {
  std::array<Vector3, 3> corners;
  Vector3 middle, normal;
  double radius; // m

  explicit CoveredTriangle(const std::array<Vector3, 3>& p) : corners(p), middle((p[0] + p[1] + p[2]) / 3), radius(0) {
    normal = (p[1] - p[0]).cross(p[2] - p[0]).normalized();
    for (const Vector3& corner : p)
      radius = std::max(radius, (corner - middle).norm());
  }

  /// Whether no point of the triangle is nearer to x than `limit` m.
  [[nodiscard]] bool clear_of(const Vector3& x, double limit) const {
    const Vector3 away = x - middle;
    const double height = away.dot(normal), squared = height * height, room = limit * limit - squared;
    if (room <= 0)
      return true;
    const double lateral = away.squaredNorm() - squared; // squared
    if (lateral <= radius * radius)
      return false;
    const double beyond = std::sqrt(lateral) - radius;
    return beyond * beyond * (1 - 1e-6) > room;
  }

  [[nodiscard]] double distance(const Vector3& x) const {
    return (closest_on_triangle(x, corners[0], corners[1], corners[2]).point - x).norm();
  }
};

/// All that the frames along a segment of the front depend on.
struct FrontKey {
  std::array<double, 18> values;
  bool operator<(const FrontKey& other) const { return values < other.values; }
};

FrontKey key_of(const Incision& incision, int segment) {
  const FrontSegment& s = incision.front()[segment];
  const FrontFrame a = incision.front_frame_at(segment, 0), b = incision.front_frame_at(segment, 1);
  FrontKey key{};
  int i = 0;
  for (const Vector3& v : {s.from, s.to, a.ahead, a.normal, b.ahead, b.normal})
    for (int d = 0; d < 3; ++d)
      key.values[i++] = v[d];
  return key;
}

/// Whether `sheets` begin with the triangles of `before`.
bool extends(const std::vector<SurfaceMesh>& before, const std::vector<SurfaceMesh>& sheets) {
  if (before.size() > sheets.size())
    return false;
  for (std::size_t s = 0; s < before.size(); ++s) {
    const SurfaceMesh &a = before[s], &b = sheets[s];
    if (a.vertices.size() > b.vertices.size() || a.triangles.size() > b.triangles.size() ||
        !std::equal(a.vertices.begin(), a.vertices.end(), b.vertices.begin()) ||
        !std::equal(a.triangles.begin(), a.triangles.end(), b.triangles.begin()))
      return false;
  }
  return true;
}

} // namespace

struct CutFields::Impl {
  Impl(double voxel_in, double band_in)
      : voxel(voxel_in), band(band_in), distances(static_cast<float>(band_in)), aheads(static_cast<float>(band_in)) {}

  [[nodiscard]] VoxelBox around(const Vector3& lower, const Vector3& upper) const {
    const Vector3 margin = Vector3::Constant(band);
    return {lower - margin, upper + margin, voxel};
  }

  /// Lowers the distances near one triangle. Voxels that enter the band start behind all fronts.
  void add_triangle(const CoveredTriangle& triangle) {
    const auto& [a, b, c] = triangle.corners;
    for_leaves(around(a.cwiseMin(b).cwiseMin(c), a.cwiseMax(b).cwiseMax(c)),
               [&](const openvdb::Coord& origin, const openvdb::Coord& from, const openvdb::Coord& to) {
                 Leaf* leaf = distance_cache.probeLeaf(origin);
                 Leaf* ahead_leaf = leaf ? ahead_cache.probeLeaf(origin) : nullptr;
                 openvdb::Coord at;
                 for (at.x() = from.x(); at.x() <= to.x(); ++at.x())
                   for (at.y() = from.y(); at.y() <= to.y(); ++at.y())
                     for (at.z() = from.z(); at.z() <= to.z(); ++at.z()) {
                       const openvdb::Index offset = Leaf::coordToOffset(at);
                       const float known = leaf ? leaf->getValue(offset) : static_cast<float>(band);
                       const Vector3 x = centre(at, voxel);
                       if (triangle.clear_of(x, known))
                         continue;
                       const auto value = static_cast<float>(triangle.distance(x));
                       if (value >= known)
                         continue;
                       if (!leaf) {
                         leaf = distance_cache.touchLeaf(origin);
                         ahead_leaf = ahead_cache.touchLeaf(origin);
                       }
                       if (!leaf->isValueOn(offset))
                         ahead_leaf->setValueOn(offset, -static_cast<float>(band));
                       leaf->setValueOn(offset, value);
                     }
               });
  }

  /// Marks the voxels of the band that a segment of the front decides or decided.
  void mark(const Vector3& from, const Vector3& to) {
    const Vector3 along = to - from;
    const double squared_length = along.squaredNorm(), squared_band = band * band;
    for_leaves(around(from.cwiseMin(to), from.cwiseMax(to)),
               [&](const openvdb::Coord& origin, const openvdb::Coord& first, const openvdb::Coord& last) {
                 const Leaf* leaf = distance_cache.probeLeaf(origin);
                 if (!leaf)
                   return;
                 auto& marks = marked[origin];
                 openvdb::Coord at;
                 for (at.x() = first.x(); at.x() <= last.x(); ++at.x())
                   for (at.y() = first.y(); at.y() <= last.y(); ++at.y())
                     for (at.z() = first.z(); at.z() <= last.z(); ++at.z()) {
                       const openvdb::Index offset = Leaf::coordToOffset(at);
                       if (marks.isOn(offset) || !leaf->isValueOn(offset))
                         continue;
                       const Vector3 away = centre(at, voxel) - from;
                       const double s = std::clamp(away.dot(along), 0.0, squared_length) / squared_length;
                       if ((away - s * along).squaredNorm() <= squared_band)
                         marks.setOn(offset);
                     }
               });
  }

  void place_marked(const Incision& incision) {
    // A hair within the band: every voxel that a front decides is in the band of that front's sheet.
    const double reach = band * (1 - 1e-6);
    for (const auto& [origin, marks] : marked) {
      Leaf* leaf = ahead_cache.probeLeaf(origin);
      for (auto it = marks.beginOn(); it; ++it) {
        const Vector3 x = centre(origin + Leaf::offsetToLocalCoord(it.pos()), voxel);
        double value = -band;
        if (const auto frame = incision.front_frame(x, reach))
          value = (x - frame->point).dot(frame->ahead);
        leaf->setValueOn(it.pos(), static_cast<float>(value));
      }
    }
    marked.clear();
  }

  void require_memory(const Incision& incision) const {
    double area = 0; // m2, of whole sheets
    for (const SurfaceMesh& sheet : incision.sheets())
      area += topology::area(sheet);
    // Leaves are filled to about a third around a surface.
    const double bytes = 3 * area * 2 * band / std::pow(voxel, 3) * 2 * sizeof(float);
    constexpr double most_bytes = 2e9;
    if (bytes > most_bytes)
      throw InputError(fmt::format("cut fields: sheets of {:.3g} m2 with voxels of {} m would need {:.2g} GB, at most "
                                   "{:.2g} GB are allowed",
                                   area, voxel, bytes / 1e9, most_bytes / 1e9));
  }

  void update(const std::shared_ptr<const Incision>& next) {
    const bool grows = current && extends(current->sheets(), next->sheets());
    if (!grows) {
      distance_cache.clear();
      ahead_cache.clear();
      distances.clear();
      aheads.clear();
      front.clear();
    }
    for (std::size_t s = 0; s < next->sheets().size(); ++s) {
      const SurfaceMesh& sheet = next->sheets()[s];
      const bool known = grows && s < current->sheets().size();
      for (std::size_t t = known ? current->sheets()[s].triangles.size() : 0; t < sheet.triangles.size(); ++t) {
        const Triangle& corners = sheet.triangles[t];
        add_triangle(
            CoveredTriangle({sheet.vertices[corners[0]], sheet.vertices[corners[1]], sheet.vertices[corners[2]]}));
      }
    }
    std::vector<FrontKey> keys;
    for (int i = 0; i < std::ssize(next->front()); ++i)
      keys.push_back(key_of(*next, i));
    std::sort(keys.begin(), keys.end());
    std::vector<FrontKey> changed;
    std::set_symmetric_difference(front.begin(), front.end(), keys.begin(), keys.end(), std::back_inserter(changed));
    for (const FrontKey& key : changed)
      mark(Vector3(key.values.data()), Vector3(key.values.data() + 3));
    place_marked(*next);
    front = std::move(keys);
    current = next;
  }

  [[nodiscard]] double sample(const Tree& tree, const Vector3& x) const {
    const Vector3 p = x / voxel;
    if (!(p.cwiseAbs().maxCoeff() < 1e9))
      return band;
    const openvdb::Coord c = openvdb::Coord::floor(openvdb::Vec3d(p.x(), p.y(), p.z()));
    const openvdb::tree::ValueAccessor<const Tree, false> values(tree);
    double sum = 0;
    for (int corner = 0; corner < 8; ++corner) {
      const int i = corner & 1, j = (corner >> 1) & 1, k = corner >> 2;
      const double u = p.x() - c.x(), v = p.y() - c.y(), w = p.z() - c.z();
      const openvdb::Coord at = c.offsetBy(i, j, k);
      if (!values.isValueOn(at))
        return band;
      sum += (i ? u : 1 - u) * (j ? v : 1 - v) * (k ? w : 1 - w) * values.getValue(at);
    }
    return sum;
  }

  double voxel, band;     // m
  Tree distances, aheads; // the same voxels are on in both
  openvdb::tree::ValueAccessor<Tree> distance_cache{distances}, ahead_cache{aheads};
  std::map<openvdb::Coord, Leaf::NodeMaskType> marked; // by leaf
  std::vector<FrontKey> front;                         // sorted
  std::shared_ptr<const Incision> current;
};

CutFields::CutFields(double voxel_size, double band_voxels) {
  if (!(std::isfinite(voxel_size) && voxel_size > 0))
    throw InputError(fmt::format("cut fields: voxel size = {} m, must be a positive number", voxel_size));
  if (!(band_voxels >= 1 && band_voxels <= 10))
    throw InputError(fmt::format("cut fields: band = {} voxels, must be from 1 to 10", band_voxels));
  openvdb::initialize();
  impl_ = std::make_unique<Impl>(voxel_size, voxel_size * band_voxels);
}
CutFields::~CutFields() = default;
CutFields::CutFields(CutFields&&) noexcept = default;
CutFields& CutFields::operator=(CutFields&&) noexcept = default;

void CutFields::update(std::shared_ptr<const Incision> incision) {
  if (!incision)
    throw InputError("cut fields: no incision is given");
  impl_->require_memory(*incision);
  impl_->update(incision);
}

double CutFields::distance(const Vector3& x) const {
  return impl_->sample(impl_->distances, x);
}
double CutFields::ahead(const Vector3& x) const {
  return impl_->sample(impl_->aheads, x);
}
double CutFields::voxel_size() const {
  return impl_->voxel;
}
double CutFields::band() const {
  return impl_->band;
}
std::size_t CutFields::memory_bytes() const {
  return impl_->distances.memUsage() + impl_->aheads.memUsage();
}

std::vector<CutVoxel> CutFields::voxels() const {
  std::vector<CutVoxel> result;
  for (auto it = impl_->distances.cbeginValueOn(); it; ++it) {
    const openvdb::Coord at = it.getCoord();
    result.push_back({{at.x(), at.y(), at.z()}, *it, impl_->aheads.getValue(at)});
  }
  return result;
}

} // namespace spherecut::topology
