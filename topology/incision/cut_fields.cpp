#include "topology/incision/cut_fields.hpp"

#include "topology/base/errors.hpp"
#include "topology/domain/voxel_centre.inl"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <map>
#include <openvdb/openvdb.h>
#include <utility>

namespace spherecut::topology {

namespace {

using Tree = openvdb::FloatTree;
using Leaf = Tree::LeafNodeType;
constexpr int leaf_side = 8;

/// Indices of the voxels whose centres lie in a box.
struct LeafBox {
  openvdb::Coord lower, upper; // inclusive

  LeafBox(const Vector3& lower_corner, const Vector3& upper_corner, double voxel) {
    for (int d = 0; d < 3; ++d) {
      lower[d] = static_cast<int>(std::ceil(lower_corner[d] / voxel));
      upper[d] = static_cast<int>(std::floor(upper_corner[d] / voxel));
    }
  }
};

/// Calls visit(origin, from, to) for every leaf that the box meets, with the part of the box in it.
template <class Visit>
void for_leaves(const LeafBox& box, const Visit& visit) {
  constexpr int mask = ~(leaf_side - 1);
  openvdb::Coord origin;
  for (origin.x() = box.lower.x() & mask; origin.x() <= box.upper.x(); origin.x() += leaf_side)
    for (origin.y() = box.lower.y() & mask; origin.y() <= box.upper.y(); origin.y() += leaf_side)
      for (origin.z() = box.lower.z() & mask; origin.z() <= box.upper.z(); origin.z() += leaf_side)
        visit(origin, openvdb::Coord::maxComponent(box.lower, origin),
              openvdb::Coord::minComponent(box.upper, origin.offsetBy(leaf_side - 1)));
}

/// Distances from a triangle to the voxels of a leaf, eight at a time along z, in the triangle's own plane coordinates
/// u, v and height h about its middle. Single precision: all lengths are of the order of the band.
class TriangleRows {
 public:
  using Row = Eigen::Array<float, leaf_side, 1>;

  TriangleRows(const std::array<Vector3, 3>& p, double voxel) : middle_((p[0] + p[1] + p[2]) / 3) {
    axes_.row(0) = (p[1] - p[0]).normalized();
    axes_.row(2) = (p[1] - p[0]).cross(p[2] - p[0]).normalized();
    axes_.row(1) = axes_.row(2).cross(axes_.row(0));
    std::array<Eigen::Vector2d, 3> corners;
    for (int c = 0; c < 3; ++c)
      corners[c] = (axes_ * (p[c] - middle_)).head<2>();
    double radius = 0;
    for (int e = 0; e < 3; ++e) {
      const Eigen::Vector2d along = corners[(e + 1) % 3] - corners[e];
      corner_[e] = corners[e].cast<float>();
      along_[e] = along.cast<float>();
      share_[e] = (along / along.squaredNorm()).cast<float>();
      radius = std::max(radius, corners[e].norm());
    }
    rounding_ = static_cast<float>(1e-5 * (2 * leaf_side * voxel + radius));
    radius_ = static_cast<float>(radius) + rounding_;
    steps_ = (axes_ * voxel).cast<float>();
    const Row k = Row::LinSpaced(0, leaf_side - 1);
    for (int d = 0; d < 3; ++d)
      along_z_[d] = k * steps_(d, 2);
  }

  void enter_leaf(const Vector3& origin) { origin_ = (axes_ * (origin - middle_)).cast<float>(); }

  /// Squared distances of the row at voxel i, j of the leaf; false when none is below those given.
  bool lower(int i, int j, const Row& squared_limits, Row& squared) const {
    const Eigen::Vector3f start =
        origin_ + static_cast<float>(i) * steps_.col(0) + static_cast<float>(j) * steps_.col(1);
    const Row height = start[2] + along_z_[2];
    // A disc that covers the triangle, less rounding: never farther than what is computed below, so that the order of
    // the triangles does not matter, and cheap.
    const Row u = start[0] + along_z_[0], v = start[1] + along_z_[1];
    const Row off_plane = (height.abs() - rounding_).max(0.0F);
    const Row beyond = ((u * u + v * v).sqrt() - radius_).max(0.0F);
    constexpr float relative = 1 - 1e-5F;
    if (((off_plane * off_plane + beyond * beyond) * relative - squared_limits).minCoeff() >= 0)
      return false;
    Row to_border = Row::Constant(std::numeric_limits<float>::max());
    Row outside = -to_border; // positive beyond some edge
    for (int e = 0; e < 3; ++e) {
      const Row from_u = u - corner_[e][0], from_v = v - corner_[e][1];
      const Row s = (from_u * share_[e][0] + from_v * share_[e][1]).max(0.0F).min(1.0F);
      const Row off_u = from_u - s * along_[e][0], off_v = from_v - s * along_[e][1];
      to_border = to_border.min(off_u * off_u + off_v * off_v);
      outside = outside.max(from_u * along_[e][1] - from_v * along_[e][0]);
    }
    for (int k = 0; k < leaf_side; ++k)
      squared[k] = height[k] * height[k] + (outside[k] > 0 ? to_border[k] : 0.0F);
    return true;
  }

 private:
  Vector3 middle_;
  Matrix3 axes_; // rows: u, v, normal
  std::array<Eigen::Vector2f, 3> corner_, along_, share_;
  float radius_ = 0, rounding_ = 0; // m
  Eigen::Matrix3f steps_;           // of u, v, h per voxel along x, y, z
  std::array<Row, 3> along_z_;
  Eigen::Vector3f origin_ = Eigen::Vector3f::Zero();
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

  [[nodiscard]] LeafBox around(const Vector3& lower, const Vector3& upper) const {
    const Vector3 margin = Vector3::Constant(band);
    return {lower - margin, upper + margin, voxel};
  }

  /// Lowers the distances near one triangle. Voxels that enter the band start behind all fronts.
  void add_triangle(const std::array<Vector3, 3>& p) {
    using Row = TriangleRows::Row;
    const float widest = static_cast<float>(band);
    TriangleRows rows(p, voxel);
    const LeafBox box = around(p[0].cwiseMin(p[1]).cwiseMin(p[2]), p[0].cwiseMax(p[1]).cwiseMax(p[2]));
    for_leaves(box, [&](const openvdb::Coord& origin, const openvdb::Coord& from, const openvdb::Coord& to) {
      Leaf* leaf = distance_cache.probeLeaf(origin);
      Leaf* ahead_leaf = leaf ? ahead_cache.probeLeaf(origin) : nullptr;
      rows.enter_leaf(centre(origin, voxel));
      for (int i = from.x() - origin.x(); i <= to.x() - origin.x(); ++i)
        for (int j = from.y() - origin.y(); j <= to.y() - origin.y(); ++j) {
          const int offset = leaf_side * (leaf_side * i + j);
          Row known = Row::Constant(widest), squared;
          if (leaf)
            known = Eigen::Map<const Row>(leaf->buffer().data() + offset);
          if (!rows.lower(i, j, known * known, squared))
            continue;
          const Row values = squared.sqrt();
          for (int k = 0; k < leaf_side; ++k) {
            const float value = values[k];
            if (value >= known[k])
              continue;
            if (!leaf) {
              leaf = distance_cache.touchLeaf(origin);
              ahead_leaf = ahead_cache.touchLeaf(origin);
            }
            if (!leaf->isValueOn(offset + k))
              ahead_leaf->setValueOn(offset + k, -widest);
            leaf->setValueOn(offset + k, value);
          }
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

  /// Area of the triangles of `next` that were not there before, m2. Throws when the fields would grow too large.
  [[nodiscard]] double new_area(const Incision& next, bool grows) const {
    double added = 0;
    for_new_triangles(next, grows,
                      [&](const std::array<Vector3, 3>& p) { added += 0.5 * (p[1] - p[0]).cross(p[2] - p[0]).norm(); });
    // Leaves are filled to about a third around a surface.
    const double total = added + (grows ? sheet_area : 0);
    const double bytes = 3 * total * 2 * band / std::pow(voxel, 3) * 2 * sizeof(float);
    constexpr double most_bytes = 2e9;
    if (bytes > most_bytes)
      throw InputError(fmt::format("cut fields: sheets of {:.3g} m2 with voxels of {} m would need {:.2g} GB, at most "
                                   "{:.2g} GB are allowed",
                                   total, voxel, bytes / 1e9, most_bytes / 1e9));
    return added;
  }

  template <class Visit>
  void for_new_triangles(const Incision& next, bool grows, const Visit& visit) const {
    for (std::size_t s = 0; s < next.sheets().size(); ++s) {
      const SurfaceMesh& sheet = next.sheets()[s];
      const bool known = grows && s < current->sheets().size();
      for (std::size_t t = known ? current->sheets()[s].triangles.size() : 0; t < sheet.triangles.size(); ++t) {
        const Triangle& corners = sheet.triangles[t];
        visit(
            std::array<Vector3, 3>{sheet.vertices[corners[0]], sheet.vertices[corners[1]], sheet.vertices[corners[2]]});
      }
    }
  }

  void update(const std::shared_ptr<const Incision>& next) {
    const bool grows = current && extends(current->sheets(), next->sheets());
    const double added = new_area(*next, grows);
    if (!grows) {
      distance_cache.clear();
      ahead_cache.clear();
      distances.clear();
      aheads.clear();
      front.clear();
      sheet_area = 0;
    }
    sheet_area += added;
    for_new_triangles(*next, grows, [this](const std::array<Vector3, 3>& p) { add_triangle(p); });
    std::vector<FrontKey> keys;
    keys.reserve(next->front().size());
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
  double sheet_area = 0;                               // m2, of all triangles added
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

void CutFields::update(const std::shared_ptr<const Incision>& incision) {
  if (!incision)
    throw InputError("cut fields: no incision is given");
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
