#include "solvers/quadrature/background_cells.hpp"

#include "solvers/quadrature/box_memory.hpp"
#include "solvers/quadrature/split_box.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"
#include "topology/search/point_tree.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <fmt/format.h>
#include <map>

namespace spherecut::solvers {

namespace {

/// Parts of cells this near to a front, in half diagonals, have their points placed for what is singular there.
constexpr double front_reach = 2;
/// A sheet that lies in a face of a box counts as passing it: its front is as singular on either side of the face.
constexpr double touching = 1 + 1e-9;
/// Samples of a part count as this far from the front at least, in half edges of the part.
constexpr double nearest = 0.02;
/// A node within a cell may want smaller ones by this much before the cell is divided for it.
constexpr double finer_node_slack = 1.3;

/// Part of a box on the inner side of a plane through it, by the distance of its centre: exact for a box cut parallel
/// to a face, second order otherwise.
double inside_fraction(double distance, const Vector3& normal, const Vector3& half) {
  const double reach = normal.cwiseAbs().dot(half);
  return std::clamp(0.5 - 0.5 * distance / reach, 0.0, 1.0);
}

/// Quadrature points of one box after another.
class BoxFiller {
 public:
  BoxFiller(const topology::Domain& domain, const BackgroundOptions& options, const topology::Incision* incision,
            BackgroundCells& cells, std::shared_ptr<const BoxMemory::Boxes> known = nullptr)
      : domain_(domain), options_(options), incision_(incision),
        has_walls_(incision != nullptr && incision->cut_sheets() < std::ssize(incision->sheets())), cells_(cells),
        known_(std::move(known)) {}

  /// `distance`: signed distance of its centre to the surface.
  void fill(const Vector3& centre, const Vector3& half, double distance) {
    BackgroundBox box{centre, half, static_cast<int>(cells_.start.size()) - 1, 0};
    const bool is_deep = distance < -half.norm();
    BoxMemory::Box* const at_surface = known_ != nullptr && !is_deep ? &remembered(centre, half) : nullptr;
    const bool inside = is_deep || (at_surface != nullptr ? at_surface->inside : corners_inside(centre, half));
    if (options_.regions != nullptr && is_layered(centre, half))
      add_layered(centre, half, inside);
    else if (has_walls_ && is_walled(centre, half))
      add_walled(centre, half);
    else if (incision_ != nullptr && may_be_split(centre, half))
      add_split(centre, half, inside);
    else if (inside)
      add_rule(centre, half);
    else if (at_surface != nullptr)
      add_remembered_cut(centre, half, *at_surface);
    else
      add_cut(centre, half);
    if (std::ssize(cells_.points) > cells_.start.back())
      cells_.start.push_back(static_cast<int>(cells_.points.size()));
    box.last_cell = static_cast<int>(cells_.start.size()) - 1;
    if (box.last_cell > box.first_cell)
      cells_.boxes.push_back(box);
  }

  /// The boxes at the surface that were filled.
  BoxMemory::Boxes take_boxes() { return std::move(boxes_); }

 private:
  /// What is known of a box, or its beginning.
  BoxMemory::Box& remembered(const Vector3& centre, const Vector3& half) {
    const BoxMemory::Key key{centre.x(), centre.y(), centre.z(), half.x(), half.y(), half.z()};
    const auto found = known_->find(key);
    return boxes_
        .emplace(key, found != known_->end() ? found->second : BoxMemory::Box{corners_inside(centre, half), false, {}})
        .first->second;
  }

  void add_remembered_cut(const Vector3& centre, const Vector3& half, BoxMemory::Box& box) {
    if (box.is_cut) {
      cells_.points.insert(cells_.points.end(), box.points.begin(), box.points.end());
      return;
    }
    const auto first = std::ssize(cells_.points);
    add_cut(centre, half);
    box.is_cut = true;
    box.points.assign(cells_.points.begin() + first, cells_.points.end());
  }

  bool corners_inside(const Vector3& centre, const Vector3& half) const {
    for (int k = 0; k < 8; ++k) {
      const Vector3 corner = centre + half.cwiseProduct(Vector3(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1));
      if (domain_.signed_distance(corner) > 1e-9 * half.norm())
        return false;
    }
    return true;
  }

  /// Six points, the corners of an octahedron turned out of the axes: exact to degree three as two Gauss points a
  /// direction are, which are eight. Along each axis they lie at four places instead of two, so that what oscillates
  /// faster is told apart better: with a quarter fewer points the smooth field's error is 5 to 10 % smaller.
  void add_octahedron(const Vector3& centre, const Vector3& half) {
    const double weight = 8 * half.prod() / 6;
    for (int axis = 0; axis < 3; ++axis) {
      Vector3 place = Vector3::Constant(2.0 / 3);
      place[axis] = -1.0 / 3;
      cells_.points.push_back({centre + half.cwiseProduct(place), weight});
      cells_.points.push_back({centre - half.cwiseProduct(place), weight});
    }
  }

  void add_gauss_27(const Vector3& centre, const Vector3& half) {
    static constexpr std::array<double, 3> places = {-0.7745966692414834, 0, 0.7745966692414834};
    static constexpr std::array<double, 3> weights = {5.0 / 9, 8.0 / 9, 5.0 / 9};
    const double volume = half.prod();
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b)
        for (int c = 0; c < 3; ++c)
          cells_.points.push_back({centre + half.cwiseProduct(Vector3(places[a], places[b], places[c])),
                                   volume * weights[a] * weights[b] * weights[c]});
  }

  void add_rule(const Vector3& centre, const Vector3& half) {
    if (options_.quadrature == 1)
      cells_.points.push_back({centre, 8 * half.prod()});
    else if (options_.quadrature == 2)
      add_octahedron(centre, half);
    else
      add_gauss_27(centre, half);
  }

  /// Part of a small box inside the body: its volume over that of the box, and how far its centroid lies from the
  /// box's.
  std::pair<double, Vector3> part_inside(const Vector3& x, const Vector3& half) const {
    const double distance = domain_.signed_distance(x);
    if (std::abs(distance) >= half.norm())
      return {distance < 0 ? 1 : 0, Vector3::Zero()};
    const Vector3 n = domain_.normal(x);
    const double fraction = inside_fraction(distance, n, half);
    return {fraction, -(1 - fraction) * n.cwiseAbs().dot(half) * n};
  }

  static constexpr int octants = 8;
  static Vector3 octant_centre(const Vector3& centre, const Vector3& half, int octant) {
    return centre + 0.5 * half.cwiseProduct(Vector3(octant & 1 ? 1 : -1, octant & 2 ? 1 : -1, octant & 4 ? 1 : -1));
  }

  void add_cut(const Vector3& centre, const Vector3& half) {
    const Vector3 octant_half = half / 2, sample_half = half / 4;
    for (int octant = 0; octant < octants; ++octant) {
      const Vector3 middle = octant_centre(centre, half, octant);
      double volume = 0;
      Vector3 moment = Vector3::Zero();
      for (int k = 0; k < octants; ++k) {
        const Vector3 x = octant_centre(middle, octant_half, k);
        const auto [fraction, shift] = part_inside(x, sample_half);
        const double part = fraction * 8 * sample_half.prod();
        volume += part;
        moment += part * (x + shift);
      }
      if (volume > 1e-3 * 8 * octant_half.prod())
        cells_.points.push_back({moment / volume, volume});
    }
  }

  /// Whether a face between materials may pass through the box.
  [[nodiscard]] bool is_layered(const Vector3& centre, const Vector3& half) const {
    return crossing_faces(centre, half, nullptr) > 0;
  }

  /// How many faces between materials may pass through the box, and the one nearest to its centre.
  int crossing_faces(const Vector3& centre, const Vector3& half, const RegionFace** nearest) const {
    int count = 0;
    double least = half.norm();
    for (const RegionFace& face : options_.regions->faces()) {
      const double distance = std::abs(face.distance(centre));
      if (distance >= half.norm() || distance >= face.normal(centre).cwiseAbs().dot(half))
        continue;
      ++count;
      if (nearest != nullptr && distance < least) {
        *nearest = &face;
        least = distance;
      }
    }
    return count;
  }

  /// Material of one region in an octant.
  struct RegionPart {
    int region;
    double volume = 0;
    Vector3 moment = Vector3::Zero();
  };

  /// Adds the parts of a small box on either side of the face nearest to it, `fraction` of their volumes, moved by
  /// `shift`.
  void add_region_parts(const Vector3& x, const Vector3& half, double fraction, const Vector3& shift,
                        std::vector<RegionPart>& parts) const {
    const RegionFace* face = nullptr;
    std::array<BoxPart, 2> pieces{BoxPart{8 * half.prod(), x}, BoxPart{}};
    if (crossing_faces(x, half, &face) > 0) {
      const Vector3 normal = face->normal(x);
      pieces = split_box(x, half, x - face->distance(x) * normal, normal);
    }
    for (const BoxPart& piece : pieces) {
      if (piece.volume == 0)
        continue;
      const int region = options_.regions->at(piece.centroid);
      auto part = std::find_if(parts.begin(), parts.end(), [&](const RegionPart& of) { return of.region == region; });
      if (part == parts.end())
        part = parts.insert(parts.end(), {region});
      part->volume += fraction * piece.volume;
      part->moment += fraction * piece.volume * (piece.centroid + shift);
    }
  }

  /// Points of a box that faces between materials pass: every octant has one for each region in it. An octant of one
  /// face, inside the body, is divided by the face's tangent plane, others by that of every sample.
  void add_layered(const Vector3& centre, const Vector3& half, bool inside) {
    const Vector3 octant_half = half / 2;
    std::vector<RegionPart> parts;
    for (int octant = 0; octant < octants; ++octant) {
      const Vector3 middle = octant_centre(centre, half, octant);
      parts.clear();
      const int detail = inside && crossing_faces(middle, octant_half, nullptr) <= 1 ? 1 : inside ? 4 : 2;
      const Vector3 sample_half = octant_half / detail;
      for (int a = 0; a < detail; ++a)
        for (int b = 0; b < detail; ++b)
          for (int c = 0; c < detail; ++c) {
            const Vector3 x = middle - octant_half + sample_half.cwiseProduct(Vector3(2 * a + 1, 2 * b + 1, 2 * c + 1));
            const auto [fraction, shift] =
                inside ? std::pair(1.0, Vector3(Vector3::Zero())) : part_inside(x, sample_half);
            if (fraction > 0)
              add_region_parts(x, sample_half, fraction, shift, parts);
          }
      for (const RegionPart& part : parts)
        if (part.volume > 1e-4 * 8 * octant_half.prod())
          add_region_point(part);
    }
  }

  /// A point at the centroid of the part.
  void add_region_point(const RegionPart& part) {
    if (std::ssize(cells_.points) - cells_.start.back() == most_cell_points)
      cells_.start.push_back(static_cast<int>(cells_.points.size()));
    cells_.points.push_back({part.moment / part.volume, part.volume});
  }

  bool may_be_split(const Vector3& centre, const Vector3& half) const {
    const double radius = half.norm();
    if (!incision_->near(centre, radius))
      return false;
    const auto sheet = incision_->closest(centre, radius);
    return sheet && std::abs(sheet->normal.dot(centre - sheet->point)) <= touching * sheet->normal.cwiseAbs().dot(half);
  }

  /// The points of a cell that see one another.
  struct Group {
    Vector3 eye; // one of them
    std::vector<QuadraturePoint> points;
  };

  void add_split(const Vector3& centre, const Vector3& half, bool inside) {
    groups_.clear();
    for (int octant = 0; octant < octants; ++octant)
      add_split_octant(octant_centre(centre, half, octant), half / 2, inside);
    add_groups();
  }

  void add_groups() {
    for (const Group& group : groups_)
      for (std::size_t k = 0; k < group.points.size(); ++k) {
        if (std::ssize(cells_.points) - cells_.start.back() == most_cell_points ||
            (k == 0 && std::ssize(cells_.points) > cells_.start.back()))
          cells_.start.push_back(static_cast<int>(cells_.points.size()));
        cells_.points.push_back(group.points[k]);
      }
  }

  /// Whether walls of a narrow gap, and no sheet of a cut, may pass through the box.
  bool is_walled(const Vector3& centre, const Vector3& half) {
    constexpr std::size_t most = 64;
    (void)incision_->walls_between(centre, half, centre, most, found_);
    return !found_.empty() && std::all_of(found_.begin(), found_.end(), [&](int wall) {
      return incision_->triangle_of(wall).first >= incision_->cut_sheets();
    });
  }

  /// The points of a box that a narrow gap may pass: on each side of the gap its own; near its end, where the basis is
  /// enriched as at a front, those of smaller boxes.
  void add_walled(const Vector3& centre, const Vector3& half) {
    groups_.clear();
    const Vector3 octant_half = half / 2, sample_half = half / 4;
    for (int octant = 0; octant < octants; ++octant) {
      const Vector3 middle = octant_centre(centre, half, octant);
      const auto front = incision_->front_frame(middle, front_reach * octant_half.norm());
      const bool at_front = front && front->distance < octant_half.norm();
      material_.clear();
      for (int k = 0; k < octants; ++k) {
        add_material(octant_centre(middle, octant_half, k), sample_half, 0);
        if (at_front || k + 1 == octants) {
          add_seen_together(front, 1e-4 * 8 * (at_front ? sample_half : octant_half).prod());
          material_.clear();
        }
      }
    }
    add_groups();
  }

  /// Material that is seen from one place.
  struct SeenPart {
    Vector3 eye; // that place
    double volume;
    Vector3 moment;
    double nearness; // m2, sum of volumes over their distances from the front
  };

  /// Adds a volume at x to the first part that sees x, or as a part of its own. Distances from the front count as
  /// `least` at least.
  void add_where_seen(const Vector3& x, double volume, const std::optional<topology::FrontFrame>& front, double least,
                      std::vector<SeenPart>& visible) const {
    auto part =
        std::find_if(visible.begin(), visible.end(), [&](const SeenPart& p) { return !incision_->blocks(p.eye, x); });
    if (part == visible.end())
      part = visible.insert(visible.end(), {x, 0, Vector3::Zero(), 0});
    part->volume += volume;
    part->moment += volume * x;
    if (front)
      part->nearness += volume / std::max(off_front(*front, x).norm(), least);
  }

  /// Pieces of material that see one another make one point; those below the volume do not count.
  void add_seen_together(const std::optional<topology::FrontFrame>& front, double least) {
    std::vector<SeenPart> visible;
    for (const BoxPart& piece : material_)
      add_where_seen(piece.centroid, piece.volume, front, nearest * std::cbrt(least), visible);
    for (const SeenPart& part : visible) {
      if (part.volume <= least)
        continue;
      const Vector3 middle = part.moment / part.volume;
      const bool stays = !incision_->blocks(part.eye, middle) && domain_.signed_distance(middle) <= 0;
      const Vector3& x = stays ? middle : part.eye;
      add_to_group(front ? drawn_to(*front, x, part.nearness / part.volume) : x, part.volume);
    }
  }

  /// Parts of a box inside the body, by the planes of the surface on up to two sides of a gap; divided where these do
  /// not tell which corners are inside.
  void add_material(const Vector3& x, const Vector3& half, int depth) {
    constexpr int deepest = 2;
    const double distance = domain_.signed_distance(x), reach = half.norm();
    if (distance >= reach)
      return;
    if (distance <= -reach) {
      material_.push_back({8 * half.prod(), x});
      return;
    }
    const Plane first = tangent_at(x);
    std::array<Vector3, octants> corners;
    Vector3 farthest = x; // of the corners beyond the first plane
    for (int k = 0; k < octants; ++k) {
      corners[k] = x + half.cwiseProduct(Vector3(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1));
      if (k == 0 || first.signed_distance(corners[k]) > first.signed_distance(farthest))
        farthest = corners[k];
    }
    std::optional<Plane> second;
    if (first.signed_distance(farthest) > 0)
      if (const Plane other = tangent_at(farthest); other.normal.dot(first.normal) < -0.3)
        second = other;
    const double slack = 0.05 * half.minCoeff();
    for (int k = 0; depth < deepest && k < octants; ++k) {
      const double told = second ? std::min(first.signed_distance(corners[k]), second->signed_distance(corners[k]))
                                 : first.signed_distance(corners[k]);
      const double is = domain_.signed_distance(corners[k]);
      if ((told < 0) == (is < 0) || std::min(std::abs(told), std::abs(is)) < slack)
        continue;
      for (int octant = 0; octant < octants; ++octant)
        add_material(octant_centre(x, half, octant), half / 2, depth + 1);
      return;
    }
    const auto add_side = [&](const Plane& plane) {
      const BoxPart part = split_box(x, half, plane.offset * plane.normal, plane.normal)[1];
      if (part.volume > 0 && domain_.signed_distance(part.centroid) < 0)
        material_.push_back(part);
      return part.volume;
    };
    if (add_side(first) < (1 - 1e-9) * 8 * half.prod() && second)
      add_side(*second);
  }

  /// The plane of the surface where it is nearest to x.
  [[nodiscard]] Plane tangent_at(const Vector3& x) const {
    const Vector3 normal = domain_.normal(x);
    return {normal, normal.dot(domain_.closest_surface_point(x))};
  }

  void add_split_octant(const Vector3& centre, const Vector3& half, bool inside, bool whole = true) {
    const auto front = incision_->front_frame(centre, front_reach * half.norm());
    if (whole && front && front->distance < half.norm()) {
      for (int octant = 0; octant < octants; ++octant)
        add_split_octant(octant_centre(centre, half, octant), half / 2, inside, false);
      return;
    }
    const auto sheet = incision_->closest(centre, half.norm());
    if (inside) {
      const auto parts = sheet ? split_box(centre, half, sheet->point, sheet->normal)
                               : std::array<BoxPart, 2>{BoxPart{8 * half.prod(), centre}, BoxPart{}};
      if (clear_parts(centre, half, sheet, parts)) {
        const std::array<double, 2> nearness =
            front ? inverse_distances(centre, half, sheet, *front) : std::array<double, 2>{};
        for (std::size_t k = 0; k < 2; ++k)
          if (parts[k].volume > 0)
            add_to_group(front ? drawn_to(*front, parts[k].centroid, nearness[k]) : parts[k].centroid, parts[k].volume);
        return;
      }
    }
    // Samples where the body ends, or where one plane does not tell what hides what: those that see one another count
    // together.
    std::vector<SeenPart> visible;
    const int detail = inside ? 4 : 2;
    const Vector3 sample_half = half / detail;
    for (int a = 0; a < detail; ++a)
      for (int b = 0; b < detail; ++b)
        for (int c = 0; c < detail; ++c) {
          const Vector3 x = centre - half + sample_half.cwiseProduct(Vector3(2 * a + 1, 2 * b + 1, 2 * c + 1));
          const auto [fraction, shift] =
              inside ? std::pair(1.0, Vector3(Vector3::Zero())) : part_inside(x, sample_half);
          if (!(fraction > 0))
            continue;
          const auto plane = incision_->closest(x, sample_half.norm());
          const auto parts = plane ? split_box(x, sample_half, plane->point, plane->normal)
                                   : std::array<BoxPart, 2>{BoxPart{8 * sample_half.prod(), x}, BoxPart{}};
          for (const BoxPart& part : parts) {
            if (part.volume == 0)
              continue;
            const Vector3 moved = part.centroid + shift;
            add_where_seen(incision_->blocks(part.centroid, moved) ? part.centroid : moved, fraction * part.volume,
                           front, nearest * half.minCoeff(), visible);
          }
        }
    for (const SeenPart& part : visible) {
      if (part.volume <= 1e-4 * 8 * half.prod())
        continue;
      const Vector3 middle = part.moment / part.volume;
      const Vector3 place = front ? drawn_to(*front, middle, part.nearness / part.volume) : middle;
      add_to_group(incision_->blocks(part.eye, place) ? part.eye : place, part.volume);
    }
  }

  /// The way from the front, taken as straight along its frame, to x.
  static Vector3 off_front(const topology::FrontFrame& front, const Vector3& x) {
    const Vector3 d = x - front.point;
    return d - d.dot(front.tangent) * front.tangent;
  }

  /// Means of 1 / r over the two parts of a box that the plane of `sheet` makes, the + side first.
  static std::array<double, 2> inverse_distances(const Vector3& centre, const Vector3& half,
                                                 const std::optional<topology::SheetPoint>& sheet,
                                                 const topology::FrontFrame& front) {
    constexpr int detail = 6;
    std::array<double, 2> sum{}, count{};
    for (int a = 0; a < detail; ++a)
      for (int b = 0; b < detail; ++b)
        for (int c = 0; c < detail; ++c) {
          const Vector3 x =
              centre + half.cwiseProduct(Vector3(2 * a + 1 - detail, 2 * b + 1 - detail, 2 * c + 1 - detail)) / detail;
          const std::size_t side = !sheet || sheet->normal.dot(x - sheet->point) >= 0 ? 0 : 1;
          sum[side] += 1 / std::max(off_front(front, x).norm(), nearest * half.minCoeff());
          ++count[side];
        }
    for (std::size_t side = 0; side < 2; ++side)
      sum[side] = count[side] > 0 ? sum[side] / count[side] : 0;
    return sum;
  }

  /// x moved on its ray from the front to where 1 / r is `nearness`, 1/m, unless the cut or the surface is in the way.
  [[nodiscard]] Vector3 drawn_to(const topology::FrontFrame& front, const Vector3& x, double nearness) const {
    const Vector3 arm = off_front(front, x);
    const double r = arm.norm();
    if (!options_.enriched || !(r > 0) || !(nearness > 0))
      return x;
    const Vector3 drawn = x + (1 / (nearness * r) - 1) * arm;
    return incision_->blocks(x, drawn) || domain_.signed_distance(drawn) > 0 ? x : drawn;
  }

  /// Whether each part's centroid sees the part's corners of the octant: then the plane is the whole cut there.
  bool clear_parts(const Vector3& centre, const Vector3& half, const std::optional<topology::SheetPoint>& sheet,
                   const std::array<BoxPart, 2>& parts) const {
    for (int k = 0; k < octants; ++k) {
      const Vector3 corner =
          centre + 0.999 * half.cwiseProduct(Vector3(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1));
      const bool first = !sheet || sheet->normal.dot(corner - sheet->point) >= 0;
      const BoxPart& part = first ? parts[0] : parts[1];
      if (part.volume > 0 && incision_->blocks(part.centroid, corner))
        return false;
    }
    return true;
  }

  void add_to_group(const Vector3& x, double volume) {
    auto group =
        std::find_if(groups_.begin(), groups_.end(), [&](const Group& g) { return !incision_->blocks(g.eye, x); });
    if (group == groups_.end())
      group = groups_.insert(groups_.end(), {x, {}});
    group->points.push_back({x, volume});
  }

  const topology::Domain& domain_;
  BackgroundOptions options_;
  const topology::Incision* incision_;
  bool has_walls_; // of narrow gaps
  BackgroundCells& cells_;
  std::shared_ptr<const BoxMemory::Boxes> known_; // null: nothing is remembered
  BoxMemory::Boxes boxes_;
  std::vector<Group> groups_;
  std::vector<BoxPart> material_;
  std::vector<int> found_;
};

class Octree {
 public:
  Octree(const topology::Domain& domain, const NodeCloud& nodes, const BackgroundOptions& options,
         const topology::Incision* incision, std::shared_ptr<const BoxMemory::Boxes> known)
      : domain_(domain), nodes_(nodes), options_(options), tree_(nodes.positions),
        filler_(domain, options, incision, cells_, std::move(known)) {}

  BoxMemory::Boxes take_boxes() { return filler_.take_boxes(); }

  BackgroundCells build() {
    // Roots as large as the coarsest spacing allows, fitted to the bounding box: a uniform cloud needs no division.
    const BoundingBox box = domain_.bounds();
    const double coarsest = *std::max_element(nodes_.spacings.begin(), nodes_.spacings.end());
    std::array<int, 3> roots{};
    Vector3 size;
    for (int c = 0; c < 3; ++c) {
      roots[c] = std::max(1, static_cast<int>(std::ceil(box.extent()[c] / (options_.cell_size * coarsest) - 1e-6)));
      size[c] = box.extent()[c] / roots[c];
    }
    for (int a = 0; a < roots[0]; ++a)
      for (int b = 0; b < roots[1]; ++b)
        for (int c = 0; c < roots[2]; ++c) {
          interruption_point();
          const Vector3 corner = box.lower + size.cwiseProduct(Vector3(a, b, c));
          divide(corner, corner + size);
        }
    return std::move(cells_);
  }

 private:
  double spacing_near(const Vector3& x) const { return nodes_.spacings[tree_.nearest(x).index]; }

  void divide(const Vector3& lower, const Vector3& upper) {
    const Vector3 centre = 0.5 * (lower + upper), half = 0.5 * (upper - lower);
    const double distance = domain_.signed_distance(centre);
    const double radius = half.norm();
    if (distance > radius)
      return;
    const double longest = 2 * half.maxCoeff(), spacing = spacing_near(centre);
    // A coarse node may be nearest to the centre while fine ones sit in a corner: large cells always divide.
    if (longest > options_.slack * options_.cell_size * spacing || holds_finer_node(centre, half)) {
      std::array<int, 3> parts{};
      for (int c = 0; c < 3; ++c)
        parts[c] = half[c] > 0.3 * longest ? 2 : 1;
      const Vector3 size = (upper - lower).cwiseQuotient(Vector3(parts[0], parts[1], parts[2]));
      for (int a = 0; a < parts[0]; ++a)
        for (int b = 0; b < parts[1]; ++b)
          for (int c = 0; c < parts[2]; ++c) {
            const Vector3 corner = lower + size.cwiseProduct(Vector3(a, b, c));
            divide(corner, corner + size);
          }
      return;
    }
    filler_.fill(centre, half, distance);
  }

  bool holds_finer_node(const Vector3& centre, const Vector3& half) {
    found_.clear();
    tree_.within(centre, half.norm(), found_);
    return std::any_of(found_.begin(), found_.end(), [&](const topology::PointTree::Found& node) {
      const Vector3& x = nodes_.positions[node.index];
      return ((x - centre).cwiseAbs().array() <= half.array()).all() &&
             2 * half.maxCoeff() > finer_node_slack * options_.slack * options_.cell_size * nodes_.spacings[node.index];
    });
  }

  const topology::Domain& domain_;
  const NodeCloud& nodes_;
  BackgroundOptions options_;
  topology::PointTree tree_;
  std::vector<topology::PointTree::Found> found_;
  BackgroundCells cells_;
  BoxFiller filler_;
};

void require_fit(const NodeCloud& nodes, const BackgroundOptions& options) {
  if (options.quadrature < 1 || options.quadrature > 3)
    throw InputError(fmt::format("quadrature rule {}; there are 1, 2 and 3", options.quadrature));
  if (!(options.cell_size > 0) || !std::isfinite(options.cell_size))
    throw InputError(fmt::format("background cells of {} node spacings: the size must be positive", options.cell_size));
  if (nodes.size() == 0)
    throw InputError("background cells need nodes: their spacings set the size");
}

} // namespace

BackgroundCells background_cells(const topology::Domain& domain, const NodeCloud& nodes,
                                 const BackgroundOptions& options, const topology::Incision* incision) {
  require_fit(nodes, options);
  return Octree(domain, nodes, options, incision, nullptr).build();
}

BackgroundCells background_cells(const topology::Domain& domain, const NodeCloud& nodes,
                                 const BackgroundOptions& options, const topology::Incision* incision,
                                 BoxMemory& memory) {
  require_fit(nodes, options);
  Octree octree(domain, nodes, options, incision, memory.known());
  BackgroundCells cells = octree.build();
  memory.keep(octree.take_boxes());
  return cells;
}

std::size_t BoxMemory::Hash::operator()(const Key& key) const {
  std::uint64_t hash = 0;
  for (const double value : key) {
    hash = (hash ^ std::bit_cast<std::uint64_t>(value)) * 0x9e3779b97f4a7c15U;
    hash ^= hash >> 29U;
  }
  return hash;
}

std::shared_ptr<const BoxMemory::Boxes> BoxMemory::known() const {
  const std::lock_guard lock(mutex_);
  return boxes_;
}

void BoxMemory::keep(Boxes boxes) {
  auto next = std::make_shared<const Boxes>(std::move(boxes));
  const std::lock_guard lock(mutex_);
  boxes_.swap(next);
}

std::shared_ptr<BoxMemory> BoxMemory::of(const std::shared_ptr<const topology::Domain>& domain) {
  static std::mutex mutex;
  static std::map<std::weak_ptr<const topology::Domain>, std::shared_ptr<BoxMemory>, std::owner_less<>> memories;
  const std::lock_guard lock(mutex);
  std::erase_if(memories, [](const auto& entry) { return entry.first.expired(); });
  std::shared_ptr<BoxMemory>& memory = memories[domain];
  if (memory == nullptr)
    memory = std::make_shared<BoxMemory>();
  return memory;
}

} // namespace spherecut::solvers
