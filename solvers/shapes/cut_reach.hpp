// What an increment of a cut changes, and which places and nodes that can reach: the questions that a local update
// asks.
#pragma once

#include "solvers/nodes/nodes.hpp"
#include "solvers/shapes/functions.hpp"
#include "topology/search/point_tree.hpp"

#include <optional>

namespace spherecut::solvers {

/// Points of a sheet no farther than `spacing` apart, m: corners and midpoints of its triangles, divided as needed.
std::vector<Vector3> sample_points(const topology::SurfaceMesh& sheet, std::size_t first_triangle, double spacing);

/// Whether the sheets of `now` continue those of `before` triangle by triangle.
bool continues(const topology::Incision* before, const topology::Incision& now);

/// The nodes that are not marked as removed, in their order.
NodeCloud present_nodes(const NodeCloud& nodes, const std::vector<char>& removed);

/// Place of each of `count` nodes after `change`, -1 for those removed. Throws InputError where it names nodes that do
/// not exist or does not come to `grown` nodes.
std::vector<int> places_after(const SprinkleIncrement& change, int count, int grown);

/// Spacing of the present node nearest to a place, or what else the spheres of the method are measured in.
class SpacingAt {
 public:
  SpacingAt(const NodeCloud& nodes, const std::vector<char>& removed,
            std::vector<double> NodeCloud::*lengths = &NodeCloud::spacings)
      : SpacingAt(present_nodes(nodes, removed), lengths) {}
  [[nodiscard]] double operator()(const Vector3& x) const {
    return spacings_[static_cast<std::size_t>(tree_.nearest(x).index)];
  }

 private:
  SpacingAt(const NodeCloud& present, std::vector<double> NodeCloud::*lengths)
      : spacings_(present.*lengths), tree_(present.positions) {}
  std::vector<double> spacings_;
  topology::PointTree tree_;
};

/// Where the cut differs: the new faces, and the front that was or has come.
struct Changes {
  std::vector<Vector3> faces, front;
};

/// `spacing` m: how far apart the places may be.
Changes changes_between(const topology::Incision* before, const SpacingAt& spacing_before,
                        const topology::Incision& now, const SpacingAt& spacing_now, double spacing);

/// Places on the front of an incision (null: none) no farther than `spacing` apart.
void add_front(const topology::Incision* incision, double spacing, std::vector<Vector3>& places);

/// Distance to the nearest of some points, infinite when there are none.
class Nearness {
 public:
  explicit Nearness(const std::vector<Vector3>& points) {
    if (!points.empty())
      tree_.emplace(points);
  }
  struct Found {
    int index = -1;
    double distance = std::numeric_limits<double>::infinity(); // m
  };
  [[nodiscard]] Found find(const Vector3& x) const {
    if (!tree_)
      return {};
    const topology::PointTree::Found nearest = tree_->nearest(x);
    return {nearest.index, std::sqrt(nearest.squared_distance)};
  }
  [[nodiscard]] double operator()(const Vector3& x) const { return find(x).distance; }

 private:
  std::optional<topology::PointTree> tree_;
};

/// What is known of a change beside its places: what is new of the incision, and who has other branch functions.
struct KnownChange {
  const topology::Incision* incision = nullptr; // as it is now
  std::vector<int> triangles;                   // of each sheet those from here on are new, and all of sheets beyond
  std::vector<char> turned;                     // by node: the front nearest to it is another one
};
KnownChange known_change(const topology::Incision* before, const topology::Incision& now, const Spheres& spheres_before,
                         const Spheres& spheres_now);

/// How far x is from the box centre +- half, m.
inline double distance_to_box(const Vector3& x, const Vector3& centre, const Vector3& half) {
  return ((x - centre).cwiseAbs() - half).cwiseMax(0).norm();
}

/// Which places a change of the cut can reach: a point x sees a node y of sphere radius R another way only where some
/// changed place p of faces or front lies on the way, |x - p| + |p - y| < R. Coarse nodes far from the change have
/// large spheres that it does not concern.
class Reach {
 public:
  /// `radii` of the spheres about `nodes`, 0: absent. `slack` m: how far places between the given ones may be off.
  /// `all_front`: all there is of the front, changed or not; `enriched`: reach of its enrichment in sphere radii.
  /// Without what is `known` whatever is near enough counts as hidden, and as turned.
  Reach(const std::vector<Vector3>& faces, const std::vector<Vector3>& front, const std::vector<Vector3>& all_front,
        double enriched, const std::vector<Vector3>& nodes, const std::vector<double>& radii, double slack,
        KnownChange known = {});

  /// Whether something within `half` m of x sees or is hidden differently, or is enriched by other functions.
  [[nodiscard]] bool sees(const Vector3& x, double half) const;
  /// Whether a place within `half` m of x is nearer to the front, or to the faces, than `radii` sphere radii there.
  [[nodiscard]] bool near_front(const Vector3& x, double half, double radii) const {
    const Nearness::Found front = to_front_.find(x);
    return front.distance - half - slack_ < radii * radius_beside(front, front_radii_);
  }
  [[nodiscard]] bool near_faces(const Vector3& x, double half, double radii) const {
    const Nearness::Found faces = to_faces_.find(x);
    return faces.distance - half - slack_ < radii * radius_beside(faces, faces_radii_);
  }

  /// The same of a box centre +- half, m, more closely: by the ways over every changed place and what stands between.
  [[nodiscard]] bool sees(const Vector3& centre, const Vector3& half) const;
  /// Whether some place of a box may be enriched by a front that has changed.
  [[nodiscard]] bool at_front(const Vector3& centre, const Vector3& half) const;
  /// Whether new faces come into a box of the quadrature, or a front that has changed so near that points of it are
  /// placed for it (background_cells.hpp).
  [[nodiscard]] bool moves_points(const Vector3& centre, const Vector3& half) const;

 private:
  struct Eye {
    Vector3 position;
    double radius, spare;
    bool at_face; // and lifted off it
  };
  /// Whether a way from a box, `nearest` m off the places, leads over one of them to one of the eyes.
  [[nodiscard]] bool passes(const std::vector<Vector3>& places, const std::vector<Eye>& eyes, bool by_new,
                            double nearest, const Vector3& centre, const Vector3& half) const;
  /// Whether a sheet may hide some place of a box from an eye; with `by_new` a new face of it.
  [[nodiscard]] bool is_hidden(const Vector3& centre, const Vector3& half, const Eye& eye, bool by_new) const;
  /// Radius of the sphere about the node nearest to a place.
  static double radius_beside(const Nearness::Found& place, const std::vector<double>& radii) {
    return place.index >= 0 ? radii[static_cast<std::size_t>(place.index)] : 0;
  }

  /// Whether a box is nearer to one of the places than the enrichment reaches there.
  [[nodiscard]] bool is_enriched(const std::vector<Vector3>& places, const BoundingBox& around, const Vector3& centre,
                                 const Vector3& half) const;
  /// Whether a box is nearer to one of some places, all inside `around`, than `reach` m.
  [[nodiscard]] bool comes_near(const std::vector<Vector3>& places, const BoundingBox& around, double reach,
                                const Vector3& centre, const Vector3& half) const;

  std::vector<Vector3> faces_, front_, all_front_;
  BoundingBox around_faces_, around_front_, around_all_; // m
  std::vector<double> faces_radii_, front_radii_;        // m, of the spheres about the nodes nearest to them
  double largest_beside_ = 0;                            // m, of those beside any front
  Nearness to_faces_, to_front_, to_all_;
  double enriched_;
  std::vector<Eye> by_faces_, by_front_, by_branch_; // the first two by falling spare
  KnownChange known_;
  double slack_;
};

/// Rings of new nodes stand this far from the sheet or its front, and crowded nodes within it are removed; in units of
/// the sphere radius. What their spheres covered or will cover changes too.
inline constexpr double node_margin = 0.35;

/// Nodes are exchanged so far from new faces, in spacings (extend_sprinkling), and are nearest to places a little
/// farther away.
inline constexpr double exchange_reach = 3;

/// How far a cut may go on, in spacings, until what was eliminated ahead of it has to be chosen anew (`collocation`).
inline constexpr double advance_before_new = 0.5;

/// Whether an increment along `way` may change what lies within `half` m of x.
class ReachAlong {
 public:
  /// `before`: the cut as it is, null: none. `radii`: of the spheres about `nodes`; new ones may be larger by
  /// `front_growth`. `enriched` as Reach. With `nodes_may_coarsen` also where the nodes that the
  /// increment exchanges are of another spacing.
  ReachAlong(const topology::SurfaceMesh& way, const topology::Incision* before, const NodeCloud& nodes,
             const std::vector<char>& removed, const std::vector<double>& radii, double enriched, double front_growth,
             bool nodes_may_coarsen);
  [[nodiscard]] bool operator()(const Vector3& x, double half) const {
    return reach_->sees(x, half) || reach_->near_faces(x, half, margin_) || reach_->near_front(x, half, front_);
  }

 private:
  double margin_, front_; // in sphere radii
  std::optional<Reach> reach_;
};

} // namespace spherecut::solvers
