// Shape functions near a cut: which nodes a point sees, how far it is around the front to the others, and the basis
// that is enriched there.
#pragma once

#include "solvers/quadrature/background_cells.hpp"
#include "solvers/shapes/kernel.hpp"
#include "solvers/shapes/sight.hpp"

#include <atomic>

namespace spherecut::solvers {

/// The four leading terms of the field at a crack front, sqrt(r) {cos t/2, sin t/2, sin t/2 sin t, cos t/2 sin t}, in
/// sqrt(m), with their gradients. (r, t) are polar coordinates about the front; t passes beyond +-pi where the sheet
/// curves away from the plane of the front, so that the jump lies on the sheet.
struct Branch {
  std::array<double, 4> value{};
  std::array<Vector3, 4> gradient{}; // 1/sqrt(m); the turning of the frame along a curved front is left out
};
Branch branch_at(const topology::Incision& incision, const topology::FrontFrame& frame, const Vector3& x);

/// What a point sees around it.
struct PointView {
  topology::Eye eye{Vector3::Zero()};        // known where nodes are hidden
  std::optional<topology::FrontFrame> front; // nearest, where it may matter
};

/// What the points of one background cell see of the nodes around it.
struct CellView {
  std::vector<std::uint32_t> hidden; // per node of the cell, bit q: it does not see point q
  std::uint32_t altered = 0;         // bit q: the cut alters the shape functions at point q
  std::uint32_t on_sheet = 0;        // bit q: point q lies on a sheet, what it sees is not known; altered, too
  std::vector<PointView> points;     // of those that are altered
  std::vector<int> walls;            // memory of the search
};

/// What the spheres of a node cloud know of the cut. Immutable once built; queries are thread safe and do not allocate
/// once warm.
class CutSight {
 public:
  CutSight(const Sight& sight, const std::vector<Vector3>& centres, const std::vector<double>& spacings,
           const std::vector<double>& radii);
  /// After spheres have grown.
  void update_radii(const std::vector<Vector3>& centres, const std::vector<double>& radii);

  [[nodiscard]] const Sight& sight() const { return sight_; }

  /// Whether the cut may matter to a point with these nodes in reach.
  [[nodiscard]] bool concerns(const shape_kernel::Support& support) const {
    unsigned any = 0;
    for (int k = 0; k < support.count; ++k)
      any |= concern_[support.ids[k]];
    return any != 0;
  }

  [[nodiscard]] bool concerns(int node) const { return concern_[node] != 0; }

  /// Whether x lies in the reach of the enrichment.
  [[nodiscard]] bool enriches(const Vector3& x) const;

  /// x, or a point 1e-6 radii off the sheet on its + side where x lies on it.
  [[nodiscard]] Vector3 off_the_sheet(const Vector3& x) const;

  /// Looks around from all points of a cell at once: `nodes` are those whose spheres, as known here, hold any of them,
  /// and bit q of `reached` tells of the k-th that it holds point q. Only what may stand between a node and the box of
  /// the points is looked at point by point.
  void look(std::span<const QuadraturePoint> points, std::span<const int> nodes, std::span<const std::uint32_t> reached,
            CellView& view) const;

  enum class Enrich { where_near, never };
  /// Shape functions at x on the nodes of `support` (all whose spheres hold x, sizes included; it is overwritten). With
  /// `grown` set the spheres are larger than the ones known here. False as shape_kernel::evaluate_support, or with
  /// fewer nodes than basis functions + `spare`.
  bool evaluate(const shape_kernel::Kernel& kernel, const Vector3& x, shape_kernel::Support& support, bool grown,
                bool second, int spare, double worst_condition, Enrich enrich, ShapeFunctions& out) const;

  /// The same with first derivatives for a point that has looked around: the k-th node of the support is hidden from it
  /// where hidden[k] is not 0. The support has room for SphereGrid::lanes entries beyond the last.
  bool evaluate_seen(const shape_kernel::Kernel& kernel, const Vector3& x, const PointView& view,
                     std::span<const char> hidden, shape_kernel::Support& support, double worst_condition,
                     ShapeFunctions& out) const;

 private:
  enum : std::uint8_t { touches_sheet = 1, near_front = 2 };
  /// Reach of the enrichment about a point whose nearest place on the front is `frame`. It follows the node spacing
  /// along the front, linear between the ends of a segment, so that it does not jump from one to the next.
  struct EnrichedReach {
    double length = 0; // m
    Vector3 gradient = Vector3::Zero();
  };
  struct Wanted {
    bool second, enriched;
    int spare;
    double worst_condition;
  };
  bool evaluate_seen(const shape_kernel::Kernel& kernel, const Vector3& x, const PointView& view,
                     std::span<const char> hidden, const Wanted& wanted, shape_kernel::Support& support,
                     ShapeFunctions& out) const;
  bool weigh(const Vector3& x, const PointView& view, std::span<const char> hidden,
             shape_kernel::Support& support) const;
  [[nodiscard]] static shape_kernel::Moments linear_moments(shape_kernel::Support& support);
  void enrich(const Vector3& x, const topology::FrontFrame& front, const EnrichedReach& around,
              const shape_kernel::Support& support, shape_kernel::Moments& moments) const;
  [[nodiscard]] EnrichedReach reach_at(const Vector3& x, const topology::FrontFrame& frame) const;

  Sight sight_;

  std::vector<std::uint8_t> concern_;                // per node
  std::vector<double> known_radii_;                  // m, per node
  std::vector<topology::Eye> eyes_;                  // per node
  std::vector<double> front_distance_;               // m, per node; infinite when far
  std::vector<Branch> branch_;                       // per node; zero when far from the front
  std::vector<std::array<double, 2>> front_spacing_; // m, at both ends of every segment of the front
  double longest_reach_ = 0;                         // m, of the enrichment
  double smallest_radius_ = 0;                       // m
};

/// Wall clock that this thread has spent so far on what points see around cuts (sight lines, ways around the front, the
/// frame of the nearest front), s. Take differences.
double sight_seconds();

/// Sight of a loop that threads share: its part of their time counts as that part of the loop's wall clock, for the
/// thread that waits for them.
class SharedSightTime {
 public:
  SharedSightTime();
  ~SharedSightTime();
  SharedSightTime(const SharedSightTime&) = delete;
  SharedSightTime& operator=(const SharedSightTime&) = delete;

  /// Lives as long as a range of the loop is worked on.
  class Part {
   public:
    explicit Part(const SharedSightTime& whole);
    ~Part();
    Part(const Part&) = delete;
    Part& operator=(const Part&) = delete;

   private:
    const SharedSightTime& whole_;
    double begin_, sight_begin_; // s
  };

 private:
  double begin_, sight_begin_;                // s
  mutable std::atomic<double> sight_, spent_; // s, of all parts
};

} // namespace spherecut::solvers
